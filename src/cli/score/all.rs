//! `reproduce score --protocol all`: the same frames under every protocol, a row each.

use super::pairs::{self, Pair};
use super::{Context, Score, emit, emit_json, written};
use anyhow::{Context as _, Result};
use serde_json::json;
use skinsplat_metrics::lpips::OneFrame;
use skinsplat_metrics::lpips::weights::Networks;
use skinsplat_metrics::{
    FrameScore, MetricId, MetricsError, PROTOCOLS, Protocol, Region, Summary, Truth, Wanted,
};
use skinsplat_table::{self as table, Column, Content, Digits, Direction, Label, Table};
use std::slice::from_mut;

/// What stands for all protocols.
pub(super) const ID: &str = "all";

/// One protocol's scores, or why there are none.
struct Row {
    protocol: &'static Protocol,
    outcome: Result<Summary, String>,
    /// Frames whose render lies over another background than the protocol's.
    over_another_background: usize,
}

/// One frame under one protocol.
struct Cell {
    /// The score, or why this protocol cannot have one.
    score: Result<FrameScore, String>,
    over_another_background: bool,
}

/// Scores the frames under every preset and prints the table.
pub(super) fn run(arguments: &Score, pairs: &[Pair], context: Context) -> Result<()> {
    let networks = arguments.weights.networks()?;
    let mut frames = pairs::each(pairs, context, |pair| frame(arguments, pair, &networks))?;
    let mut rows = Vec::new();
    for protocol in PROTOCOLS.iter().rev() {
        let cells: Vec<Cell> = frames.iter_mut().filter_map(Vec::pop).collect();
        let over_another_background = cells.iter().filter(|cell| cell.over_another_background).count();
        let scores: Result<Vec<FrameScore>, String> = cells.into_iter().map(|cell| cell.score).collect();
        let outcome = match scores {
            Ok(scores) => Ok(protocol.aggregate(&scores)?),
            Err(reason) => Err(reason),
        };
        rows.push(Row { protocol, outcome, over_another_background });
    }
    rows.reverse();
    match arguments.format.as_str() {
        "json" => emit_json(&json(&rows, pairs.len())),
        format => emit(&written(&table(&rows, pairs.len()), format)),
    }
}

/// A frame under every preset, in their order.
fn frame(arguments: &Score, pair: &Pair, networks: &Networks) -> Result<Vec<Cell>> {
    let loaded = pair.load()?;
    let distances = OneFrame::new(networks);
    let metrics: Vec<MetricId> = MetricId::of_images().collect();
    let wanted = Wanted { lpips: Some(&distances), ..Wanted::of(&metrics) };
    let cell = |protocol: &Protocol| {
        let background = arguments.background(Some(protocol));
        let (render, truth) = loaded.over(background)?;
        let truth = Truth::Composited { rgb: &truth, mask: loaded.mask() };
        let score = match protocol.score_with(&render, truth, wanted) {
            Err(error) if is_of_the_input(&error) => return Err(error).with_context(|| pair.files()),
            score => score.map_err(|error| error.to_string()),
        };
        Ok(Cell { score, over_another_background: loaded.lies_over_another(background) })
    };
    PROTOCOLS.iter().map(cell).collect()
}

/// Whether no protocol could score these files.
fn is_of_the_input(error: &MetricsError) -> bool {
    matches!(error, MetricsError::SizeMismatch { .. } | MetricsError::NotFinite { .. })
}

fn json(rows: &[Row], frames: usize) -> serde_json::Value {
    let row = |row: &Row| {
        json!({
            "protocol": row.protocol,
            "scores": row.outcome.as_ref().ok(),
            "not_computed": row.outcome.as_ref().err(),
            "frames_over_another_background": row.over_another_background,
        })
    };
    json!({ "frames": frames, "protocols": rows.iter().map(row).collect::<Vec<_>>() })
}

/// A row per protocol, with its choices.
fn table(rows: &[Row], frames: usize) -> Table {
    let metric = |id: MetricId| {
        let better = Direction::higher_if(id.higher_is_better());
        Column::new(id.id(), id.title()).digits(digits(id)).better(better)
    };
    let choices = [
        ("background", "background"),
        ("region", "region"),
        ("ssim_variant", "SSIM variant"),
        ("lpips_variant", "LPIPS variant"),
    ];
    let mut table = Table {
        sentences: vec![format!("{frames} frames"), spread(rows)],
        labels: vec![Label::new("protocol", "protocol")],
        columns: MetricId::of_images().map(metric).collect(),
        ..Table::new("protocols", "The same frames under every protocol")
    };
    table.columns.extend(choices.map(|(key, title)| Column::text(key, title)));
    for row in rows {
        let key = row.protocol.key().to_string();
        let cells = cells(row, frames, &mut table.notes);
        table.rows.push(skinsplat_table::Row::new(&key, [&key], cells));
    }
    table
}

/// One digit more than in the tables of a run.
fn digits(metric: MetricId) -> Digits {
    Digits::Decimals(metric.decimals() + 1)
}

fn cells(row: &Row, frames: usize, notes: &mut Vec<String>) -> Vec<table::Cell> {
    let protocol = row.protocol;
    let summary = row.outcome.as_ref().ok();
    let metric = |id: MetricId| match summary.and_then(|summary| summary.value(id)) {
        Some(value) => table::Cell::number(value, digits(id)),
        None => table::Cell::new(Content::NotComputed, digits(id)),
    };
    let mut metrics: Vec<table::Cell> = MetricId::of_images().map(metric).collect();
    let mut note = |note: String, cells: &mut [table::Cell]| {
        cells.iter_mut().for_each(|cell| cell.notes.push(notes.len()));
        notes.push(note);
    };
    let reason = |reason: &str| format!("{}: not computed: {reason}", protocol.id);
    match &row.outcome {
        Err(why) => note(reason(why), &mut metrics),
        Ok(summary) => {
            for (cell, id) in metrics.iter_mut().zip(MetricId::of_images()) {
                summary.not_computed.get(&id).into_iter().for_each(|why| note(reason(why), from_mut(cell)));
            }
        }
    }
    if row.over_another_background > 0 {
        note(
            format!(
                "{}: {} of {frames} renders lie over another background than its own: not its number; --background \
                 R,G,B puts the truth over theirs",
                protocol.id, row.over_another_background
            ),
            &mut metrics,
        );
    }
    let background =
        protocol.background_colour().map_or("captured".to_owned(), |[r, g, b]| format!("{r},{g},{b}"));
    let choices = [Region::id(protocol.region), protocol.ssim.id(), protocol.lpips.id()].map(str::to_owned);
    metrics.into_iter().chain([background].into_iter().chain(choices).map(table::Cell::text)).collect()
}

/// How far the protocols lie apart: those of the whole image, with renders over the right background.
fn spread(rows: &[Row]) -> String {
    let comparable = |row: &&Row| row.protocol.region == Region::Full && row.over_another_background == 0;
    let summaries: Vec<&Summary> =
        rows.iter().filter(comparable).filter_map(|row| row.outcome.as_ref().ok()).collect();
    if summaries.is_empty() {
        return "No protocol of the whole image scores all of them over its own background".to_owned();
    }
    let range = |id: MetricId| {
        let values = summaries.iter().filter_map(|summary| summary.value(id));
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        format!("{} {} to {}", id.title(), digits(id).show(low), digits(id).show(high))
    };
    let ranges: Vec<String> = MetricId::of_images().map(range).collect();
    format!("The protocol alone, whole images: {}", ranges.join(", "))
}
