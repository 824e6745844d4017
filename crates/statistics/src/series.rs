//! The differences that go in, and what is wrong with them.

use std::collections::BTreeSet;

/// Differences (candidate minus baseline) of one metric, frame by frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Whose frames they are. Subjects are independent of each other.
    pub subject: String,
    /// With which seed candidate and baseline were made. All seeds of a subject see the same frames.
    pub seed: u64,
    /// Which sequence of the subject.
    pub sequence: String,
    /// In the order of the frames.
    pub values: Vec<f64>,
}

/// Differences that cannot be summed up.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No difference at all.
    #[error("differences: none; expected at least one frame")]
    Empty,
    /// Not a number, or infinite.
    #[error(
        "differences of {subject} / {sequence}, seed {seed}: frame {frame} is not finite; expected finite numbers"
    )]
    NotFinite {
        /// The subject.
        subject: String,
        /// The seed.
        seed: u64,
        /// The sequence.
        sequence: String,
        /// Position of the value.
        frame: usize,
    },
    /// Two series of one subject, seed and sequence, or seeds of a subject with other sequences or frames than each other.
    #[error(
        "differences of {subject} / {sequence}, seed {seed}: {problem}; expected the same frames once for every seed of a subject"
    )]
    Unpaired {
        /// The subject.
        subject: String,
        /// The seed.
        seed: u64,
        /// The sequence.
        sequence: String,
        /// What is wrong.
        problem: String,
    },
}

/// A subject: the sequences, each with a value per frame averaged over seeds, and the mean of each seed.
#[derive(Clone, Debug)]
pub(crate) struct Subject {
    /// Frames of each sequence, averaged over seeds.
    pub(crate) sequences: Vec<Vec<f64>>,
    /// Mean over sequences of the means over frames, per seed.
    pub(crate) seeds: Vec<f64>,
}

impl Subject {
    /// The mean over seeds, and so over sequences.
    pub(crate) fn mean(&self) -> f64 {
        mean(&self.seeds)
    }
}

/// The mean of at least one value.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Groups series by subject, in order of first appearance. Series without frames count for nothing.
pub(crate) fn subjects(series: &[Series]) -> Result<Vec<Subject>, Error> {
    let series: Vec<&Series> = series.iter().filter(|one| !one.values.is_empty()).collect();
    if series.is_empty() {
        return Err(Error::Empty);
    }
    if let Some((one, frame)) = series.iter().find_map(|one| Some((one, not_finite(&one.values)?))) {
        let (subject, seed, sequence) = (one.subject.clone(), one.seed, one.sequence.clone());
        return Err(Error::NotFinite { subject, seed, sequence, frame });
    }
    let names = in_order(series.iter().map(|one| one.subject.as_str()));
    names.iter().map(|name| subject(name, &series)).collect()
}

fn not_finite(values: &[f64]) -> Option<usize> {
    values.iter().position(|value| !value.is_finite())
}

/// Each once, in order of first appearance.
fn in_order<T: Ord + Copy>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = BTreeSet::new();
    items.filter(|item| seen.insert(*item)).collect()
}

fn subject(name: &str, series: &[&Series]) -> Result<Subject, Error> {
    let own: Vec<&Series> = series.iter().copied().filter(|one| one.subject == name).collect();
    let seeds = in_order(own.iter().map(|one| one.seed));
    let mut sequences = Vec::new();
    let mut by_seed = vec![Vec::new(); seeds.len()];
    for sequence in in_order(own.iter().map(|one| one.sequence.as_str())) {
        let unpaired = |seed: u64, problem: String| {
            Err(Error::Unpaired { subject: name.into(), seed, sequence: sequence.into(), problem })
        };
        let mut of_seeds: Vec<&[f64]> = Vec::new();
        for (&seed, means) in seeds.iter().zip(&mut by_seed) {
            let found = own.iter().filter(|one| one.seed == seed && one.sequence == sequence);
            let found: Vec<&[f64]> = found.map(|one| one.values.as_slice()).collect();
            let [values] = found[..] else { return unpaired(seed, format!("{} series", found.len())) };
            let frames = of_seeds.first().map_or(values.len(), |first| first.len());
            if values.len() != frames {
                return unpaired(seed, format!("{} frames where another seed has {frames}", values.len()));
            }
            means.push(mean(values));
            of_seeds.push(values);
        }
        let frame = |f: usize| of_seeds.iter().map(|values| values[f]).sum::<f64>() / of_seeds.len() as f64;
        sequences.push((0..of_seeds[0].len()).map(frame).collect());
    }
    Ok(Subject { sequences, seeds: by_seed.iter().map(|means| mean(means)).collect() })
}
