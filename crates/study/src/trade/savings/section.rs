//! The savings as a section of the report.

use super::{Same, Saving};
use crate::trade::section::cell;
use skinsplat_table::{Cell, Column, Label, Row, Table};

/// Id of the section.
pub const ID: &str = "savings";

/// A row per saving, in milliseconds.
pub fn section(savings: &[Saving]) -> Table {
    let mut table = Table::new(ID, "Only what a scene requires");
    table.sentences = vec![
        "What is left out where it is not needed, on a built-in subject: the cost of doing it all, the cost of doing what is \
         needed (medians of repeated runs in turns, one thread, with the distance between quartiles), and what becomes of \
         the result"
            .to_owned(),
    ];
    table.labels = vec![Label::new("what", "Left out"), Label::new("unit", "Time of")];
    table.columns = vec![
        Column::new("without", "All, ms").timing(),
        Column::new("without-spread", "± quartiles").timing(),
        Column::new("with", "Needed, ms").timing(),
        Column::new("with-spread", "± quartiles").timing(),
        Column::new("factor", "Times faster").timing(),
        Column::text("result", "Result"),
        Column::text("holds", "As claimed"),
    ];
    table.rows = savings.iter().enumerate().map(row).collect();
    table
}

fn row((i, saving): (usize, &Saving)) -> Row {
    let milliseconds = |seconds: f64| cell(1e3 * seconds);
    let cells = vec![
        milliseconds(saving.without.median),
        milliseconds(saving.without.high - saving.without.low),
        milliseconds(saving.with.median),
        milliseconds(saving.with.high - saving.with.low),
        cell(saving.factor()),
        Cell::text(saving.result.to_string()),
        Cell::text(if matches!(saving.result, Same::Different { .. }) { "no" } else { "yes" }),
    ];
    Row::new(format!("{ID}/{}", i + 1), [saving.what.as_str(), saving.unit], cells)
}
