//! A table as LaTeX, for papers: needs `\usepackage{booktabs}`.

use super::escape::{Span, minus, spans, visible};
use super::{Align, Cell, Column, Content, Table};

/// A `table` environment with the sentences as its caption, label `tab:ID`, and footnotes under the grid.
pub fn latex(table: &Table) -> String {
    let aligns =
        table.labels.iter().map(|_| Align::Left).chain(table.columns.iter().map(|column| column.align));
    let spec: String = aligns.map(|align| if align == Align::Left { 'l' } else { 'r' }).collect();
    let sentences: Vec<String> = table.sentences.iter().map(|sentence| prose(sentence) + ".").collect();
    let mut text = String::from("\\begin{table}\n\\centering\n");
    text += &format!("\\caption{{{}}}\n\\label{{tab:{}}}\n", sentences.join(" "), visible(&table.id));
    text += &format!("\\begin{{tabular}}{{{spec}}}\n\\toprule\n");
    text += &group_headings(table);
    let labels = table.labels.iter().map(|label| escape(&label.title));
    let headings: Vec<String> = labels.chain(table.columns.iter().map(|c| escape(&c.heading()))).collect();
    text += &line(&headings);
    text += &rows(table);
    text += "\\bottomrule\n\\end{tabular}\n";
    for (number, note) in (1..).zip(&table.notes) {
        text += &format!("\\\\ {{\\footnotesize $^{{{number}}}$ {}}}\n", escape(note));
    }
    text + "\\end{table}\n"
}

/// The rows, with a rule above each group that shares its first label.
fn rows(table: &Table) -> String {
    let grouped = table.labels.len() > 1 && table.labels[0].once;
    let mut text = String::new();
    for (r, (row, repeats)) in table.rows.iter().zip(table.repeats()).enumerate() {
        let mut labels: Vec<String> = row.labels.iter().map(|label| escape(label)).collect();
        if repeats {
            labels[0].clear();
        } else if grouped || r == 0 {
            text += "\\midrule\n";
        }
        text += &line(&labels.into_iter().chain(row.cells.iter().map(cell)).collect::<Vec<_>>());
    }
    text
}

/// The line over grouped columns; none if a column has no group.
fn group_headings(table: &Table) -> String {
    let mut groups: Vec<(&str, usize)> = Vec::new();
    for Column { group, .. } in &table.columns {
        let Some(group) = group else { return String::new() };
        match groups.last_mut() {
            Some((last, span)) if last == group => *span += 1,
            _ => groups.push((group, 1)),
        }
    }
    let blank = table.labels.iter().map(|_| String::new());
    let spans = groups.iter().map(|(group, n)| format!("\\multicolumn{{{n}}}{{c}}{{{}}}", escape(group)));
    let mut text = line(&blank.chain(spans).collect::<Vec<_>>());
    let mut first = table.labels.len() + 1;
    for (_, span) in groups {
        text += &format!("\\cmidrule(lr){{{first}-{}}}\n", first + span - 1);
        first += span;
    }
    text
}

fn cell(cell: &Cell) -> String {
    let text = match cell.content {
        Content::Text | Content::Flag(_) => escape(&cell.text),
        _ => escape(&minus(&cell.text)),
    };
    let text = if cell.best { format!("\\textbf{{{text}}}") } else { text };
    match cell.footnotes() {
        None => text,
        Some(numbers) => format!("{text}$^{{{numbers}}}$"),
    }
}

fn line(cells: &[String]) -> String {
    format!("{} \\\\\n", cells.join(" & "))
}

/// A sentence: what is between a pair of backticks is code.
fn prose(text: &str) -> String {
    let part = |span: &Span<'_>| match span {
        Span::Words(words) => escape(words),
        Span::Code(code) => format!("\\texttt{{{}}}", escape(code)),
    };
    spans(text).iter().map(part).collect()
}

/// Text that LaTeX shows as it is.
fn escape(text: &str) -> String {
    let text = visible(text);
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', c]),
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '<' => escaped += "$<$",
            '>' => escaped += "$>$",
            '↑' => escaped += "$\\uparrow$",
            '↓' => escaped += "$\\downarrow$",
            '∞' => escaped += "$\\infty$",
            '−' => escaped += "$-$",
            '—' => escaped += "---",
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_document() {
        assert_eq!(escape("a_b & 50 % \\x{}"), "a\\_b \\& 50 \\% \\textbackslash{}x\\{\\}");
        assert_eq!(prose("`a_b` & c"), "\\texttt{a\\_b} \\& c");
    }
}
