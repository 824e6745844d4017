//! Findings as Markdown, CSV and JSON.

use super::table::{Findings, Grid, LIMITS, Limits, Verdict};
use serde::Serialize;
use skinsplat_core::scene::Image;
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
        Self { schema: "stress-1", limits: LIMITS, quick, sections, pictures }
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
            for grid in &section.grids {
                text += &table(grid);
            }
            if !section.causes.is_empty() {
                text += "\nCauses:\n\n";
                section.causes.iter().for_each(|cause| text += &format!("- {cause}\n"));
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
    ///
    /// # Errors
    /// None that memory does not cause.
    pub fn csv(&self) -> Result<String, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in self.sections.iter().flat_map(|s| &s.rows) {
            writer.serialize(row)?;
        }
        let bytes = writer.into_inner().map_err(|error| error.into_error())?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// All of it, for programs.
    ///
    /// # Errors
    /// None that memory does not cause.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

fn table(grid: &Grid) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = format!("\n### {}\n\n{}", grid.title, line(&grid.headings));
    text += &line(&grid.headings.iter().map(|_| "---".to_owned()).collect::<Vec<_>>());
    grid.rows.iter().for_each(|row| text += &line(row));
    if !grid.notes.is_empty() {
        text += "\n";
        grid.notes.iter().for_each(|note| text += &format!("- {note}\n"));
    }
    text
}
