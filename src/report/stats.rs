//! Paired comparison of two variants frame by frame: mean difference, an interval, how often one wins.
//!
//! Frames of a sequence follow each other and their errors with them, so drawing single frames would give intervals that
//! are too narrow. A circular moving-block bootstrap draws stretches of consecutive frames instead (Politis and Romano
//! 1992), of length `round(n^(1/3))`, at least 2 where n allows. Both variants share the drawn frames: the differences
//! are paired. The generator is SplitMix64 with a fixed seed, so the same frames give the same interval everywhere.

use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;

/// Resamples behind an interval.
pub const RESAMPLES: usize = 2000;

/// Seed of the generator.
pub const SEED: u64 = 0x5EED_0F0A_F2A3_E501;

/// How two variants differ in one metric.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paired {
    /// Mean of candidate minus baseline; of several sequences, the mean of their means.
    pub mean: f64,
    /// 95 % interval of that mean; none from fewer than 5 frames, which say too little.
    pub interval: Option<[f64; 2]>,
    /// Share of the frames in which the candidate is better; a tie counts half.
    pub win_rate: f64,
    /// Frames.
    pub frames: usize,
}

/// Fewest frames for which an interval is given.
const FEWEST: usize = 5;

/// Compares a candidate with a baseline, given their differences (candidate minus baseline) per frame in order, one
/// list per sequence. Sequences count equally in the mean, frames in the win rate; blocks stay inside a sequence.
///
/// None if there is no frame or a difference is not finite.
pub fn paired(sequences: &[Vec<f64>], higher_is_better: bool) -> Option<Paired> {
    let sequences: Vec<&[f64]> = sequences.iter().map(Vec::as_slice).filter(|s| !s.is_empty()).collect();
    let all = || sequences.iter().flat_map(|sequence| sequence.iter().copied());
    let frames = all().count();
    if frames == 0 || all().any(|d| !d.is_finite()) {
        return None;
    }
    let wins = |d: f64| match d {
        0.0 => 0.5,
        d if (d > 0.0) == higher_is_better => 1.0,
        _ => 0.0,
    };
    let mean_of_means = |means: &[f64]| means.iter().sum::<f64>() / means.len() as f64;
    let means: Vec<f64> = sequences.iter().map(|s| s.iter().sum::<f64>() / s.len() as f64).collect();
    let interval = (frames >= FEWEST).then(|| {
        let mut random = SplitMix64::new(SEED);
        let mut draw = || {
            let means: Vec<f64> = sequences.iter().map(|s| resampled_mean(s, &mut random)).collect();
            mean_of_means(&means)
        };
        let mut resamples: Vec<f64> = (0..RESAMPLES).map(|_| draw()).collect();
        resamples.sort_by(f64::total_cmp);
        [quantile(&resamples, 0.025), quantile(&resamples, 0.975)]
    });
    let win_rate = all().map(wins).sum::<f64>() / frames as f64;
    Some(Paired { mean: mean_of_means(&means), interval, win_rate, frames })
}

/// Length of the blocks for a sequence of n frames.
fn block_length(n: usize) -> usize {
    (portable::cbrt(n as f64).round() as usize).max(2).min(n)
}

/// The mean of as many values as there are, drawn in blocks that wrap around the end.
fn resampled_mean(values: &[f64], random: &mut SplitMix64) -> f64 {
    let n = values.len();
    let block = block_length(n);
    let mut sum = 0.0;
    let mut drawn = 0;
    while drawn < n {
        let start = random.below(n);
        let length = block.min(n - drawn);
        sum += (0..length).map(|i| values[(start + i) % n]).sum::<f64>();
        drawn += length;
    }
    sum / n as f64
}

/// The quantile of sorted values, linear between neighbours.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let position = p * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::{prop_assert, prop_assert_eq, proptest};

    #[test]
    fn constant_differences_have_a_point_interval() {
        let paired = paired(&[vec![0.25; 12]], true).expect("finite");
        assert_eq!(paired, Paired { mean: 0.25, interval: Some([0.25, 0.25]), win_rate: 1.0, frames: 12 });
        let lower = super::paired(&[vec![0.25; 12]], false).expect("finite");
        assert_eq!(lower.win_rate, 0.0);
    }

    #[test]
    fn sequences_count_equally_and_ties_count_half() {
        let paired = paired(&[vec![1.0; 30], vec![-1.0, 0.0]], true).expect("finite");
        assert_eq!(paired.mean, 0.25);
        assert_eq!(paired.win_rate, (30.0 + 0.5) / 32.0);
    }

    #[test]
    fn what_cannot_be_compared_is_not() {
        assert_eq!(paired(&[], true), None);
        assert_eq!(paired(&[vec![]], true), None);
        assert_eq!(paired(&[vec![1.0, f64::INFINITY]], true), None);
        assert_eq!(paired(&[vec![f64::NAN]], true), None);
        assert_eq!(paired(&[vec![1.0; 4]], true).expect("finite").interval, None);
    }

    /// Blocks make the interval of correlated frames wider than drawing single frames would.
    #[test]
    fn correlated_frames_widen_the_interval() {
        let smooth: Vec<f64> = (0..64).map(|i| portable::sin(f64::from(i) * 0.2)).collect();
        let shuffled: Vec<f64> = (0..64).map(|i| smooth[(i * 37) % 64]).collect();
        let width = |values: &[f64]| {
            let [low, high] =
                paired(&[values.to_vec()], true).expect("finite").interval.expect("enough frames");
            high - low
        };
        assert!(width(&smooth) > 1.4 * width(&shuffled), "{} {}", width(&smooth), width(&shuffled));
    }

    proptest! {
        #[test]
        fn the_interval_lies_among_the_values(values in proptest::collection::vec(-5.0..5.0_f64, 5..40)) {
            let paired = paired(std::slice::from_ref(&values), true).expect("finite");
            let [low, high] = paired.interval.expect("enough frames");
            let min = values.iter().copied().fold(f64::INFINITY, f64::min);
            let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(min - 1e-12 <= low && low <= high && high <= max + 1e-12);
            prop_assert_eq!(super::paired(&[values], true), Some(paired));
        }
    }
}
