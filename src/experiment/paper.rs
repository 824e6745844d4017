//! What the paper printed, digit by digit, and how its comparisons split the data.

use super::{FrameInfo, Role};
use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricId;
use std::collections::BTreeMap;
use std::fmt;

/// A decimal number with the digits that were printed: `19.70` stays `19.70`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Printed(String);

impl Printed {
    /// The value.
    pub fn value(&self) -> f64 {
        self.0.parse().expect("checked when made")
    }

    /// Digits after the point.
    pub fn decimals(&self) -> usize {
        self.0.split_once('.').map_or(0, |(_, fraction)| fraction.len())
    }

    /// The digits as printed.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Printed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<Printed> for String {
    fn from(printed: Printed) -> Self {
        printed.0
    }
}

impl TryFrom<String> for Printed {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        let (whole, fraction) = text.split_once('.').unwrap_or((&text, "0"));
        let whole = whole.strip_prefix('-').unwrap_or(whole);
        if digits(whole) && digits(fraction) && text.len() <= 24 {
            Ok(Self(text))
        } else {
            Err(format!("`{text}` is not a printed number; expected digits in quotes, such as \"19.70\""))
        }
    }
}

/// The printed table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paper {
    /// Where it was printed, such as `arXiv:2509.11411`.
    pub source: String,
    /// Section that discusses it.
    pub section: String,
    /// Its caption.
    pub caption: String,
    /// What the proposed variant was compared with.
    pub compared_with: String,
    /// Remark on the table.
    #[serde(default)]
    pub note: Option<String>,
    /// What becomes of test poses before they are scored in it, as far as is known; a caption says so where we show both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test_poses: Option<String>,
    /// How well its protocol is known, and why.
    pub confidence: String,
    /// The stock evaluation of the compared method, read off its public code: split, resolution, background, region,
    /// metric variants, iterations.
    #[serde(default)]
    pub stock: BTreeMap<String, String>,
    /// The variants in printed order.
    pub variants: Vec<PaperVariant>,
    /// The numbers.
    pub rows: Vec<PaperRow>,
}

impl Paper {
    /// The numbers of a sequence and variant.
    pub fn row(&self, sequence: &str, variant: &str) -> Option<&PaperRow> {
        self.rows.iter().find(|row| !row.average && row.sequence == sequence && row.variant == variant)
    }

    /// The printed average of a variant over the sequences, where the paper prints one.
    pub fn average(&self, variant: &str) -> Option<&PaperRow> {
        self.rows.iter().find(|row| row.average && row.variant == variant)
    }

    /// Ids of the sequences in printed order.
    pub fn sequences(&self) -> Vec<&str> {
        let mut ids: Vec<&str> = Vec::new();
        for row in self.rows.iter().filter(|row| !row.average) {
            if !ids.contains(&row.sequence.as_str()) {
                ids.push(&row.sequence);
            }
        }
        ids
    }

    /// The label of a printed variant.
    pub fn label(&self, variant: &str) -> Option<&str> {
        self.variants.iter().find(|v| v.id == variant).map(|v| v.label.as_str())
    }

    /// Whether the numbers of a variant are of fitted test poses, as far as the paper says.
    pub fn fitted(&self, variant: &str) -> bool {
        self.variants.iter().any(|v| v.id == variant && v.fitted == Some(true))
    }
}

/// A variant of the printed table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperVariant {
    /// Id that rows refer to.
    pub id: String,
    /// As printed.
    pub label: String,
    /// Whether its numbers are of test poses that were fitted to the images; absent where the paper does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<bool>,
}

/// The printed numbers of one sequence and variant. A key of the file that is no field is the name of a metric.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PaperRow {
    /// Sequence (subject) as printed.
    pub sequence: String,
    /// Id of the variant.
    pub variant: String,
    /// The metrics that are printed in bold.
    pub bold: Vec<MetricId>,
    /// Why a number of the row is probably a slip.
    #[serde(default)]
    pub doubt: Option<String>,
    /// True for a printed average over the sequences.
    #[serde(default)]
    pub average: bool,
    /// The printed numbers.
    #[serde(flatten)]
    pub values: BTreeMap<MetricId, Printed>,
}

impl PaperRow {
    /// The printed number of a metric.
    pub fn value(&self, metric: MetricId) -> Option<&Printed> {
        self.values.get(&metric)
    }
}

/// Which frames of a subject are for training and which for testing, in the terms of the compared method's
/// repository. Needed for sequences whose role is [`Role::Whole`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// Subject.
    pub sequence: String,
    /// Time steps for training: first, last, step.
    pub train: Option<[usize; 3]>,
    /// Time steps for testing: first, last, step.
    pub test: Option<[usize; 3]>,
    /// Whether the last time step belongs to the range.
    pub end_inclusive: Option<bool>,
    /// Cameras for training; all if absent.
    pub train_cameras: Option<Vec<usize>>,
    /// Cameras for testing; all if absent.
    pub test_cameras: Option<Vec<usize>>,
    /// Number of training frames that result.
    pub n_train: Option<usize>,
    /// Number of test frames that result.
    pub n_test: Option<usize>,
    /// The sequence for training; whichever has the role if absent.
    pub train_take: Option<String>,
    /// The sequence for testing.
    pub test_take: Option<String>,
}

impl Split {
    /// The sequence that plays the part, if the split names one.
    pub fn take(&self, role: Role) -> Option<&str> {
        match role {
            Role::Train => self.train_take.as_deref(),
            Role::Test => self.test_take.as_deref(),
            Role::Val | Role::Whole => None,
        }
    }

    /// Whether a frame plays the part. Without a range every time step does, without cameras every camera.
    pub fn selects(&self, role: Role, frame: &FrameInfo) -> bool {
        let (range, cameras) = match role {
            Role::Train => (self.train, &self.train_cameras),
            Role::Test => (self.test, &self.test_cameras),
            Role::Val | Role::Whole => return true,
        };
        let in_range = range.is_none_or(|range| self.steps(range).any(|time| time == frame.time));
        in_range && cameras.as_ref().is_none_or(|cameras| cameras.contains(&frame.camera))
    }

    /// How many frames play the part if every time step and camera is present; `None` without a range.
    pub fn count(&self, role: Role) -> Option<usize> {
        let (range, cameras) = match role {
            Role::Train => (self.train, &self.train_cameras),
            Role::Test => (self.test, &self.test_cameras),
            Role::Val | Role::Whole => return None,
        };
        Some(self.steps(range?).count() * cameras.as_ref().map_or(1, Vec::len))
    }

    /// The time steps of a range.
    fn steps(&self, [first, last, step]: [usize; 3]) -> impl Iterator<Item = usize> {
        let end = if self.end_inclusive == Some(true) { last.saturating_add(1) } else { last };
        (first..end).step_by(step.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_digits_survive() {
        for text in ["19.70", "0.6800", "67389", "-0.5", "0"] {
            let printed = Printed::try_from(text.to_owned()).expect(text);
            assert_eq!(printed.to_string(), text);
            assert_eq!(format!("{:.*}", printed.decimals(), printed.value()), text);
        }
        for text in ["", ".5", "5.", "1e3", "nan", "inf", "1.2.3", "+1", "--1", "1 "] {
            assert!(Printed::try_from(text.to_owned()).is_err(), "{text}");
        }
    }

    #[test]
    fn ranges_are_inclusive_only_where_the_split_says_so() {
        let split = |end_inclusive| Split {
            sequence: "s".into(),
            train: Some([0, 8, 4]),
            test: Some([0, 8, 4]),
            end_inclusive: Some(end_inclusive),
            train_cameras: Some(vec![0, 1]),
            test_cameras: Some(vec![2]),
            n_train: None,
            n_test: None,
            train_take: None,
            test_take: None,
        };
        let frame = |time, camera| FrameInfo { name: String::new(), time, camera };
        assert!(split(true).selects(Role::Train, &frame(8, 1)));
        assert!(!split(false).selects(Role::Train, &frame(8, 1)));
        assert!(!split(true).selects(Role::Train, &frame(4, 2)));
        assert!(split(true).selects(Role::Test, &frame(4, 2)));
        assert!(!split(true).selects(Role::Test, &frame(5, 2)));
        assert_eq!(split(true).count(Role::Train), Some(6));
        assert_eq!(split(false).count(Role::Test), Some(2));
    }
}
