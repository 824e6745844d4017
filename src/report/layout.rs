//! The shapes of the paper's tables: a row per sequence and variant, or a row per variant with a group of columns per
//! sequence.

use super::table::{Cell, Row, RowKind, TableColumn, mark_best};
use crate::experiment::{Column, Layout};

/// The numbers of one sequence (or of the mean) and one variant.
pub(super) struct Entry {
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
    pub(super) labels: Vec<String>,
    pub(super) columns: Vec<TableColumn>,
    pub(super) rows: Vec<Row>,
}

/// Marks the best measured value of each sequence (and of the mean) in every column.
pub(super) fn mark_best_per_sequence(entries: &mut [Entry], columns: &[Column]) {
    let measured = |entry: &Entry| matches!(entry.kind, RowKind::Measured | RowKind::Mean);
    let mut groups: Vec<(RowKind, String)> = Vec::new();
    for entry in entries.iter().filter(|entry| measured(entry)) {
        let group = (entry.kind, entry.sequence.clone());
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    for (kind, sequence) in groups {
        let mut rows: Vec<&mut Vec<Cell>> = entries
            .iter_mut()
            .filter(|entry| entry.kind == kind && entry.sequence == sequence)
            .map(|entry| &mut entry.cells)
            .collect();
        mark_best(&mut rows, columns.iter().map(|column| column.metric));
    }
}

/// Brings entries into shape.
pub(super) fn shape(layout: Layout, columns: &[Column], entries: Vec<Entry>) -> Shape {
    match layout {
        Layout::Rows => rows(columns, entries),
        Layout::Wide => wide(columns, entries),
    }
}

fn column(column: &Column, group: Option<&str>) -> TableColumn {
    TableColumn {
        group: group.map(str::to_owned),
        title: column.title().to_owned(),
        metric: column.metric,
        decimals: column.decimals(),
    }
}

fn rows(columns: &[Column], entries: Vec<Entry>) -> Shape {
    let row = |entry: Entry| Row {
        kind: entry.kind,
        labels: vec![entry.sequence, entry.variant],
        cells: entry.cells,
        frames: entry.frames,
        missing: entry.missing,
    };
    Shape {
        labels: vec!["Sequence".into(), "Variant".into()],
        columns: columns.iter().map(|c| column(c, None)).collect(),
        rows: entries.into_iter().map(row).collect(),
    }
}

/// The mean is one more group of columns; the frames of a row are those of its sequences.
fn wide(columns: &[Column], entries: Vec<Entry>) -> Shape {
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
            labels: vec![variant.clone()],
            cells: cells.collect(),
            frames: sequences().map(|entry| entry.frames).sum(),
            missing: sequences().map(|entry| entry.missing).sum(),
        }
    };
    Shape {
        labels: vec!["Method".into()],
        columns: groups.iter().flat_map(|group| columns.iter().map(|c| column(c, Some(group)))).collect(),
        rows: lines.into_iter().map(row).collect(),
    }
}
