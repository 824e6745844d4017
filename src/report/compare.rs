//! Two results documents: what moved, and whether for the worse.

use super::results::{FrameResult, Results, VariantResults};
use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricId;
use std::collections::BTreeMap;

/// How far a number of each metric may move without counting.
#[derive(Clone, Debug, PartialEq)]
pub struct Tolerances(BTreeMap<MetricId, f64>);

impl Default for Tolerances {
    /// Half of the last digit that tables print; counts must be equal.
    fn default() -> Self {
        Self::each(|metric| metric.metric().tolerance)
    }
}

impl Tolerances {
    /// A tolerance for every metric.
    pub fn each(tolerance: impl Fn(MetricId) -> f64) -> Self {
        Self(MetricId::all().map(|metric| (metric, tolerance(metric))).collect())
    }

    /// No movement at all: for two runs of one program on one machine.
    pub fn none() -> Self {
        Self::each(|_| 0.0)
    }

    fn of(&self, metric: MetricId) -> f64 {
        self.0.get(&metric).copied().unwrap_or_default()
    }
}

/// The outcome, worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A sequence got worse by more than the tolerance, or lost frames.
    Worse,
    /// Nothing of the baseline was found in the candidate.
    NothingCompared,
    /// A sequence got better by more than the tolerance and none got worse.
    Better,
    /// Numbers moved within the tolerances.
    Within,
    /// Not a bit moved.
    Identical,
}

impl Verdict {
    /// Whether a program that checks for regressions should be content.
    pub fn is_good(self) -> bool {
        !matches!(self, Self::Worse | Self::NothingCompared)
    }
}

/// A number that moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Move {
    /// Table, sequence and variant, and for a frame its name.
    pub at: String,
    /// The metric.
    pub metric: MetricId,
    /// In the baseline.
    pub baseline: f64,
    /// In the candidate.
    pub candidate: f64,
    /// Candidate minus baseline over the tolerance; infinite (`null` in JSON) where the tolerance is 0
    /// or one value is infinite.
    pub tolerances: f64,
}

impl Move {
    /// True if the candidate is better.
    pub fn is_better(&self) -> bool {
        (self.candidate > self.baseline) == self.metric.higher_is_better()
    }

    /// The movement of a number, if it moved.
    fn new(at: String, metric: MetricId, baseline: f64, candidate: f64, tolerance: f64) -> Option<Self> {
        if baseline == candidate {
            return None;
        }
        let tolerances = (candidate - baseline) / tolerance;
        Some(Self { at, metric, baseline, candidate, tolerances })
    }
}

/// Everything that a comparison found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changes {
    /// The outcome.
    pub verdict: Verdict,
    /// Sequences and variants that both documents have.
    pub compared: usize,
    /// Sequences whose numbers moved by more than the tolerance, in the order of the baseline.
    pub sequences: Vec<Move>,
    /// Frames that moved at all, the farthest first.
    pub frames: Vec<Move>,
    /// Scores that the baseline has and the candidate has not.
    pub lost: Vec<String>,
    /// Scores that only the candidate has.
    pub gained: Vec<String>,
}

/// Compares a candidate with a baseline: the aggregates of every sequence and variant against the tolerances, and frame
/// by frame to show where a movement comes from. Frames are matched by sequence and name, so that runs whose keys differ
/// (other code versions) compare.
pub fn compare(baseline: &Results, candidate: &Results, tolerances: &Tolerances) -> Changes {
    let (before, after) = (series(baseline), series(candidate));
    let mut changes = Changes {
        verdict: Verdict::Identical,
        compared: 0,
        sequences: Vec::new(),
        frames: Vec::new(),
        lost: Vec::new(),
        gained: Vec::new(),
    };
    for (at, variant) in &before {
        match after.get(at) {
            Some(other) => changes.compare_series(at, variant, other, tolerances),
            None if variant.scored() > 0 => changes.lost.push(at.clone()),
            None => {}
        }
    }
    let new = |(at, variant): &(&String, &&VariantResults)| !before.contains_key(*at) && variant.scored() > 0;
    changes.gained.extend(after.iter().filter(new).map(|(at, _)| at.clone()));
    changes.frames.sort_by(|a, b| {
        (b.tolerances.abs().total_cmp(&a.tolerances.abs()))
            .then_with(|| (b.candidate - b.baseline).abs().total_cmp(&(a.candidate - a.baseline).abs()))
    });
    changes.verdict = changes.judge();
    changes
}

/// Every sequence and variant, by `table / sequence / variant`.
fn series(results: &Results) -> BTreeMap<String, &VariantResults> {
    let mut all = BTreeMap::new();
    for table in &results.tables {
        for sequence in &table.sequences {
            for variant in &sequence.variants {
                let at = format!("{} / {} / {}", table.experiment, sequence.id, variant.id);
                all.insert(at, variant);
            }
        }
    }
    all
}

impl Changes {
    fn compare_series(
        &mut self,
        at: &str,
        before: &VariantResults,
        after: &VariantResults,
        tolerances: &Tolerances,
    ) {
        self.compared += 1;
        for metric in MetricId::all() {
            let tolerance = tolerances.of(metric);
            match (before.value(metric), after.value(metric)) {
                (Some(a), Some(b)) => {
                    self.sequences.extend(Move::new(at.to_owned(), metric, a, b, tolerance))
                }
                (Some(_), None) => self.lost.push(format!("{at} {}", metric.id())),
                (None, Some(_)) => self.gained.push(format!("{at} {}", metric.id())),
                (None, None) => {}
            }
        }
        let named: BTreeMap<&str, &FrameResult> = after.frames.iter().map(|f| (f.name.as_str(), f)).collect();
        for frame in before.frames.iter().filter(|frame| frame.score.is_some()) {
            let at = format!("{at} / {}", frame.name);
            let Some(other) = named.get(frame.name.as_str()).filter(|other| other.score.is_some()) else {
                self.lost.push(at);
                continue;
            };
            for metric in MetricId::all() {
                if let (Some(a), Some(b)) = (frame.value(metric), other.value(metric)) {
                    let moved = Move::new(at.clone(), metric, a, b, tolerances.of(metric));
                    self.frames.extend(moved);
                }
            }
        }
    }

    /// The verdict. Movements of sequences within the tolerance are dropped on the way.
    fn judge(&mut self) -> Verdict {
        let moved = !self.sequences.is_empty() || !self.frames.is_empty();
        self.sequences.retain(|m| m.tolerances.abs() > 1.0);
        if !self.lost.is_empty() || self.sequences.iter().any(|m| !m.is_better()) {
            Verdict::Worse
        } else if self.compared == 0 {
            Verdict::NothingCompared
        } else if !self.sequences.is_empty() {
            Verdict::Better
        } else if moved {
            Verdict::Within
        } else {
            Verdict::Identical
        }
    }

    /// The findings as Markdown, with at most `limit` frames.
    pub fn markdown(&self, limit: usize) -> String {
        let verdict = match self.verdict {
            Verdict::Worse => "worse",
            Verdict::NothingCompared => "nothing to compare",
            Verdict::Better => "better",
            Verdict::Within => "within tolerance",
            Verdict::Identical => "identical",
        };
        let mut text =
            format!("# Comparison: {verdict}\n\n{} sequences and variants compared.\n", self.compared);
        for (title, names) in [("Lost", &self.lost), ("New", &self.gained)] {
            if !names.is_empty() {
                text += &format!("\n{title}: {}\n", names.join("; "));
            }
        }
        let frames = &self.frames[..self.frames.len().min(limit)];
        for (title, moves) in [
            ("Sequences beyond the tolerance", self.sequences.as_slice()),
            ("Frames that moved most", frames),
        ] {
            if !moves.is_empty() {
                text += &format!(
                    "\n## {title}\n\n| where | metric | baseline | candidate | change |\n|:--|:--|--:|--:|--:|\n"
                );
                text += &moves.iter().map(row).collect::<String>();
            }
        }
        text
    }
}

fn row(m: &Move) -> String {
    let Move { at, metric, baseline, candidate, .. } = m;
    let direction = if m.is_better() { "better" } else { "worse" };
    let change = candidate - baseline;
    format!("| {at} | {} | {baseline:.6} | {candidate:.6} | {change:+.3e} ({direction}) |\n", metric.title())
}
