//! Rows.

use super::Cell;
use serde::{Deserialize, Serialize};

/// What the numbers of a row are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowKind {
    /// Measured.
    #[default]
    Measured,
    /// Mean of measured ones.
    Mean,
    /// Printed in a paper.
    Paper,
    /// Measured minus printed.
    Difference,
}

impl RowKind {
    /// Its name in files.
    pub fn id(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Mean => "mean",
            Self::Paper => "paper",
            Self::Difference => "difference",
        }
    }
}

/// A row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// What programs call it. Unique in the table.
    pub id: String,
    /// What the numbers are.
    pub kind: RowKind,
    /// One per label column of the table.
    pub labels: Vec<String>,
    /// One per column of the table.
    pub cells: Vec<Cell>,
    /// Sample behind the numbers, counted in the table's unit; 0 if the table has none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub sample: usize,
    /// How many should be in the sample and are not.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub missing: usize,
}

/// For serde.
pub(crate) fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Row {
    /// A measured row.
    pub fn new<L: Into<String>>(
        id: impl Into<String>,
        labels: impl IntoIterator<Item = L>,
        cells: Vec<Cell>,
    ) -> Self {
        let labels = labels.into_iter().map(Into::into).collect();
        Self { id: id.into(), kind: RowKind::Measured, labels, cells, sample: 0, missing: 0 }
    }
}
