//! A table as plain text for terminals: columns that line up, two spaces apart. A first label that is printed once stands on
//! a line of its own, above its rows.

use super::escape::{minus, visible};
use super::{Align, Cell, Content, Table};

/// The table with everything that it says. The best values have an asterisk, footnotes a number in brackets.
pub fn text(table: &Table) -> String {
    let mut parts = vec![format!("{}\n", visible(&table.title))];
    parts.extend(table.sentences.iter().map(|sentence| format!("{}.\n", visible(sentence))));
    if !table.rows.is_empty() {
        parts.push(format!("\n{}", laid_out(table, true)));
    }
    parts.push(notes(table));
    parts.concat()
}

/// The rows alone, without headings: for lists whose columns explain themselves.
pub fn rows(table: &Table) -> String {
    laid_out(table, false)
}

/// What is below the grid, each part after an empty line: footnotes, explanations of columns, remarks.
pub fn notes(table: &Table) -> String {
    let notes = (1..).zip(&table.notes).map(|(number, note)| format!("[{number}] {}\n", visible(note)));
    let legend = table.legend().map(|(title, about)| format!("{}: {}\n", visible(title), visible(about)));
    let remarks = table.remarks.iter().map(|remark| format!("{}\n", visible(remark)));
    let parts: [String; 3] = [notes.collect(), legend.collect(), remarks.collect()];
    parts.into_iter().filter(|part| !part.is_empty()).map(|part| format!("\n{part}")).collect()
}

/// A field: what lines up on its column's side, and what hangs after it.
type Field = (String, String);

fn laid_out(table: &Table, headings: bool) -> String {
    let grouped = usize::from(table.labels.len() > 1 && table.labels[0].once);
    let plain = |text: &str| (visible(text).into_owned(), String::new());
    let mut lines: Vec<Vec<Field>> = Vec::new();
    if headings {
        let columns = table.columns.iter().map(|column| match &column.group {
            Some(group) => plain(&format!("{group} {}", column.heading())),
            None => plain(&column.heading()),
        });
        lines.push(table.labels[grouped..].iter().map(|label| plain(&label.title)).chain(columns).collect());
    }
    for row in &table.rows {
        let labels = row.labels[grouped..].iter().map(|label| plain(label));
        lines.push(labels.chain(row.cells.iter().map(field)).collect());
    }
    let labels = table.labels[grouped..].iter().map(|_| Align::Left);
    let aligns: Vec<Align> = labels.chain(table.columns.iter().map(|column| column.align)).collect();
    let mut lines = aligned(&lines, &aligns).into_iter();
    let mut text = String::new();
    let indent = if grouped > 0 { "  " } else { "" };
    text.extend(lines.by_ref().take(usize::from(headings)).map(|line| format!("{indent}{line}\n")));
    for ((line, row), repeats) in lines.zip(&table.rows).zip(table.repeats()) {
        if grouped > 0 && !repeats {
            text += &format!("{}\n", visible(&row.labels[0]));
        }
        text += &format!("{indent}{line}\n");
    }
    text
}

fn field(cell: &Cell) -> Field {
    let text = match cell.content {
        Content::Text | Content::Flag(_) => visible(&cell.text).into_owned(),
        _ => minus(&visible(&cell.text)),
    };
    let mark = if cell.best { "*" } else { "" };
    let notes = cell.footnotes().map_or_else(String::new, |numbers| format!("[{numbers}]"));
    (text, format!("{mark}{notes}"))
}

/// Lines whose fields start or end at the same place.
fn aligned(lines: &[Vec<Field>], aligns: &[Align]) -> Vec<String> {
    let width = |c: usize, part: fn(&Field) -> &String| {
        lines.iter().map(|line| part(&line[c]).chars().count()).max().unwrap_or_default()
    };
    let widths: Vec<[usize; 2]> =
        (0..aligns.len()).map(|c| [width(c, |field| &field.0), width(c, |field| &field.1)]).collect();
    let line = |line: &Vec<Field>| {
        let field = |((text, mark), (align, [own, marks])): (&Field, (&Align, &[usize; 2]))| match align {
            Align::Left => format!("{text}{mark:marks$}{:1$}", "", own - text.chars().count()),
            Align::Right => format!("{text:>own$}{mark:marks$}"),
        };
        let fields: Vec<String> = line.iter().zip(aligns.iter().zip(&widths)).map(field).collect();
        fields.join("  ").trim_end().to_owned()
    };
    lines.iter().map(line).collect()
}
