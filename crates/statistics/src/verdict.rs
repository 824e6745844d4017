//! From an estimate to words.

use super::Estimate;

/// What an interval decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Verdict {
    /// The candidate is better: the interval lies on that side of 0.
    Better,
    /// The candidate is worse: the interval lies on that side of 0.
    Worse,
    /// The interval holds 0 and lies within the margin.
    NoDifference,
    /// The interval holds 0 and reaches beyond the margin.
    Undecided,
    /// There is no interval.
    TooFewFrames,
}

/// A verdict with the margin up to which a difference is as good as none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Judgement {
    /// What was decided. A difference that is decided and below the margin is `Better` or `Worse`.
    pub verdict: Verdict,
    /// The margin X, not negative; 0 where any difference counts.
    pub margin: f64,
    /// Whether the interval lies within \[-X, X\]: also of a difference that is decided.
    pub within_margin: bool,
}

impl Judgement {
    /// Judges an estimate. An interval within the margin is two one-sided tests at 2.5 % each (Schuirmann 1987), as one that does not
    /// hold 0 is a two-sided test at 5 %.
    pub fn new(estimate: &Estimate, margin: f64, higher_is_better: bool) -> Self {
        let Some(interval) = estimate.interval else {
            return Self { verdict: Verdict::TooFewFrames, margin, within_margin: false };
        };
        let within_margin = -margin <= interval.low && interval.high <= margin;
        let verdict = match (interval.low > 0.0, interval.high < 0.0) {
            (true, _) if higher_is_better => Verdict::Better,
            (_, true) if !higher_is_better => Verdict::Better,
            (false, false) if within_margin => Verdict::NoDifference,
            (false, false) => Verdict::Undecided,
            _ => Verdict::Worse,
        };
        Self { verdict, margin, within_margin }
    }

    /// `better`, `worse, by at most 0.05`, `no difference above 0.05`, `undecided`, `too few frames`.
    pub fn words(&self) -> String {
        let below = if self.within_margin { format!(", by at most {}", self.margin) } else { String::new() };
        match self.verdict {
            Verdict::Better => format!("better{below}"),
            Verdict::Worse => format!("worse{below}"),
            Verdict::NoDifference => format!("no difference above {}", self.margin),
            Verdict::Undecided => "undecided".to_owned(),
            Verdict::TooFewFrames => "too few frames".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Covers, Interval};
    use super::*;

    fn words(interval: Option<[f64; 2]>, margin: f64, higher_is_better: bool) -> String {
        let interval = interval.map(|[low, high]| Interval { low, high, covers: Covers::Frames });
        let (effective_frames, win_rate) = (20.0, 0.5);
        let estimate =
            Estimate { mean: 0.0, interval, effective_frames, win_rate, subjects: 1, seeds: 1, frames: 20 };
        Judgement::new(&estimate, margin, higher_is_better).words()
    }

    #[test]
    fn every_position_of_an_interval_has_its_words() {
        for (interval, expected) in [
            (Some([0.1, 0.3]), "better"),
            (Some([0.01, 0.3]), "better"),
            (Some([0.01, 0.04]), "better, by at most 0.05"),
            (Some([-0.04, 0.04]), "no difference above 0.05"),
            (Some([-0.05, 0.05]), "no difference above 0.05"),
            (Some([0.0, 0.0]), "no difference above 0.05"),
            (Some([-0.04, 0.06]), "undecided"),
            (Some([0.0, 0.3]), "undecided"),
            (Some([-0.04, -0.01]), "worse, by at most 0.05"),
            (Some([-0.3, -0.01]), "worse"),
            (None, "too few frames"),
        ] {
            assert_eq!(words(interval, 0.05, true), expected, "{interval:?}");
        }
    }

    #[test]
    fn less_may_be_better_and_any_difference_may_count() {
        assert_eq!(words(Some([0.1, 0.3]), 0.05, false), "worse");
        assert_eq!(words(Some([-0.3, -0.1]), 0.05, false), "better");
        assert_eq!(words(Some([-0.01, 0.01]), 0.0, true), "undecided");
        assert_eq!(words(Some([0.0, 0.0]), 0.0, true), "no difference above 0");
    }
}
