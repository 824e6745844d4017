//! The table as a value: the one thing that Markdown, CSV, JSON and LaTeX are written from.

use super::stats::Paired;
use crate::experiment::Source;
use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricKind;

/// A table, ready to be written in any format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Id of the experiment; names the files.
    pub id: String,
    /// Such as `Table 1`.
    pub title: String,
    /// One sentence, without a full stop at the end.
    pub caption: String,
    /// What the numbers come from: data, protocol, profile, frames. Sentences without full stops.
    pub ran_on: Vec<String>,
    /// Own data, a stand-in, or nothing.
    pub source: Source,
    /// Headings of the leading text columns.
    pub labels: Vec<String>,
    /// The metric columns.
    pub columns: Vec<TableColumn>,
    /// The rows.
    pub rows: Vec<Row>,
    /// Footnotes; cells refer to them by index.
    pub notes: Vec<String>,
    /// Remarks that belong to the table as a whole.
    pub remarks: Vec<String>,
    /// Variants compared frame by frame, per sequence and over all of them.
    pub comparisons: Vec<Comparison>,
    /// The paper's own table.
    pub paper: Option<Box<Table>>,
}

/// Most digits after the point that a document may ask for.
const MOST_DECIMALS: usize = 12;

impl Table {
    /// Checks what formats rely on, for a table that was read from a file.
    ///
    /// # Errors
    /// One line that names the table and what is wrong.
    pub(super) fn check(&self) -> Result<(), String> {
        let wrong = |what: String| Err(format!("table `{}`: {what}", self.id));
        let decimals = self.columns.iter().map(|column| column.decimals);
        let differences = self.comparisons.iter().flat_map(|c| &c.differences).map(|d| d.decimals);
        if let Some(n) = decimals.chain(differences).find(|&n| n > MOST_DECIMALS) {
            return wrong(format!("decimals: {n}; expected at most {MOST_DECIMALS}"));
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
        self.paper.as_ref().map_or(Ok(()), |paper| paper.check())
    }

    /// The value as JSON, indented, with a final newline.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("keys are strings and every number is finite") + "\n"
    }
}

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
    pub metric: MetricKind,
    /// Digits after the point.
    pub decimals: usize,
    /// The difference; none if no frame was scored for both or one is infinite. With several seeds, frames are means over
    /// them, each seed's variant compared with the same seed's baseline.
    pub paired: Option<Paired>,
    /// Standard deviation of the mean difference over seeds; none from fewer than two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_seeds: Option<f64>,
}

/// A metric column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableColumn {
    /// Heading over a group of columns: the sequence, in a wide table.
    pub group: Option<String>,
    /// Heading.
    pub title: String,
    /// The metric.
    pub metric: MetricKind,
    /// Digits after the point.
    pub decimals: usize,
}

impl TableColumn {
    /// The heading with an arrow towards better values.
    pub fn heading(&self) -> String {
        format!("{} {}", self.title, if self.metric.higher_is_better() { '↑' } else { '↓' })
    }

    /// A name that is unique in the table: `psnr`, `lab psnr`.
    pub fn name(&self) -> String {
        match &self.group {
            Some(group) => format!("{group} {}", self.metric.id()),
            None => self.metric.id().to_owned(),
        }
    }
}

/// What the numbers of a row are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowKind {
    /// Measured on a sequence.
    Measured,
    /// Mean over the sequences, each counting once.
    Mean,
    /// Printed in the paper.
    Paper,
    /// Measured minus printed.
    Difference,
}

/// A row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// What the numbers are.
    pub kind: RowKind,
    /// Text cells, one per [`Table::labels`].
    pub labels: Vec<String>,
    /// One per [`Table::columns`].
    pub cells: Vec<Cell>,
    /// Frames behind the numbers, over the row's sequences.
    pub frames: usize,
    /// Frames that should be behind them and are not.
    pub missing: usize,
}

/// What a cell holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "state", content = "value")]
pub enum Content {
    /// A finite number.
    Number(f64),
    /// Infinity: the PSNR of identical images.
    Infinite,
    /// Frames were scored, but not by this metric (LPIPS without weights).
    NotComputed,
    /// The quantity does not exist (the splats of a mesh).
    NotApplicable,
    /// There should be a number, but no frame was scored.
    Missing,
}

impl Content {
    /// A number, finite or not.
    pub fn number(value: f64) -> Self {
        match value {
            value if value.is_finite() => Self::Number(value),
            f64::INFINITY => Self::Infinite,
            _ => Self::Missing,
        }
    }

    /// The number, if it is one; +inf for [`Content::Infinite`].
    pub fn value(self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(value),
            Self::Infinite => Some(f64::INFINITY),
            Self::NotComputed | Self::NotApplicable | Self::Missing => None,
        }
    }
}

/// A cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// What it holds, in full precision.
    pub content: Content,
    /// Standard deviation over the seeds that the content is the mean of; none from fewer than two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<f64>,
    /// As printed, before any markup: the rounded number (and `± spread`), `∞`, `n/c` (not computed), `—`.
    pub text: String,
    /// Whether it is the best of its sequence, judged on the printed digits.
    pub best: bool,
    /// Frames that should be behind the number and are not.
    pub missing: usize,
    /// Footnotes: indices into [`Table::notes`].
    pub notes: Vec<usize>,
}

impl Cell {
    /// A cell that prints its content with this many digits after the point.
    pub fn new(content: Content, decimals: usize) -> Self {
        let text = match content {
            Content::Number(value) => round(value, decimals),
            Content::Infinite => "∞".to_owned(),
            Content::NotComputed => "n/c".to_owned(),
            Content::NotApplicable | Content::Missing => "—".to_owned(),
        };
        Self { content, spread: None, text, best: false, missing: 0, notes: Vec::new() }
    }

    /// A mean over seeds, printed with its spread.
    pub fn with_spread(content: Content, spread: Option<f64>, decimals: usize) -> Self {
        let cell = Self::new(content, decimals);
        match spread {
            Some(sd) => Self { text: format!("{} ± {}", cell.text, round(sd, decimals)), spread, ..cell },
            None => cell,
        }
    }

    /// A difference, printed with its sign.
    pub fn difference(value: f64, decimals: usize) -> Self {
        let cell = Self::new(Content::number(value), decimals);
        let signed = value > 0.0 && cell.printed() != Some(0.0);
        Self { text: if signed { format!("+{}", cell.text) } else { cell.text.clone() }, ..cell }
    }

    /// A cell without a number.
    pub fn empty() -> Self {
        Self::new(Content::NotApplicable, 0)
    }

    /// The numbers of its footnotes, from 1, separated by commas.
    pub fn footnotes(&self) -> Option<String> {
        let numbers: Vec<String> = self.notes.iter().map(|note| (note + 1).to_string()).collect();
        (!numbers.is_empty()).then(|| numbers.join(","))
    }

    /// The value of the printed digits.
    pub fn printed(&self) -> Option<f64> {
        match self.content {
            Content::Number(_) => self.text.split(' ').next()?.parse().ok(),
            content => content.value(),
        }
    }
}

/// The number with this many digits after the point; never `-0.00`.
fn round(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Marks the best cells of each column among rows that compare with each other. Equal digits are equally good. Nothing
/// is marked in a column where a number is missing or rests on fewer frames than planned, or where there is only one
/// number: there the rows do not compare.
pub(super) fn mark_best(rows: &mut [&mut Vec<Cell>], columns: impl Iterator<Item = MetricKind>) {
    for (c, metric) in columns.enumerate() {
        let values: Vec<f64> = rows.iter().filter_map(|cells| cells[c].printed()).collect();
        let comparable = rows.iter().all(|cells| {
            let cell = &cells[c];
            cell.missing == 0 && (cell.content.value().is_some() || cell.content == Content::NotApplicable)
        });
        if !comparable || values.len() < 2 {
            continue;
        }
        let better = if metric.higher_is_better() { f64::max } else { f64::min };
        let best = values.into_iter().fold(f64::NAN, better);
        for cells in rows.iter_mut() {
            cells[c].best = cells[c].printed() == Some(best);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f64, decimals: usize) -> Cell {
        Cell::new(Content::number(value), decimals)
    }

    fn bests(metric: MetricKind, cells: Vec<Cell>) -> Vec<bool> {
        let mut rows: Vec<Vec<Cell>> = cells.into_iter().map(|cell| vec![cell]).collect();
        mark_best(&mut rows.iter_mut().collect::<Vec<_>>(), std::iter::once(metric));
        rows.iter().map(|cells| cells[0].best).collect()
    }

    #[test]
    fn digits_decide_and_ties_are_both_best() {
        assert_eq!(bests(MetricKind::Psnr, vec![number(22.071, 2), number(22.069, 2)]), [true, true]);
        assert_eq!(bests(MetricKind::Psnr, vec![number(22.07, 2), number(22.08, 2)]), [false, true]);
        assert_eq!(bests(MetricKind::Lpips, vec![number(0.1, 4), number(0.2, 4)]), [true, false]);
        assert_eq!(bests(MetricKind::Splats, vec![number(10.0, 0), number(9.0, 0)]), [false, true]);
        assert_eq!(bests(MetricKind::Psnr, vec![number(f64::INFINITY, 2), number(90.0, 2)]), [true, false]);
    }

    #[test]
    fn rows_that_do_not_compare_have_no_best() {
        let short = Cell { missing: 1, ..number(30.0, 2) };
        assert_eq!(bests(MetricKind::Psnr, vec![short, number(20.0, 2)]), [false, false]);
        let none = Cell::new(Content::NotComputed, 4);
        assert_eq!(bests(MetricKind::Lpips, vec![none.clone(), number(0.1, 4)]), [false, false]);
        assert_eq!(bests(MetricKind::Lpips, vec![none.clone(), none]), [false, false]);
        assert_eq!(bests(MetricKind::Splats, vec![Cell::empty(), number(9.0, 0)]), [false, false]);
        assert_eq!(
            bests(MetricKind::Splats, vec![Cell::empty(), number(9.0, 0), number(8.0, 0)]),
            [false, false, true]
        );
    }

    #[test]
    fn numbers_print_with_their_digits() {
        assert_eq!(number(19.7, 2).text, "19.70");
        assert_eq!(number(-0.001, 2).text, "0.00");
        assert_eq!(number(-0.5, 2).text, "-0.50");
        assert_eq!(number(f64::INFINITY, 2).text, "∞");
        assert_eq!(Content::number(f64::NAN), Content::Missing);
        assert_eq!(number(65180.0, 0).text, "65180");
    }
}
