//! 95 % intervals of a mean, from the level that says most.

use super::autocorrelation::{Candidate, Moments, posterior};
use super::series::{Subject, mean};
use super::student::{StudentT, falling_root};

/// Fewest frames of a sequence for which an interval of one subject is given.
pub const FEWEST_FRAMES: usize = 5;

/// Fewest pairs of consecutive frames, over all sequences, for which an interval of one subject is given: 8 frames of one
/// sequence, 5 each of two.
pub const FEWEST_STEPS: usize = 7;

/// Fewest seeds of one subject for which an interval covers them.
pub const FEWEST_SEEDS: usize = 3;

/// Probability outside an interval.
const OUTSIDE: f64 = 0.05;

/// What an interval speaks of: over which of the things that could have been others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Covers {
    /// Other frames of the same sequences, of the same subject, with the same seeds.
    Frames,
    /// Other frames and other seeds of the same subject.
    Seeds,
    /// Other subjects, with their own frames and seeds.
    Subjects,
}

impl Covers {
    /// `frames`, `frames and seeds` or `subjects`.
    pub fn words(self) -> &'static str {
        match self {
            Self::Frames => "frames",
            Self::Seeds => "frames and seeds",
            Self::Subjects => "subjects",
        }
    }
}

/// A 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// What it speaks of.
    pub covers: Covers,
}

impl Interval {
    fn around(centre: f64, half: f64, covers: Covers) -> Self {
        Self { low: centre - half, high: centre + half, covers }
    }
}

/// Of several subjects: t over their means, whatever happens within them.
pub(crate) fn over_subjects(subjects: &[Subject]) -> Interval {
    let means: Vec<f64> = subjects.iter().map(Subject::mean).collect();
    let df = (means.len() - 1) as f64;
    let half = StudentT::new(df).beyond(OUTSIDE) * squared_error(&means).sqrt();
    Interval::around(mean(&means), half, Covers::Subjects)
}

/// Of one subject; none of too few frames.
pub(crate) fn within(subject: &Subject, candidates: &[Candidate]) -> Option<Interval> {
    let steps: usize = subject.sequences.iter().map(|sequence| sequence.len() - 1).sum();
    if steps < FEWEST_STEPS || subject.sequences.iter().any(|sequence| sequence.len() < FEWEST_FRAMES) {
        return None;
    }
    let centre = subject.mean();
    if subject.seeds.len() < FEWEST_SEEDS {
        return Some(Interval::around(centre, half(candidates, 0.0, 1.0), Covers::Frames));
    }
    let (of_seeds, df) = (squared_error(&subject.seeds), (subject.seeds.len() - 1) as f64);
    // Frames alone or seeds alone must not say more than both.
    let seeds_alone = StudentT::new(df).beyond(OUTSIDE) * of_seeds.sqrt();
    Some(Interval::around(centre, half(candidates, of_seeds, df).max(seeds_alone), Covers::Seeds))
}

/// What may be behind the frames of a subject; nothing if they do not differ at all.
pub(crate) fn candidates(subject: &Subject) -> Vec<Candidate> {
    let moments = subject.sequences.iter().filter(|sequence| sequence.len() >= 2).map(|s| Moments::new(s));
    let moments: Vec<Moments> = moments.collect();
    let varying: Vec<Moments> = moments.iter().copied().filter(|moments| !moments.is_constant()).collect();
    let mut candidates = if varying.is_empty() { Vec::new() } else { posterior(&varying) };
    // What is constant adds nothing to the variance of the mean of all sequences, and counts in it.
    let share = varying.len() as f64 / subject.sequences.len() as f64;
    candidates.iter_mut().for_each(|candidate| candidate.variance *= share * share);
    candidates
}

/// Squared standard error of the mean of at least two values.
fn squared_error(values: &[f64]) -> f64 {
    let (centre, n) = (mean(values), values.len() as f64);
    values.iter().map(|value| (value - centre) * (value - centre)).sum::<f64>() / (n - 1.0) / n
}

/// Half the width: where the mixture of t distributions, one per candidate, has 5 % outside. Each is scaled by the variance of its
/// candidate and of what comes on top of it with `df` degrees of freedom (Satterthwaite 1946).
fn half(candidates: &[Candidate], on_top: f64, df: f64) -> f64 {
    let mut t = StudentT::new(df);
    let part = |candidate: &Candidate| {
        let variance = candidate.variance + on_top;
        let spread = candidate.variance * candidate.variance / candidate.df + on_top * on_top / df;
        // One sequence has one number of degrees of freedom, whatever its autocorrelation.
        let own = variance * variance / spread;
        if (own - t.df()).abs() > 1e-9 * own {
            t = StudentT::new(own);
        }
        (candidate.weight, variance.sqrt(), t)
    };
    let parts: Vec<(f64, f64, StudentT)> = candidates.iter().map(part).collect();
    if parts.is_empty() {
        return StudentT::new(df).beyond(OUTSIDE) * on_top.sqrt();
    }
    let expected: f64 = parts.iter().map(|(weight, error, _)| weight * error).sum();
    let outside = |h: f64| parts.iter().map(|(weight, error, t)| weight * t.outside(h / error)).sum::<f64>();
    // In units of the expected error, so that the search does not depend on the unit of the differences.
    expected * falling_root(|h| outside(h * expected) - OUTSIDE, 2.0)
}
