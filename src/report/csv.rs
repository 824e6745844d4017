//! A table as CSV, for programs.

use super::table::{Cell, Content, RowKind, Table};

/// The table with one line per row: the text columns, what the row is (`measured`, `mean`, `paper`, `difference`), its
/// frames, the metrics, their standard deviations over seeds where there are any, and its footnotes.
///
/// Measured numbers have full precision, printed ones the paper's digits. Infinity is `inf`. A field without a number is
/// empty; the last column says why.
pub fn csv(table: &Table) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let labels = table.labels.iter().map(|label| label.to_lowercase());
    let fixed = ["kind", "frames", "missing"].map(str::to_owned);
    let spreads: Vec<usize> = (0..table.columns.len())
        .filter(|&column| table.rows.iter().any(|row| row.cells[column].spread.is_some()))
        .collect();
    let metrics = table.columns.iter().map(super::TableColumn::name);
    let sd = spreads.iter().map(|&column| format!("{} sd", table.columns[column].name()));
    let header: Vec<String> =
        labels.chain(fixed).chain(metrics).chain(sd).chain(["notes".to_owned()]).collect();
    writer.write_record(&header).expect("memory takes every write");
    for row in &table.rows {
        let fixed = [kind(row.kind).to_owned(), row.frames.to_string(), row.missing.to_string()];
        let cells = row.cells.iter().map(|cell| field(cell, row.kind));
        let sd = |&column: &usize| row.cells[column].spread.map_or_else(String::new, |sd| sd.to_string());
        let mut notes: Vec<usize> = row.cells.iter().flat_map(|cell| cell.notes.iter().copied()).collect();
        notes.sort_unstable();
        notes.dedup();
        let notes: Vec<&str> = notes.into_iter().map(|note| table.notes[note].as_str()).collect();
        let record: Vec<String> = (row.labels.iter().cloned().chain(fixed).chain(cells))
            .chain(spreads.iter().map(sd))
            .chain([notes.join("; ")])
            .collect();
        writer.write_record(&record).expect("memory takes every write, and rows are equally long");
    }
    let bytes = writer.into_inner().expect("memory takes every write");
    String::from_utf8(bytes).expect("every field is text")
}

fn kind(kind: RowKind) -> &'static str {
    match kind {
        RowKind::Measured => "measured",
        RowKind::Mean => "mean",
        RowKind::Paper => "paper",
        RowKind::Difference => "difference",
    }
}

fn field(cell: &Cell, kind: RowKind) -> String {
    match cell.content {
        Content::Number(_) if kind == RowKind::Paper => cell.text.clone(),
        Content::Number(value) => value.to_string(),
        Content::Infinite => "inf".to_owned(),
        Content::NotComputed | Content::NotApplicable | Content::Missing => String::new(),
    }
}
