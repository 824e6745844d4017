//! A result as Markdown, CSV and JSON.

use super::{Pick, Recommendation, Trade};
use skinsplat_table::{Cell, Column, Label, Row, Table, csv_by_cell, markdown as write, to_json};
use std::fmt::Write;

/// The page: sections with their tables, then the recommendations. `pictures` are shown under the section of their id:
/// (section id, file name, caption).
pub fn markdown(trade: &Trade, pictures: &[(String, String, String)]) -> String {
    let mut text = "# Speed against accuracy\n\n".to_owned();
    for line in &trade.ran_on {
        let _ = writeln!(text, "- {}.", write::prose(line));
    }
    text += "\nFront: no other row of the same motion is at least as good in time, in 95 % and in all of the errors (or in PSNR), and better in one. Errors below \
             1e-5° and images beyond 120 dB count as equal. Nothing but times, fronts and recommendations depends on the \
             machine.\n";
    for section in &trade.sections {
        let _ = write!(text, "\n## {}\n\n{}\n", write::escape(&section.title), write::sentences(section));
        for (_, file, caption) in pictures.iter().filter(|(id, ..)| *id == section.id) {
            let _ = write!(text, "![{}]({file})\n\n", write::escape(caption));
        }
        text += &write::grid(section);
    }
    if !trade.recommendations.is_empty() {
        text += "\n## Recommendations\n\nEach is the row that its rule picks; the rows are cited.\n";
    }
    for recommendation in &trade.recommendations {
        let table = picks(recommendation);
        let _ = write!(text, "\n### {}\n\n{}", write::escape(&table.title), write::grid(&table));
    }
    text
}

/// A row per choice.
pub(super) fn picks(recommendation: &Recommendation) -> Table {
    let row = |pick: &Pick| {
        let choice = match pick.satisfied {
            true => pick.choice.clone(),
            false => format!("nothing meets the rule; nearest: {}", pick.choice),
        };
        let cells = [choice, pick.rule.clone(), pick.evidence.clone(), pick.rows.join(", ")];
        Row::new(&pick.sweep, [&pick.sweep], cells.map(Cell::text).into())
    };
    Table {
        labels: vec![Label::new("sweep", "Of")],
        columns: [("choice", "Choice"), ("rule", "Rule"), ("evidence", "Evidence"), ("rows", "Rows")]
            .map(|(key, title)| Column::text(key, title))
            .into(),
        rows: recommendation.picks.iter().map(row).collect(),
        ..Table::new(&recommendation.purpose, &recommendation.purpose)
    }
}

/// Every cell as a line: section, row, column, whether it depends on a clock, value with full precision.
pub fn csv(trade: &Trade) -> String {
    csv_by_cell(&trade.sections)
}

/// The result as JSON, indented, with a final newline.
pub fn json(trade: &Trade) -> String {
    to_json(trade)
}
