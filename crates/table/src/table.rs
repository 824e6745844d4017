//! The table as a value: the one thing that every format is written from.

use super::{Column, Digits, Row, RowKind};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A table, ready to be written in any format.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// What programs call it; names files and LaTeX labels.
    pub id: String,
    /// Heading: `Table 1`.
    pub title: String,
    /// Caption, then what the numbers come from: sentences without their full stops. A pair of backticks marks code.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sentences: Vec<String>,
    /// What the samples behind rows are counted in: `frames`. None where rows are no statistics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_unit: Option<String>,
    /// The leading text columns, which say what a row is of.
    pub labels: Vec<Label>,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Row>,
    /// Footnotes; cells refer to them by index.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Remarks on the table as a whole: sentences with their full stops. A pair of backticks marks code.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// A leading text column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Label {
    /// What programs call it.
    pub key: String,
    /// Heading.
    pub title: String,
    /// The first of several labels may be printed once, above the rows that share it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub once: bool,
}

impl Label {
    /// A label that every row repeats.
    pub fn new(key: impl Into<String>, title: impl Into<String>) -> Self {
        Self { key: key.into(), title: title.into(), once: false }
    }

    /// Printed once above rows that share it.
    pub fn once(self) -> Self {
        Self { once: true, ..self }
    }
}

impl Table {
    /// A table without columns and rows.
    pub fn new(id: impl Into<String>, title: impl Into<String>) -> Self {
        Self { id: id.into(), title: title.into(), ..Self::default() }
    }

    /// Checks what formats rely on, for a table that was read from a file or made by a program that may be wrong.
    ///
    /// # Errors
    /// One line that names the table and what is wrong.
    pub fn check(&self) -> Result<(), String> {
        let wrong = |what: String| Err(format!("table `{}`: {what}", self.id));
        let digits = self.columns.iter().filter_map(|column| column.digits?.count());
        if let Some(n) = digits.into_iter().find(|&n| n > Digits::MOST) {
            return wrong(format!("digits: {n}; expected at most {}", Digits::MOST));
        }
        let names =
            self.labels.iter().map(|label| label.key.clone()).chain(self.columns.iter().map(Column::name));
        if let Some(name) = twice(names) {
            return wrong(format!("columns: `{name}` twice; expected each once"));
        }
        if let Some(id) = twice(self.rows.iter().map(|row| row.id.clone())) {
            return wrong(format!("rows: `{id}` twice; expected each once"));
        }
        for (r, row) in self.rows.iter().enumerate() {
            let (labels, cells) = (row.labels.len(), row.cells.len());
            if labels != self.labels.len() || labels == 0 || cells != self.columns.len() {
                let expected = format!("{} (at least 1) and {}", self.labels.len(), self.columns.len());
                return wrong(format!("rows[{r}]: {labels} labels and {cells} cells; expected {expected}"));
            }
            let notes = row.cells.iter().flat_map(|cell| &cell.notes);
            if let Some(note) = notes.into_iter().find(|&&note| note >= self.notes.len()) {
                return wrong(format!("rows[{r}]: note {note}; expected below {}", self.notes.len()));
            }
        }
        Ok(())
    }

    /// Per row, whether its first label is that of the row above and need not be repeated. A mean does not belong to the
    /// rows above it, whatever they are called.
    pub(crate) fn repeats(&self) -> Vec<bool> {
        let once = self.labels.len() > 1 && self.labels[0].once;
        let group = |row: &Row| (row.labels.first().cloned(), row.kind == RowKind::Mean);
        let same = |r: usize| r > 0 && group(&self.rows[r - 1]) == group(&self.rows[r]);
        (0..self.rows.len()).map(|r| once && same(r)).collect()
    }

    /// The columns that have an explanation: heading and text.
    pub(crate) fn legend(&self) -> impl Iterator<Item = (&str, &str)> {
        self.columns.iter().filter_map(|column| Some((column.title.as_str(), column.about.as_deref()?)))
    }
}

/// The first name that comes a second time.
fn twice(names: impl Iterator<Item = String>) -> Option<String> {
    let mut seen = BTreeSet::new();
    names.into_iter().find(|name| !seen.insert(name.clone()))
}
