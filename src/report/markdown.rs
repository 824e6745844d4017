//! A table as GitHub-flavoured Markdown.

use super::table::{Cell, Comparison, MetricDifference, RowKind, Table};

/// The table under a heading, with its footnotes, comparisons and, folded away, the paper's own numbers.
pub fn markdown(table: &Table) -> String {
    let mut text = format!("## {}\n\n{}", escape(&table.title), body(table));
    if let Some(paper) = &table.paper {
        let summary = "the paper's values on its data and avatars (not comparable with a stand-in's)";
        let heading = format!("{}: {summary}", paper.title.replace('<', "&lt;"));
        text += &format!("\n<details>\n<summary>{heading}</summary>\n\n{}\n</details>\n", body(paper));
    }
    text
}

/// Caption, grid, notes and comparisons.
fn body(table: &Table) -> String {
    let mut text = format!("{}.\n", escape(&table.caption));
    for sentence in &table.ran_on {
        text += &format!("{}.\n", escape(sentence));
    }
    if !table.rows.is_empty() {
        text.push('\n');
        text += &grid(table);
    }
    for (number, note) in (1..).zip(&table.notes) {
        text += &format!("\n<sup>{number}</sup> {}\n", escape(note));
    }
    for remark in &table.remarks {
        text += &format!("\n{}\n", escape(remark));
    }
    text + &comparisons(&table.comparisons)
}

fn grid(table: &Table) -> String {
    let heading = |c: &super::TableColumn| match &c.group {
        Some(group) => format!("{} {}", escape(group), escape(&c.heading())),
        None => escape(&c.heading()),
    };
    let labels = table.labels.iter().map(|label| escape(label));
    let headings: Vec<String> = labels.chain(table.columns.iter().map(heading)).collect();
    let rules = table.labels.iter().map(|_| ":--").chain(table.columns.iter().map(|_| "--:"));
    let mut text = line(&headings) + &line(&rules.map(str::to_owned).collect::<Vec<_>>());
    let mut above: Option<(&str, RowKind)> = None;
    for row in &table.rows {
        let mut labels: Vec<String> = row.labels.iter().map(|label| escape(label)).collect();
        if let [first, _, ..] = row.labels.as_slice() {
            // A sequence is named once, above its variants.
            let group =
                (first.as_str(), if row.kind == RowKind::Mean { row.kind } else { RowKind::Measured });
            if above == Some(group) {
                labels[0].clear();
            }
            above = Some(group);
        }
        let cells = row.cells.iter().map(cell);
        text += &line(&labels.into_iter().chain(cells).collect::<Vec<_>>());
    }
    text
}

fn cell(cell: &Cell) -> String {
    let number = cell.text.replace('-', "−");
    let text = if cell.best { format!("**{number}**") } else { number };
    match cell.footnotes() {
        None => text,
        Some(numbers) => format!("{text} <sup>{numbers}</sup>"),
    }
}

fn line(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// What the paired differences are, and a line for each.
fn comparisons(comparisons: &[Comparison]) -> String {
    let Some(first) = comparisons.first() else { return String::new() };
    let mut text = String::from(
        "\nFrame by frame: mean difference, its 95 % interval (paired block bootstrap, seeded), and the share of frames \
         won.\n\n",
    );
    let mut headings = vec!["Sequence".to_owned(), "Difference".to_owned(), "Frames".to_owned()];
    headings.extend(first.differences.iter().map(|d| format!("Δ {}", d.metric.title())));
    text += &line(&headings);
    let rules = headings.iter().enumerate().map(|(i, _)| if i < 2 { ":--" } else { "--:" });
    text += &line(&rules.map(str::to_owned).collect::<Vec<_>>());
    for comparison in comparisons {
        let frames = comparison.differences.iter().filter_map(|d| d.paired).map(|p| p.frames).max();
        let mut cells = vec![
            comparison.sequence.as_deref().map_or_else(|| "All".to_owned(), escape),
            escape(&format!("{} − {}", comparison.variant, comparison.baseline)),
            frames.unwrap_or(0).to_string(),
        ];
        cells.extend(comparison.differences.iter().map(difference));
        text += &line(&cells);
    }
    text
}

/// `+0.12 ± 0.03 over seeds [+0.05, +0.20], won 83 %`.
fn difference(difference: &MetricDifference) -> String {
    let Some(paired) = difference.paired else { return "—".to_owned() };
    // One digit more than the table: differences are smaller than what they are differences of.
    let signed = |value: f64| Cell::difference(value, difference.decimals + 1).text.replace('-', "−");
    let interval = match paired.interval {
        Some([low, high]) => format!(" [{}, {}]", signed(low), signed(high)),
        None => String::new(),
    };
    let spread = match difference.over_seeds {
        Some(sd) => format!(" ± {sd:.0$} over seeds", difference.decimals + 1),
        None => String::new(),
    };
    format!("{}{spread}{interval}, won {:.0} %", signed(paired.mean), 100.0 * paired.win_rate)
}

/// Text that Markdown shows as it is, on one line.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '|' | '*' | '`' | '\\' => escaped.extend(['\\', c]),
            '<' => escaped += "&lt;",
            '\n' | '\r' => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::super::table::Content;
    use super::*;

    #[test]
    fn markup_in_names_is_shown_not_obeyed() {
        assert_eq!(escape("a|b*c`<d>\n"), "a\\|b\\*c\\`&lt;d> ");
    }

    #[test]
    fn footnotes_and_bold_go_together() {
        let cell = Cell { best: true, notes: vec![0, 2], ..Cell::new(Content::Number(1.0), 1) };
        assert_eq!(super::cell(&cell), "**1.0** <sup>1,3</sup>");
    }
}
