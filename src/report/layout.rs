//! The shapes of the paper's tables: a row per sequence and variant, or a row per variant with a group of columns per
//! sequence.

use crate::experiment::{self, Layout};
use skinsplat_table::{Cell, Column, Digits, Direction, Label, Row, RowKind};

/// The numbers of one sequence (or of the mean) and one variant.
pub(super) struct Entry {
    /// Unique in the table: `dataset/subject/sequence/variant`, with the kind unless it is measured.
    pub(super) id: String,
    /// The sequence, or the title of the mean.
    pub(super) sequence: String,
    /// The variant.
    pub(super) variant: String,
    /// What the numbers are.
    pub(super) kind: RowKind,
    /// One per column of the experiment.
    pub(super) cells: Vec<Cell>,
    /// Frames behind the numbers.
    pub(super) frames: usize,
    /// Frames that should be behind them and are not.
    pub(super) missing: usize,
}

/// Headings, columns and rows.
pub(super) struct Shape {
    pub(super) labels: Vec<Label>,
    pub(super) columns: Vec<Column>,
    pub(super) rows: Vec<Row>,
}

/// Brings entries into shape.
pub(super) fn shape(layout: Layout, columns: &[experiment::Column], entries: Vec<Entry>) -> Shape {
    match layout {
        Layout::Rows => rows(columns, entries),
        Layout::Wide => wide(columns, entries),
    }
}

/// Which values of a column are better.
pub(super) fn direction(column: &experiment::Column) -> Direction {
    Direction::higher_if(column.metric.higher_is_better())
}

fn column(column: &experiment::Column) -> Column {
    let id =
        if column.fitted { format!("{}-fitted", column.metric.id()) } else { column.metric.id().to_owned() };
    Column::new(id, column.title()).digits(digits(column)).better(direction(column))
}

/// With how many digits a column is printed.
pub(super) fn digits(column: &experiment::Column) -> Digits {
    Digits::Decimals(column.decimals())
}

fn rows(columns: &[experiment::Column], entries: Vec<Entry>) -> Shape {
    let row = |entry: Entry| Row {
        kind: entry.kind,
        sample: entry.frames,
        missing: entry.missing,
        ..Row::new(entry.id, [entry.sequence, entry.variant], entry.cells)
    };
    Shape {
        labels: vec![Label::new("sequence", "Sequence").once(), Label::new("variant", "Variant")],
        columns: columns.iter().map(column).collect(),
        rows: entries.into_iter().map(row).collect(),
    }
}

/// The mean is one more group of columns; the frames of a row are those of its sequences.
fn wide(columns: &[experiment::Column], entries: Vec<Entry>) -> Shape {
    let mut groups: Vec<String> = Vec::new();
    let mut lines: Vec<(RowKind, String)> = Vec::new();
    let line = |entry: &Entry| match entry.kind {
        RowKind::Mean => (RowKind::Measured, entry.variant.clone()),
        kind => (kind, entry.variant.clone()),
    };
    for entry in &entries {
        if !groups.contains(&entry.sequence) {
            groups.push(entry.sequence.clone());
        }
        if !lines.contains(&line(entry)) {
            lines.push(line(entry));
        }
    }
    let row = |(kind, variant): (RowKind, String)| {
        let of_line = |entry: &&Entry| line(entry) == (kind, variant.clone());
        let sequences = || entries.iter().filter(of_line).filter(|entry| entry.kind != RowKind::Mean);
        let cells = groups.iter().flat_map(|group| {
            let entry = entries.iter().filter(of_line).find(|entry| entry.sequence == *group);
            entry.map_or_else(|| vec![Cell::empty(); columns.len()], |entry| entry.cells.clone())
        });
        Row {
            kind,
            sample: sequences().map(|entry| entry.frames).sum(),
            missing: sequences().map(|entry| entry.missing).sum(),
            ..Row::new(format!("{}/{variant}", kind.id()), [variant.clone()], cells.collect())
        }
    };
    Shape {
        labels: vec![Label::new("method", "Method")],
        columns: groups
            .iter()
            .flat_map(|group| columns.iter().map(move |c| column(c).group(group)))
            .collect(),
        rows: lines.into_iter().map(row).collect(),
    }
}
