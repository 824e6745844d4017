//! A table as LaTeX, for papers: needs `\usepackage{booktabs}`.

use super::table::{Cell, Table, TableColumn};

/// A `table` environment with caption, label `tab:ID`, and footnotes under the grid.
pub fn latex(table: &Table) -> String {
    let spec = "l".repeat(table.labels.len()) + &"r".repeat(table.columns.len());
    let mut text = String::from("\\begin{table}\n\\centering\n");
    let sentences: Vec<String> =
        [&table.caption].into_iter().chain(&table.ran_on).map(|s| escape(s) + ".").collect();
    text += &format!("\\caption{{{}}}\n\\label{{tab:{}}}\n", sentences.join(" "), table.id);
    text += &format!("\\begin{{tabular}}{{{spec}}}\n\\toprule\n");
    text += &group_headings(table);
    let labels = table.labels.iter().map(|label| escape(label));
    let headings: Vec<String> = labels.chain(table.columns.iter().map(|c| escape(&c.heading()))).collect();
    text += &line(&headings);
    let mut above: Option<&str> = None;
    for row in &table.rows {
        let mut labels: Vec<String> = row.labels.iter().map(|label| escape(label)).collect();
        let repeated = row.labels.len() > 1 && above == Some(row.labels[0].as_str());
        if repeated {
            labels[0].clear();
        } else if row.labels.len() > 1 || above.is_none() {
            text += "\\midrule\n";
        }
        above = Some(&row.labels[0]);
        text += &line(&labels.into_iter().chain(row.cells.iter().map(cell)).collect::<Vec<_>>());
    }
    text += "\\bottomrule\n\\end{tabular}\n";
    for (number, note) in (1..).zip(&table.notes) {
        text += &format!("\\\\ {{\\footnotesize $^{{{number}}}$ {}}}\n", escape(note));
    }
    text + "\\end{table}\n"
}

/// The line over grouped columns.
fn group_headings(table: &Table) -> String {
    let mut groups: Vec<(&str, usize)> = Vec::new();
    for TableColumn { group, .. } in &table.columns {
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
    let text = escape(&cell.text.replace('-', "−"));
    let text = if cell.best { format!("\\textbf{{{text}}}") } else { text };
    match cell.footnotes() {
        None => text,
        Some(numbers) => format!("{text}$^{{{numbers}}}$"),
    }
}

fn line(cells: &[String]) -> String {
    format!("{} \\\\\n", cells.join(" & "))
}

/// Text that LaTeX shows as it is.
fn escape(text: &str) -> String {
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
            '\n' | '\r' => escaped.push(' '),
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
    }
}
