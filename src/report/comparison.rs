//! Variants compared frame by frame.

use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricId;
use skinsplat_statistics::{Covers, Estimate, Interval, Judgement};
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
    /// With poses fitted to the test images.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
    /// Digits after the point.
    pub decimals: usize,
    /// Variant minus baseline; none if no frame was scored for both or one is infinite. With several seeds, each seed's variant
    /// is compared with the same seed's baseline.
    pub estimate: Option<Estimate>,
    /// What the estimate decides.
    pub judgement: Option<Judgement>,
    /// Standard deviation of the mean difference over seeds; none from fewer than two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_seeds: Option<f64>,
}

impl Comparison {
    /// Frames behind the differences.
    fn frames(&self) -> usize {
        self.differences.iter().filter_map(|d| d.estimate).map(|e| e.frames).max().unwrap_or(0)
    }

    /// What the intervals speak of: `frames`, `frames and seeds`, `4 subjects`.
    fn covers(&self) -> Cell {
        let estimates = self.differences.iter().filter_map(|d| d.estimate);
        let mut intervals = estimates.filter_map(|estimate| Some((estimate, estimate.interval?)));
        match intervals.next() {
            None => Cell::empty(),
            Some((estimate, Interval { covers: Covers::Subjects, .. })) => {
                Cell::text(format!("{} subjects", estimate.subjects))
            }
            Some((_, interval)) => Cell::text(interval.covers.words()),
        }
    }

    fn row(&self, index: usize) -> Row {
        let sequence = self.sequence.clone().unwrap_or_else(|| "All".to_owned());
        let difference = format!("{} − {}", self.variant, self.baseline);
        let cells =
            [Cell::count(self.frames()), self.covers()].into_iter().chain(self.differences.iter().map(cell));
        Row::new(index.to_string(), [sequence, difference], cells.collect())
    }
}

/// A row per comparison, a column per metric.
pub(super) fn table(comparisons: &[Comparison]) -> Table {
    let differences = comparisons.first().map_or(&[][..], |first| first.differences.as_slice());
    let fitted_too = differences.iter().any(|d| d.fitted);
    let column = |d: &MetricDifference| {
        let (id, title) = (d.metric.id(), d.metric.title());
        match (fitted_too, d.fitted) {
            (false, _) => Column::new(id, format!("Δ {title}")),
            (true, false) => Column::new(id, format!("Δ {title} (as given)")),
            (true, true) => Column::new(format!("{id}-fitted"), format!("Δ {title} (fitted)")),
        }
    };
    Table {
        labels: vec![Label::new("sequence", "Sequence"), Label::new("difference", "Difference")],
        columns: [Column::new("frames", "Frames"), Column::text("covers", "Interval covers")]
            .into_iter()
            .chain(differences.iter().map(column))
            .collect(),
        rows: comparisons.iter().enumerate().map(|(i, comparison)| comparison.row(i)).collect(),
        ..Table::new("comparisons", "Frame by frame")
    }
}

/// `+0.12 ± 0.03 over seeds [+0.05, +0.20], better, won 83 %`.
fn cell(difference: &MetricDifference) -> Cell {
    let (Some(estimate), Some(judgement)) = (difference.estimate, difference.judgement) else {
        return Cell::empty();
    };
    // One digit more than the table: differences are smaller than what they are differences of.
    let digits = Digits::Decimals(difference.decimals + 1);
    let signed = |value: f64| Cell::difference(value, digits).text;
    let interval = match estimate.interval {
        Some(Interval { low, high, .. }) => format!(" [{}, {}]", signed(low), signed(high)),
        None => String::new(),
    };
    let spread = match difference.over_seeds {
        Some(sd) => format!(" ± {} over seeds", digits.show(sd)),
        None => String::new(),
    };
    let (mean, words, won) = (signed(estimate.mean), judgement.words(), 100.0 * estimate.win_rate);
    Cell::phrase(estimate.mean, format!("{mean}{spread}{interval}, {words}, won {won:.0} %"))
}
