//! Real data against the numbers that the paper prints.

use super::{Changes, Fate, Line, Note};
use crate::experiment::Source;
use crate::report::results::{Results, TableResults};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Row, RowKind, Table};

/// Standard deviations over our seeds by which a number may miss the printed one.
const SPREADS: f64 = 2.0;

/// Judges every number that has a printed one beside it. A number agrees if it is no farther from the printed one than half of that
/// one's last digit and twice our standard deviation over seeds, where there are several. Numbers of stand-in data are not
/// judged: they are of other people.
pub fn against_paper(results: &Results) -> Changes {
    let mut changes = Changes::default();
    for table in results.tables.iter().filter(|table| table.paper.is_some()) {
        match table.source {
            Source::Own => judge(table, &mut changes),
            Source::StandIn => changes.notes.push(not_judged(table, "stand-in data, which does not compare")),
            Source::Absent => changes.notes.push(not_judged(table, "its data is not here")),
        }
    }
    if results.tables.iter().all(|table| table.paper.is_none()) {
        let text = "no table has printed numbers: not judged".to_owned();
        changes.notes.push(Note { left_out: true, text });
    }
    changes.finish()
}

fn not_judged(table: &TableResults, why: &str) -> Note {
    Note { left_out: true, text: format!("{}: {why}: not judged", table.experiment) }
}

/// The rows of a table, each with the printed row under it.
fn judge(results: &TableResults, changes: &mut Changes) {
    let table = &results.table;
    let mut ours: Option<&Row> = None;
    for row in &table.rows {
        match row.kind {
            RowKind::Measured | RowKind::Mean => ours = Some(row),
            RowKind::Difference => {}
            RowKind::Paper => {
                let Some(ours) = ours else { continue };
                changes.compared += 1;
                let columns = table.columns.iter().zip(ours.cells.iter().zip(&row.cells));
                let lines = columns.filter_map(|(column, (cell, printed))| {
                    line(results, place(table, column, ours), column, cell, printed)
                });
                changes.lines.extend(lines);
            }
        }
    }
}

/// Sequence and variant of a cell.
fn place(table: &Table, column: &Column, row: &Row) -> [String; 2] {
    match (&column.group, row.labels.as_slice()) {
        (Some(sequence), [variant, ..]) => [sequence.clone(), variant.clone()],
        (None, [sequence, variant, ..]) => [sequence.clone(), variant.clone()],
        _ => [table.title.clone(), row.id.clone()],
    }
}

fn line(
    results: &TableResults,
    [sequence, variant]: [String; 2],
    column: &Column,
    ours: &Cell,
    printed: &Cell,
) -> Option<Line> {
    let (key, fitted) =
        column.key.strip_suffix("-fitted").map_or((column.key.as_str(), false), |key| (key, true));
    let metric = MetricId::from_id(key)?;
    let paper = printed.content.value()?;
    let decimals = printed.text.split_once('.').map_or(0, |(_, digits)| digits.len());
    let last_digit = (0..decimals).fold(0.5, |digit, _| digit / 10.0);
    let tolerance = last_digit + SPREADS * ours.spread.unwrap_or(0.0);
    let current = ours.content.value();
    let fate = current.map_or(Fate::Missing, |value| Fate::of(metric, paper, value, tolerance));
    Some(Line {
        table: results.experiment.clone(),
        sequence,
        variant,
        metric: Some(metric),
        fitted,
        baseline: Some(paper),
        current,
        tolerance: Some(tolerance),
        fate,
        frames: Vec::new(),
    })
}
