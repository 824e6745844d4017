//! Frames with a given dependence, whose mean is 0, and how often intervals hold it.

use skinsplat_core::math::portable::{cos, ln};
use skinsplat_core::math::random::SplitMix64;
use skinsplat_statistics::{Interval, Series, estimate};

/// Frames of the sequences of a subject.
pub(crate) const SEQUENCES: [&[usize]; 4] = [&[5, 5], &[5, 5, 5], &[10, 30], &[20, 20]];

/// A number of the standard normal distribution (Box and Muller 1958).
fn normal(random: &mut SplitMix64) -> f64 {
    let mut unit = || ((random.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    (-2.0 * ln(unit())).sqrt() * cos(2.0 * std::f64::consts::PI * unit())
}

/// A stationary first-order autoregression of mean 0 and variance 1.
fn autoregression(random: &mut SplitMix64, n: usize, rho: f64) -> Vec<f64> {
    let fresh = (1.0 - rho * rho).sqrt();
    let mut value = normal(random);
    let step = |i: usize| {
        if i > 0 {
            value = rho * value + fresh * normal(random);
        }
        value
    };
    (0..n).map(step).collect()
}

/// What is simulated: the truth is 0.
#[derive(Clone)]
pub(crate) struct Design {
    pub(crate) subjects: usize,
    pub(crate) seeds: usize,
    /// Frames of each sequence.
    pub(crate) frames: Vec<usize>,
    pub(crate) rho: f64,
    /// Standard deviations between subjects, between seeds, and of frames of one seed beside those that all share.
    pub(crate) between: [f64; 3],
}

impl Design {
    pub(crate) fn of_frames(n: usize, rho: f64) -> Self {
        Self { subjects: 1, seeds: 1, frames: vec![n], rho, between: [0.0; 3] }
    }

    pub(crate) fn draw(&self, random: &mut SplitMix64) -> Vec<Series> {
        let [subject_sd, seed_sd, own_sd] = self.between;
        let mut all = Vec::new();
        for subject in 0..self.subjects {
            let of_subject = subject_sd * normal(random);
            let of_seeds: Vec<f64> = (0..self.seeds).map(|_| seed_sd * normal(random)).collect();
            for (s, &n) in self.frames.iter().enumerate() {
                let shared = autoregression(random, n, self.rho);
                for (seed, of_seed) in of_seeds.iter().enumerate() {
                    let own = autoregression(random, n, self.rho);
                    let value =
                        |(a, b): (&f64, &f64)| (1.0 + s as f64) * (a + own_sd * b) + of_subject + of_seed;
                    all.push(Series {
                        subject: subject.to_string(),
                        seed: seed as u64,
                        sequence: s.to_string(),
                        values: shared.iter().zip(&own).map(value).collect(),
                    });
                }
            }
        }
        all
    }

    /// Percent of the given intervals that hold 0; none if none was given.
    pub(crate) fn coverage(&self, repetitions: u64) -> Option<f64> {
        let interval = |seed: u64| -> Option<Interval> {
            estimate(&self.draw(&mut SplitMix64::new(seed.wrapping_mul(0x9E37_79B9) + 11)), true)
                .expect("series of numbers")
                .interval
        };
        let given: Vec<Interval> = (0..repetitions).filter_map(interval).collect();
        let holding = given.iter().filter(|interval| interval.low <= 0.0 && 0.0 <= interval.high).count();
        (!given.is_empty()).then(|| 100.0 * holding as f64 / given.len() as f64)
    }
}
