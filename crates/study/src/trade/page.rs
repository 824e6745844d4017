//! A result as Markdown, CSV and JSON.

use super::{Cell, Row, Section, Trade};
use std::fmt::Write;

/// The page: sections with their tables, then the recommendations. `pictures` are shown under the section of their id:
/// (section id, file name, caption).
pub fn markdown(trade: &Trade, pictures: &[(String, String, String)]) -> String {
    let mut text = "# Speed against accuracy\n\n".to_owned();
    for line in &trade.ran_on {
        let _ = writeln!(text, "- {}.", escape(line));
    }
    text += "\nFront: no other row of the same motion is at least as good in time, in 95 % and in all of the errors (or in PSNR), and better in one. Errors below \
             1e-5° and images beyond 120 dB count as equal. Nothing but times, fronts and recommendations depends on the \
             machine.\n";
    for section in &trade.sections {
        let _ = write!(text, "\n## {}\n\n{}\n\n", escape(&section.title), escape(&section.about));
        for (_, file, caption) in pictures.iter().filter(|(id, ..)| *id == section.id) {
            let _ = write!(text, "![{}]({file})\n\n", escape(caption));
        }
        text += &table(section);
    }
    if !trade.recommendations.is_empty() {
        text += "\n## Recommendations\n\nEach is the row that its rule picks; the rows are cited.\n";
    }
    for recommendation in &trade.recommendations {
        let _ = write!(
            text,
            "\n### {}\n\n| Of | Choice | Rule | Evidence | Rows |\n|:--|:--|:--|:--|:--|\n",
            escape(&recommendation.purpose)
        );
        for pick in &recommendation.picks {
            let choice = if pick.satisfied {
                escape(&pick.choice)
            } else {
                format!("nothing meets the rule; nearest: {}", escape(&pick.choice))
            };
            let rows: Vec<String> = pick.rows.iter().map(|row| format!("`{row}`")).collect();
            let (sweep, rule, evidence) = (&pick.sweep, escape(&pick.rule), escape(&pick.evidence));
            let _ = writeln!(text, "| {sweep} | {choice} | {rule} | {evidence} | {} |", rows.join(", "));
        }
    }
    text
}

fn table(section: &Section) -> String {
    let is_number =
        |column: usize| section.rows.iter().any(|row| matches!(row.cells.get(column), Some(Cell::Number(_))));
    let mut text = String::new();
    for column in &section.columns {
        let _ = write!(text, "| {} ", escape(&column.title));
    }
    text += "|\n";
    for column in 0..section.columns.len() {
        text += if is_number(column) { "|--:" } else { "|:--" };
    }
    text += "|\n";
    for Row { cells, .. } in &section.rows {
        for cell in cells {
            let shown = match cell {
                Cell::Number(_) => cell.shown().replace('-', "−"),
                Cell::Word(word) => escape(word),
            };
            let _ = write!(text, "| {shown} ");
        }
        text += "|\n";
    }
    text
}

/// Text that Markdown shows as it is, on one line.
fn escape(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;").replace(['\n', '\r'], " ")
}

/// Every cell as a line: section, row, column, whether it depends on a clock, value with full precision.
pub fn csv(trade: &Trade) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let mut write = |record: [&str; 5]| {
        writer.write_record(record).expect("memory takes every write, and records are equally long");
    };
    write(["section", "row", "column", "timing", "value"]);
    for section in &trade.sections {
        for row in &section.rows {
            for (column, cell) in section.columns.iter().zip(&row.cells) {
                let value = match cell {
                    Cell::Number(value) => value.to_string(),
                    Cell::Word(word) => word.clone(),
                };
                let timing = if column.timing { "yes" } else { "no" };
                write([&section.id, &row.id, &column.id, timing, &value]);
            }
        }
    }
    let bytes = writer.into_inner().expect("memory takes every write");
    String::from_utf8(bytes).expect("every field is text")
}

/// The result as JSON, indented, with a final newline.
pub fn json(trade: &Trade) -> String {
    serde_json::to_string_pretty(trade).expect("keys are strings and every number is finite") + "\n"
}
