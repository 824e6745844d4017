//! The paper's numbers: beside ours where they compare, as a table of their own otherwise.

use super::build::{Notes, SAMPLE_UNIT};
use super::layout::{Entry, digits, shape};
use crate::experiment::{Column, Experiment, Paper, PaperRow, Printed, Source};
use skinsplat_table::{Cell, Content, Digits, RowKind, Table};

/// The printed numbers that belong beside an entry, and the differences to them: on the table's own data only, and only
/// for a variant that the paper has.
pub(super) fn beside(
    experiment: &Experiment,
    source: Source,
    variant: &str,
    ours: &Entry,
    notes: &mut Notes,
) -> Vec<Entry> {
    let row = || {
        let paper = experiment.paper.as_ref().filter(|_| source == Source::Own)?;
        let id = experiment.variant(variant)?.paper.as_deref()?;
        match ours.kind {
            RowKind::Mean => paper.average(id),
            _ => paper.row(&ours.sequence, id),
        }
    };
    let Some(row) = row() else { return Vec::new() };
    let of_paper = experiment.paper.as_ref().is_some_and(|paper| paper.fitted(&row.variant));
    let fitted = of_paper && experiment.fitted_test_poses().is_some();
    let stands = |column: &Column| column.fitted == fitted;
    let printed = entry(&experiment.columns, row, [&ours.sequence, &ours.variant], &stands, notes);
    let differences =
        ours.cells.iter().zip(&printed.cells).zip(&experiment.columns).map(|((a, b), column)| {
            match (a.content, b.content) {
                (Content::Number(a), Content::Number(b)) => Cell::difference(a - b, digits(column)),
                _ => Cell::empty(),
            }
        });
    let differences = Entry {
        id: format!("{}/difference", ours.id),
        sequence: ours.sequence.clone(),
        variant: format!("{} − paper", ours.variant),
        kind: RowKind::Difference,
        cells: differences.collect(),
        frames: ours.frames,
        missing: ours.missing,
    };
    let id = format!("{}/paper", ours.id);
    vec![Entry { id, variant: format!("{}, paper", ours.variant), ..printed }, differences]
}

/// The table as the paper prints it.
pub(super) fn printed_table(experiment: &Experiment, paper: &Paper) -> Table {
    let mut notes = Notes::default();
    let average = |row: &PaperRow| match (&experiment.average, row.average) {
        (Some(average), true) => average.label.clone(),
        _ => row.sequence.clone(),
    };
    // It prints one score of a frame; which poses that is of the caption says.
    let plain = |column: &Column| Column { title: None, ..column.clone() };
    let columns: Vec<Column> = match experiment.fitted_test_poses() {
        None => experiment.columns.clone(),
        Some(_) => experiment.columns.iter().filter(|column| !column.fitted).map(plain).collect(),
    };
    let entries = paper.rows.iter().map(|row| {
        let label = paper.label(&row.variant).unwrap_or(&row.variant);
        entry(&columns, row, [&average(row), label], &|_| true, &mut notes)
    });
    let shape = shape(experiment.layout, &columns, entries.collect());
    Table {
        sentences: vec![paper.caption.clone(), "The paper's values, on its data and avatars".to_owned()],
        sample_unit: Some(SAMPLE_UNIT.to_owned()),
        labels: shape.labels,
        columns: shape.columns,
        rows: shape.rows,
        notes: notes.into_vec(),
        remarks: paper.note.iter().cloned().collect(),
        ..Table::new(
            format!("{}-paper", experiment.id),
            format!("{} of {}, as printed", experiment.title, paper.source),
        )
    }
}

/// A printed row, its digits and its bold, in the columns where it `stands`: a paper prints one score, of poses as given or fitted.
fn entry(
    columns: &[Column],
    row: &PaperRow,
    [sequence, variant]: [&str; 2],
    stands: &dyn Fn(&Column) -> bool,
    notes: &mut Notes,
) -> Entry {
    let doubt = row.doubt.as_ref().map(|doubt| notes.index(format!("{sequence}, {variant}: {doubt}")));
    let cell = |printed: &Printed, best: bool, doubtful: bool| Cell {
        text: printed.to_string(),
        best,
        notes: doubt.filter(|_| doubtful).into_iter().collect(),
        ..Cell::number(printed.value(), Digits::Decimals(printed.decimals()))
    };
    let cells = columns.iter().map(|column| {
        let doubtful = row.doubt.as_ref().is_some_and(|doubt| doubt.starts_with(column.metric.id()));
        let printed = row.value(column.metric).filter(|_| stands(column));
        printed.map_or_else(Cell::empty, |p| cell(p, row.bold.contains(&column.metric), doubtful))
    });
    Entry {
        id: format!("{sequence}/{variant}"),
        sequence: sequence.to_owned(),
        variant: variant.to_owned(),
        kind: RowKind::Paper,
        cells: cells.collect(),
        frames: 0,
        missing: 0,
    }
}
