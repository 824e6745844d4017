//! `reproduce score --protocol all`: the same frames under every protocol, a row each.

use super::pairs::{self, Pair};
use super::{Context, Format, Score, emit, emit_json};
use anyhow::{Context as _, Result};
use serde_json::json;
use skinsplat_metrics::lpips::OneFrame;
use skinsplat_metrics::lpips::weights::Networks;
use skinsplat_metrics::{FrameScore, MetricsError, PROTOCOLS, Protocol, Region, Summary, Truth, Wanted};
use std::fmt::Write;

/// What stands for all protocols.
pub(super) const ID: &str = "all";

/// One protocol's scores, or why there are none.
struct Row {
    protocol: &'static Protocol,
    outcome: Result<Summary, String>,
    /// Why there is no LPIPS.
    lpips_missing: Option<String>,
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
        let missing = |scores: &Vec<FrameScore>| scores.iter().find_map(|score| score.lpips_missing.clone());
        let lpips_missing = scores.as_ref().ok().and_then(missing);
        let outcome = match scores {
            Ok(scores) => Ok(protocol.aggregate(&scores)?),
            Err(reason) => Err(reason),
        };
        rows.push(Row { protocol, outcome, lpips_missing, over_another_background });
    }
    rows.reverse();
    match arguments.format {
        Format::Json => emit_json(&json(&rows, pairs.len())),
        Format::Text => emit(&text(&rows, pairs.len())),
    }
}

/// A frame under every preset, in their order.
fn frame(arguments: &Score, pair: &Pair, networks: &Networks) -> Result<Vec<Cell>> {
    let loaded = pair.load()?;
    let distances = OneFrame::new(networks);
    let cell = |protocol: &Protocol| {
        let background = arguments.background(Some(protocol));
        let (render, truth) = loaded.over(background)?;
        let truth = Truth::Composited { rgb: &truth, mask: loaded.mask() };
        let score = match protocol.score_with(&render, truth, Wanted { ssim: true, lpips: Some(&distances) })
        {
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
            "lpips_not_computed": row.lpips_missing,
            "frames_over_another_background": row.over_another_background,
        })
    };
    json!({ "frames": frames, "protocols": rows.iter().map(row).collect::<Vec<_>>() })
}

const TITLES: [&str; 8] =
    ["protocol", "PSNR", "SSIM", "LPIPS", "background", "region", "SSIM variant", "LPIPS variant"];

/// A Markdown table whose columns line up, and notes below it.
fn text(rows: &[Row], frames: usize) -> String {
    let (cells, notes): (Vec<_>, Vec<_>) = rows.iter().map(|row| (cells(row), notes(row, frames))).unzip();
    let width = |column: usize| {
        let widths = cells.iter().map(|cells: &[String; 8]| cells[column].chars().count());
        widths.chain([TITLES[column].len()]).max().unwrap_or(0)
    };
    let widths: [usize; 8] = std::array::from_fn(width);
    let line = |cells: &[String; 8]| {
        let cells = cells.iter().zip(widths).map(|(cell, width)| format!(" {cell:width$} |"));
        format!("|{}\n", cells.collect::<String>())
    };
    let mut text = line(&TITLES.map(str::to_owned));
    text += &line(&widths.map(|width| "-".repeat(width)));
    text.extend(cells.iter().map(line));
    let _ = writeln!(text, "\n{frames} frames. {}", spread(rows));
    text.extend(notes);
    text
}

fn cells(row: &Row) -> [String; 8] {
    let protocol = row.protocol;
    let id = protocol.key().to_string();
    let known =
        |value: Option<f64>| value.map_or_else(|| "not computed".to_owned(), |value| format!("{value:.5}"));
    let [psnr, ssim, lpips] = match &row.outcome {
        Err(_) => ["not computed".to_owned(), "-".to_owned(), "-".to_owned()],
        Ok(summary) => [format!("{:.3}", summary.psnr), known(summary.ssim), known(summary.lpips)],
    };
    let background = match protocol.background_colour() {
        Some([r, g, b]) => format!("{r},{g},{b}"),
        None => "captured".to_owned(),
    };
    let region = Region::id(protocol.region).to_owned();
    [id, psnr, ssim, lpips, background, region, protocol.ssim.id().to_owned(), protocol.lpips.id().to_owned()]
}

fn notes(row: &Row, frames: usize) -> String {
    let id = &row.protocol.id;
    let mut notes = String::new();
    let reason = row.outcome.as_ref().err().or(row.lpips_missing.as_ref());
    if let Some(reason) = reason {
        let _ = writeln!(notes, "{id}: not computed: {reason}");
    }
    if row.over_another_background > 0 {
        let _ = writeln!(
            notes,
            "{id}: {} of {frames} renders lie over another background than its own: not its number; --background R,G,B \
             puts the truth over theirs",
            row.over_another_background
        );
    }
    notes
}

/// How far the protocols lie apart: those of the whole image, with renders over the right background.
fn spread(rows: &[Row]) -> String {
    let comparable = |row: &&Row| row.protocol.region == Region::Full && row.over_another_background == 0;
    let summaries: Vec<&Summary> =
        rows.iter().filter(comparable).filter_map(|row| row.outcome.as_ref().ok()).collect();
    let range = |value: &dyn Fn(&Summary) -> Option<f64>, digits: usize| {
        let values = summaries.iter().filter_map(|summary| value(summary));
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        format!("{low:.digits$} to {high:.digits$}")
    };
    format!(
        "The protocol alone, whole images: PSNR {}, SSIM {}, LPIPS {}.",
        range(&|summary| Some(summary.psnr), 3),
        range(&|summary| summary.ssim, 5),
        range(&|summary| summary.lpips, 5)
    )
}
