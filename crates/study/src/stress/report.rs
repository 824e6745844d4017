//! Findings as Markdown, CSV and JSON.

use super::table::{Findings, LIMITS, Limits, Row, Verdict, column, label, line, words};
use serde::Serialize;
use skinsplat_core::scene::Image;
use skinsplat_table::{Cell, Table, csv, markdown as write, to_json};
use std::fmt::Write;

/// A rendered failure.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    /// Name of the file, without a folder.
    pub file: String,
    /// What it shows.
    pub caption: String,
    /// The pixels.
    #[serde(skip)]
    pub image: Image,
}

/// Everything that was found.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the layout.
    pub schema: &'static str,
    /// The limits between verdicts.
    pub limits: Limits,
    /// Fewer inputs were taken.
    pub quick: bool,
    /// Section by section.
    pub sections: Vec<Findings>,
    /// Rendered failures.
    pub pictures: Vec<Picture>,
}

impl Report {
    /// A report of sections.
    pub fn new(quick: bool, sections: Vec<Findings>, pictures: Vec<Picture>) -> Self {
        Self { schema: "stress-2", limits: LIMITS, quick, sections, pictures }
    }

    /// How many rows have a verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.sections.iter().flat_map(|s| &s.rows).filter(|row| row.verdict == verdict).count()
    }

    /// For people.
    pub fn markdown(&self) -> String {
        let mut text = "# Numerical stability at the extremes\n".to_owned();
        let [holds, degrades, breaks] =
            [Verdict::Holds, Verdict::Degrades, Verdict::Breaks].map(|verdict| self.count(verdict));
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n{} inputs: {holds} hold, {degrades} degrade, {breaks} break. Degrades: more than {}° off the exact answer, \
             a rotation off by more than {}, an image by more than half a level of 8 bits. Breaks: {}°, {}, 4 levels, or \
             no finite answer.{}\n",
            holds + degrades + breaks,
            LIMITS.degrees[0],
            LIMITS.rotation[0],
            LIMITS.degrees[1],
            LIMITS.rotation[1],
            if self.quick { " Quick: fewer inputs." } else { "" },
        );
        for section in &self.sections {
            let _ = write!(text, "\n## {}\n", section.title);
            for table in &section.tables {
                let (title, grid) = (write::escape(&table.title), write::grid(table));
                let _ = write!(text, "\n### {title}\n\n{grid}{}", write::notes(table));
            }
            if !section.causes.is_empty() {
                text += "\nCauses:\n\n";
                section.causes.iter().for_each(|cause| text += &format!("- {}\n", write::prose(cause)));
            }
        }
        if !self.pictures.is_empty() {
            text += "\n## Pictures\n";
        }
        for picture in &self.pictures {
            let _ = write!(text, "\n![{0}]({0})\n\n{1}\n", picture.file, picture.caption);
        }
        text
    }

    /// Every row, for programs.
    pub fn csv(&self) -> String {
        csv(&self.measurements())
    }

    /// All of it, for programs.
    pub fn json(&self) -> String {
        to_json(self)
    }

    /// Every row of every section as one table.
    fn measurements(&self) -> Table {
        let labels = ["section", "family", "input", "subject", "precision"];
        let values = ["finite", "rotation_error", "error", "equivariance", "jump", "deterministic"];
        let columns = values.map(column).into_iter().chain(["verdict", "note"].map(words));
        let rows = self.sections.iter().flat_map(|section| &section.rows).map(measurement);
        Table {
            labels: labels.map(label).into(),
            columns: columns.collect(),
            rows: rows.collect(),
            ..Table::new("stress", "Numerical stability at the extremes")
        }
    }
}

fn measurement(row: &Row) -> skinsplat_table::Row {
    let Row { finite, rotation_error, error, equivariance, jump, deterministic, .. } = *row;
    let values = [finite, rotation_error, error, equivariance, jump, deterministic];
    let said = [row.verdict.to_string(), row.note.clone()];
    let cells = values.map(Cell::from).into_iter().chain(said.map(Cell::text));
    let labels = [row.section, &row.family, &row.input, &row.subject, row.precision].map(str::to_owned);
    line(labels, cells.collect())
}
