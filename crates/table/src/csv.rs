//! A table as CSV, for programs.

use super::escape::visible;
use super::{Cell, Content, Row, RowKind, Table};
use ::csv::Writer;

/// The table with one line per row: the labels, the columns, and what the table has of the following. What a row is
/// (`measured`, `mean`, `paper`, `difference`), its sample and what is missing from it, after the labels; standard deviations
/// (`KEY sd`) and numbers that words are about (`KEY number`) in columns of their own, and footnotes, at the end.
///
/// Measured numbers have full precision, printed ones the paper's digits. Infinity is `inf`, flags are `true` and `false`.
/// A field without a number is empty; the last column says why.
pub fn csv(table: &Table) -> String {
    let (counts, kinds, notes) = fixed(table);
    let extras = extras(table);
    let mut header: Vec<String> = table.labels.iter().map(|label| text(&label.key)).collect();
    header.extend(kinds.then(|| "kind".to_owned()));
    header.extend(counts.iter().flat_map(|unit| [text(unit), "missing".to_owned()]));
    header.extend(table.columns.iter().map(|column| text(&column.name())));
    header.extend(extras.iter().map(|&(column, extra)| text(&extra.name(&table.columns[column].name()))));
    header.extend(notes.then(|| "notes".to_owned()));
    let record = |row: &Row| {
        let mut record: Vec<String> = row.labels.iter().map(|label| text(label)).collect();
        record.extend(kinds.then(|| row.kind.id().to_owned()));
        record.extend(counts.iter().flat_map(|_| [row.sample.to_string(), row.missing.to_string()]));
        record.extend(row.cells.iter().map(|cell| field(cell, row.kind)));
        record.extend(extras.iter().map(|&(c, extra)| number(extra.of(&row.cells[c]))));
        record.extend(notes.then(|| text(&footnotes(table, row))));
        record
    };
    written([header].into_iter().chain(table.rows.iter().map(record)))
}

/// Several tables of any shapes, one line per label and cell: table, row, column, whether it depends on a clock, value.
pub fn csv_by_cell<'a>(tables: impl IntoIterator<Item = &'a Table>) -> String {
    let header = ["section", "row", "column", "timing", "value"].map(str::to_owned).to_vec();
    let of_table = |table: &'a Table| table.rows.iter().flat_map(move |row| lines(table, row));
    written([header].into_iter().chain(tables.into_iter().flat_map(of_table)))
}

/// The lines of one row.
fn lines(table: &Table, row: &Row) -> Vec<Vec<String>> {
    let line = |column: &str, timing: bool, value: String| {
        let timing = if timing { "yes" } else { "no" }.to_owned();
        vec![text(&table.id), text(&row.id), text(column), timing, value]
    };
    let mut lines: Vec<Vec<String>> = Vec::new();
    for (label, value) in table.labels.iter().zip(&row.labels) {
        lines.push(line(&label.key, false, text(value)));
    }
    for (column, cell) in table.columns.iter().zip(&row.cells) {
        let name = column.name();
        lines.push(line(&name, column.timing, field(cell, row.kind)));
        for extra in Extra::ALL {
            let value = extra.of(cell).map(|_| number(extra.of(cell)));
            lines.extend(value.map(|value| line(&extra.name(&name), column.timing, value)));
        }
    }
    lines
}

/// A number beside a cell's own field.
#[derive(Clone, Copy)]
enum Extra {
    /// Its standard deviation.
    Spread,
    /// The number that its words are about.
    Number,
}

impl Extra {
    const ALL: [Self; 2] = [Self::Spread, Self::Number];

    fn of(self, cell: &Cell) -> Option<f64> {
        match (self, cell.content) {
            (Self::Spread, _) => cell.spread,
            (Self::Number, Content::Phrase(value)) => Some(value),
            (Self::Number, _) => None,
        }
    }

    fn name(self, column: &str) -> String {
        match self {
            Self::Spread => format!("{column} sd"),
            Self::Number => format!("{column} number"),
        }
    }
}

/// What the table has to be said of rows: the unit of samples, whether kinds differ, whether there are footnotes. A table
/// with samples always has all three, so that its layout does not depend on its numbers.
fn fixed(table: &Table) -> (Option<&str>, bool, bool) {
    let unit = table.sample_unit.as_deref();
    let kinds = unit.is_some() || table.rows.iter().any(|row| row.kind != RowKind::Measured);
    (unit, kinds, unit.is_some() || !table.notes.is_empty())
}

/// Columns that some cell has a number beside its own field for, kind by kind.
fn extras(table: &Table) -> Vec<(usize, Extra)> {
    let has = |&(column, extra): &(usize, Extra)| {
        table.rows.iter().any(|row| extra.of(&row.cells[column]).is_some())
    };
    let columns = |extra| (0..table.columns.len()).map(move |column| (column, extra));
    Extra::ALL.into_iter().flat_map(columns).filter(has).collect()
}

/// The footnotes of a row, once each, in their order.
fn footnotes(table: &Table, row: &Row) -> String {
    let mut notes: Vec<usize> = row.cells.iter().flat_map(|cell| cell.notes.iter().copied()).collect();
    notes.sort_unstable();
    notes.dedup();
    let notes: Vec<&str> = notes.into_iter().map(|note| table.notes[note].as_str()).collect();
    notes.join("; ")
}

fn field(cell: &Cell, kind: RowKind) -> String {
    match cell.content {
        Content::Number(_) if kind == RowKind::Paper => cell.text.clone(),
        Content::Number(value) => value.to_string(),
        Content::Infinite => "inf".to_owned(),
        Content::Flag(flag) => flag.to_string(),
        Content::Text | Content::Phrase(_) => text(&cell.text),
        Content::NotComputed | Content::NotApplicable | Content::Missing => String::new(),
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// A field that is text: on one line, and nothing that a spreadsheet runs as a formula.
pub fn text(text: &str) -> String {
    let text = visible(text);
    let signed = text.starts_with(['+', '-']) && text.contains(char::is_alphabetic);
    let formula = text.starts_with(['=', '@']) || (signed && text.parse::<f64>().is_err());
    if formula { format!("'{text}") } else { text.into_owned() }
}

/// Records as text.
fn written(records: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = Writer::from_writer(Vec::new());
    for record in records {
        writer.write_record(&record).expect("memory takes every write, and records are equally long");
    }
    let bytes = writer.into_inner().expect("memory takes every write");
    String::from_utf8(bytes).expect("every field is text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_no_formula() {
        for (given, shown) in [
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("-cmd|x", "'-cmd|x"),
            ("+A1", "'+A1"),
            ("\t=x", " =x"),
            ("-1.5e-3", "-1.5e-3"),
            ("-", "-"),
            ("a=b", "a=b"),
        ] {
            assert_eq!(text(given), shown);
        }
    }
}
