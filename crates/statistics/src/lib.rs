#![doc = include_str!("../README.md")]

mod autocorrelation;
mod estimate;
mod interval;
mod series;
mod student;
mod verdict;

pub use estimate::{Estimate, estimate};
pub use interval::{Covers, FEWEST_FRAMES, FEWEST_SEEDS, FEWEST_STEPS, Interval};
pub use series::{Error, Series};
pub use student::StudentT;
pub use verdict::{Judgement, Verdict};
