//! Variants compared frame by frame.

use super::stats::Paired;
use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Digits, Label, Row, Table};

/// Two variants compared frame by frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The sequence; none for all of them together.
    pub sequence: Option<String>,
    /// Label of the variant.
    pub variant: String,
    /// Label of the variant that it is compared with.
    pub baseline: String,
    /// One per metric that frames have.
    pub differences: Vec<MetricDifference>,
}

/// How two variants differ in a metric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricDifference {
    /// The metric.
    pub metric: MetricId,
    /// Digits after the point.
    pub decimals: usize,
    /// The difference; none if no frame was scored for both or one is infinite. With several seeds, frames are means over
    /// them, each seed's variant compared with the same seed's baseline.
    pub paired: Option<Paired>,
    /// Standard deviation of the mean difference over seeds; none from fewer than two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_seeds: Option<f64>,
}

impl Comparison {
    /// Frames behind the differences.
    fn frames(&self) -> usize {
        self.differences.iter().filter_map(|d| d.paired).map(|p| p.frames).max().unwrap_or(0)
    }

    fn row(&self, index: usize) -> Row {
        let sequence = self.sequence.clone().unwrap_or_else(|| "All".to_owned());
        let difference = format!("{} − {}", self.variant, self.baseline);
        let cells = [Cell::count(self.frames())].into_iter().chain(self.differences.iter().map(cell));
        Row::new(index.to_string(), [sequence, difference], cells.collect())
    }
}

/// A row per comparison, a column per metric.
pub(super) fn table(comparisons: &[Comparison]) -> Table {
    let differences = comparisons.first().map_or(&[][..], |first| first.differences.as_slice());
    let column = |d: &MetricDifference| Column::new(d.metric.id(), format!("Δ {}", d.metric.title()));
    Table {
        labels: vec![Label::new("sequence", "Sequence"), Label::new("difference", "Difference")],
        columns: [Column::new("frames", "Frames")]
            .into_iter()
            .chain(differences.iter().map(column))
            .collect(),
        rows: comparisons.iter().enumerate().map(|(i, comparison)| comparison.row(i)).collect(),
        ..Table::new("comparisons", "Frame by frame")
    }
}

/// `+0.12 ± 0.03 over seeds [+0.05, +0.20], won 83 %`.
fn cell(difference: &MetricDifference) -> Cell {
    let Some(paired) = difference.paired else { return Cell::empty() };
    // One digit more than the table: differences are smaller than what they are differences of.
    let digits = Digits::Decimals(difference.decimals + 1);
    let signed = |value: f64| Cell::difference(value, digits).text;
    let interval = match paired.interval {
        Some([low, high]) => format!(" [{}, {}]", signed(low), signed(high)),
        None => String::new(),
    };
    let spread = match difference.over_seeds {
        Some(sd) => format!(" ± {} over seeds", digits.show(sd)),
        None => String::new(),
    };
    let won = 100.0 * paired.win_rate;
    Cell::phrase(paired.mean, format!("{}{spread}{interval}, won {won:.0} %", signed(paired.mean)))
}
