//! A table as GitHub-flavoured Markdown. Pages that arrange the parts differently take them one by one.

use super::escape::{Span, minus, spans, visible};
use super::{Align, Cell, Column, Content, Table};

/// The table under a heading, with everything that it says.
pub fn markdown(table: &Table) -> String {
    format!("## {}\n\n{}", escape(&table.title), body(table))
}

/// Everything but the heading: sentences, grid, footnotes, explanations of columns, remarks.
pub fn body(table: &Table) -> String {
    let mut text = sentences(table);
    if !table.rows.is_empty() {
        text.push('\n');
        text += &grid(table);
    }
    text + &notes(table)
}

/// The sentences, a line each.
pub fn sentences(table: &Table) -> String {
    table.sentences.iter().map(|sentence| format!("{}.\n", prose(sentence))).collect()
}

/// The table itself: headings and rows.
pub fn grid(table: &Table) -> String {
    let heading = |column: &Column| match &column.group {
        Some(group) => format!("{} {}", escape(group), escape(&column.heading())),
        None => escape(&column.heading()),
    };
    let labels = table.labels.iter().map(|label| escape(&label.title));
    let headings: Vec<String> = labels.chain(table.columns.iter().map(heading)).collect();
    let rules =
        table.labels.iter().map(|_| Align::Left).chain(table.columns.iter().map(|column| column.align));
    let mut text = line(&headings) + &line(&rules.map(rule).collect::<Vec<_>>());
    for (row, repeats) in table.rows.iter().zip(table.repeats()) {
        let mut labels: Vec<String> = row.labels.iter().map(|label| escape(label)).collect();
        if repeats {
            labels[0].clear();
        }
        text += &line(&labels.into_iter().chain(row.cells.iter().map(cell)).collect::<Vec<_>>());
    }
    text
}

/// What is below the grid, each part after an empty line: footnotes, explanations of columns, remarks.
pub fn notes(table: &Table) -> String {
    let mut text = String::new();
    for (number, note) in (1..).zip(&table.notes) {
        text += &format!("\n<sup>{number}</sup> {}\n", escape(note));
    }
    let legend = table.legend().map(|(title, about)| format!("- {}: {}\n", escape(title), prose(about)));
    let legend: String = legend.collect();
    if !legend.is_empty() {
        text.push('\n');
        text += &legend;
    }
    for remark in &table.remarks {
        text += &format!("\n{}\n", prose(remark));
    }
    text
}

fn rule(align: Align) -> String {
    match align {
        Align::Left => ":--",
        Align::Right => "--:",
    }
    .to_owned()
}

fn cell(cell: &Cell) -> String {
    let text = match cell.content {
        Content::Text | Content::Flag(_) => escape(&cell.text),
        _ => escape(&minus(&cell.text)),
    };
    let text = if cell.best { format!("**{text}**") } else { text };
    match cell.footnotes() {
        None => text,
        Some(numbers) => format!("{text} <sup>{numbers}</sup>"),
    }
}

fn line(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// A sentence: what is between a pair of backticks is code, everything else is shown as it is.
pub fn prose(text: &str) -> String {
    let part = |span: &Span<'_>| match span {
        Span::Words(words) => escape(words),
        Span::Code(code) => format!("`{}`", visible(code)),
    };
    spans(text).iter().map(part).collect()
}

/// Text as code, whatever it holds: between more backticks than it has in a row.
pub fn code_span(text: &str) -> String {
    let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or_default();
    let fence = "`".repeat(longest + 1);
    match text.starts_with('`') || text.ends_with('`') {
        true => format!("{fence} {text} {fence}"),
        false => format!("{fence}{text}{fence}"),
    }
}

/// Text that Markdown shows as it is, on one line.
pub fn escape(text: &str) -> String {
    let text = visible(text);
    let mut escaped = String::with_capacity(text.len());
    let mut before = ' ';
    for (c, after) in text.chars().zip(text.chars().skip(1).chain([' '])) {
        match c {
            '|' | '*' | '`' | '\\' => escaped.extend(['\\', c]),
            // Inside a word it is a letter like any other.
            '_' if !(before.is_alphanumeric() && after.is_alphanumeric()) => escaped += "\\_",
            // A link or an image.
            ']' if after == '(' => escaped += "\\]",
            '<' => escaped += "&lt;",
            // An entity.
            '&' if after == '#' || after.is_ascii_alphabetic() => escaped += "\\&",
            c => escaped.push(c),
        }
        before = c;
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_names_is_shown_not_obeyed() {
        assert_eq!(escape("a|b*c`<d>\n"), "a\\|b\\*c\\`&lt;d> ");
        assert_eq!(escape("_a_ image_0001 ![x](y) [0, 1]"), "\\_a\\_ image_0001 ![x\\](y) [0, 1]");
        assert_eq!(escape("a & b&amp;c &#38;"), "a & b\\&amp;c \\&#38;");
        assert_eq!(prose("`power-N|*` of *"), "`power-N|*` of \\*");
    }

    #[test]
    fn code_holds_backticks() {
        for (text, code) in [("a", "`a`"), ("a`b", "``a`b``"), ("``a", "``` ``a ```")] {
            assert_eq!(code_span(text), code);
        }
    }

    #[test]
    fn footnotes_and_bold_go_together() {
        let cell = Cell { best: true, notes: vec![0, 2], ..Cell::number(1.0, crate::Digits::Decimals(1)) };
        assert_eq!(super::cell(&cell), "**1.0** <sup>1,3</sup>");
    }
}
