//! Two rows of a table compared frame by frame: the series of their differences, and what they come to.

use super::replicates::{Group, spread};
use super::results::SequenceResults;
use crate::experiment::{Experiment, Shown};
use skinsplat_statistics::{Estimate, Judgement, Series, estimate};

/// A row and the row that it is compared with.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) candidate: &'a Group,
    pub(super) baseline: &'a Group,
}

impl Pair<'_> {
    /// Whether both compare the same rows.
    pub(super) fn is(&self, other: &Pair<'_>) -> bool {
        self.candidate.label == other.candidate.label && self.baseline.label == other.baseline.label
    }

    /// (candidate, baseline) per seed, as positions among a sequence's variants; a row without seeds is compared with every one
    /// of the other's.
    fn members(self) -> Vec<(usize, usize)> {
        let of = |group: &Group, i: usize| group.members[i.min(group.members.len() - 1)];
        let seeds = self.candidate.members.len().max(self.baseline.members.len());
        (0..seeds).map(|i| (of(self.candidate, i), of(self.baseline, i))).collect()
    }

    /// What the differences in a metric come to over these sequences; none if no frame has both or one is infinite.
    pub(super) fn estimate(self, over: &[SequenceResults], shown: Shown) -> Option<Estimate> {
        estimate(&series(over, &self.members(), shown), shown.metric.higher_is_better()).ok()
    }

    /// The estimate with what it decides.
    pub(super) fn judged(
        self,
        experiment: &Experiment,
        over: &[SequenceResults],
        shown: Shown,
    ) -> Option<(Estimate, Judgement)> {
        let found = self.estimate(over, shown)?;
        let margin = experiment.margin(shown.metric);
        Some((found, Judgement::new(&found, margin, shown.metric.higher_is_better())))
    }

    /// Standard deviation of the mean difference over seeds; none from fewer than two.
    pub(super) fn over_seeds(self, over: &[SequenceResults], shown: Shown) -> Option<f64> {
        let mean = |member: (usize, usize)| {
            Some(estimate(&series(over, &[member], shown), shown.metric.higher_is_better()).ok()?.mean)
        };
        spread(&self.members().into_iter().map(mean).collect::<Option<Vec<f64>>>()?)
    }
}

/// Candidate minus baseline, a series per sequence and seed, of the frames that every seed has of both.
fn series(over: &[SequenceResults], members: &[(usize, usize)], shown: Shown) -> Vec<Series> {
    let mut all = Vec::new();
    for sequence in over {
        let difference = |(candidate, baseline): (usize, usize), frame: usize| {
            let value = |variant: usize| sequence.variants[variant].frames[frame].value(shown);
            Some(value(candidate)? - value(baseline)?)
        };
        let frames = 0..sequence.variants[members[0].0].frames.len();
        let of_frame =
            |frame: usize| members.iter().map(|&m| difference(m, frame)).collect::<Option<Vec<f64>>>();
        let frames: Vec<Vec<f64>> = frames.filter_map(of_frame).collect();
        let of_seed = |seed: usize| Series {
            subject: subject(&sequence.id).to_owned(),
            seed: seed as u64,
            sequence: sequence.id.clone(),
            values: frames.iter().map(|frame| frame[seed]).collect(),
        };
        all.extend((0..members.len()).map(of_seed));
    }
    all
}

/// `dataset/subject` of `dataset/subject/sequence`.
fn subject(id: &str) -> &str {
    id.match_indices('/').nth(1).map_or(id, |(end, _)| &id[..end])
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_subject_is_one_of_its_data_set() {
        assert_eq!(super::subject("people/anna/test/b"), "people/anna");
        assert_eq!(super::subject("people/anna"), "people/anna");
    }
}
