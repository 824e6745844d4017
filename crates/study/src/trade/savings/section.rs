//! The savings as a section of the report.

use super::{Same, Saving};
use crate::trade::{Cell, Column, Row, Section};

/// Id of the section.
pub const ID: &str = "savings";

/// A row per saving, in milliseconds.
pub fn section(savings: &[Saving]) -> Section {
    let column =
        |id: &str, title: &str, timing| Column { id: id.to_owned(), title: title.to_owned(), timing };
    let row = |(i, saving): (usize, &Saving)| {
        let milliseconds = |seconds: f64| Cell::number(1e3 * seconds);
        Row {
            id: format!("{ID}/{}", i + 1),
            cells: vec![
                Cell::text(&saving.what),
                Cell::text(saving.unit),
                milliseconds(saving.without.median),
                milliseconds(saving.without.high - saving.without.low),
                milliseconds(saving.with.median),
                milliseconds(saving.with.high - saving.with.low),
                Cell::number(saving.factor()),
                Cell::text(&saving.result.to_string()),
                Cell::text(if matches!(saving.result, Same::Different { .. }) { "no" } else { "yes" }),
            ],
        }
    };
    Section {
        id: ID.to_owned(),
        title: "Only what a scene requires".to_owned(),
        about: "What is left out where it is not needed, on a built-in subject: the cost of doing it all, the cost of doing \
                what is needed (medians of repeated runs in turns, one thread, with the distance between quartiles), and what \
                becomes of the result."
            .to_owned(),
        columns: vec![
            column("what", "Left out", false),
            column("unit", "Time of", false),
            column("without", "All, ms", true),
            column("without-spread", "± quartiles", true),
            column("with", "Needed, ms", true),
            column("with-spread", "± quartiles", true),
            column("factor", "Times faster", true),
            column("result", "Result", false),
            column("holds", "As claimed", false),
        ],
        rows: savings.iter().enumerate().map(row).collect(),
    }
}
