//! Variants that differ in the seed of their fit alone: one row, with a mean over seeds and its spread.

use super::results::{SequenceResults, VariantResults};
use crate::experiment::Experiment;

/// One row of a table: a variant, or the repetitions of one.
pub(super) struct Group {
    /// What the table calls it.
    pub(super) label: String,
    /// Positions among a sequence's variants, in the order of the experiment's seeds.
    pub(super) members: Vec<usize>,
}

impl Group {
    /// Whether an id names one of the members, or the variant that they repeat.
    pub(super) fn is_called(&self, id: &str, experiment: &Experiment, variants: &[VariantResults]) -> bool {
        let named =
            |&member: &usize| experiment.variant(&variants[member].id).is_some_and(|v| v.is_called(id));
        self.members.iter().any(named)
    }

    /// The members on a sequence.
    pub(super) fn on<'a>(&self, sequence: &'a SequenceResults) -> Vec<&'a VariantResults> {
        self.members.iter().map(|&v| &sequence.variants[v]).collect()
    }
}

/// The rows, in the order in which their first members come.
pub(super) fn groups(experiment: &Experiment, variants: &[VariantResults]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (v, variant) in variants.iter().enumerate() {
        let replicate = experiment.variant(&variant.id).and_then(|v| v.replicate.as_ref());
        let label = replicate.map_or(&variant.label, |replicate| &replicate.label);
        match groups.iter_mut().find(|group| group.label == *label) {
            Some(group) => group.members.push(v),
            None => groups.push(Group { label: label.clone(), members: vec![v] }),
        }
    }
    groups
}

/// The sample standard deviation; none of fewer than two values, or if one is infinite.
pub(super) fn spread(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    if values.len() < 2 || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    Some((values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (n - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_that_of_a_sample() {
        assert_eq!(spread(&[1.0, 3.0]), Some(2.0_f64.sqrt()));
        assert_eq!(spread(&[2.0, 4.0, 6.0]), Some(2.0));
        assert_eq!(spread(&[2.0]), None);
        assert_eq!(spread(&[2.0, f64::INFINITY]), None);
    }
}
