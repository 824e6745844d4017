#![doc = include_str!("../README.md")]

mod answer;
mod blends;
mod change;
mod check;
mod convention;
mod error;
mod export;
mod fit;
mod half_floats;
mod judge;
mod manifest;
mod order;
mod pipeline;
mod report;
mod rig;
mod sample;
mod search;
mod vectors;
mod wiring;
mod words;

pub use answer::Answer;
pub use check::{Options, check};
pub use convention::{CONVENTIONS, Convention, MatrixOrder, QuaternionOrder};
pub use error::Error;
pub use export::export;
pub use report::{Judged, Report, Verdict};
pub use rig::{Cases, RIG_VERSION, Rig, RigPose};
pub use sample::{Field, Storage};

/// Every kind of bug that an answer is searched for, with a sentence on each, sorted.
pub fn kinds() -> Vec<(&'static str, String)> {
    let mut kinds: Vec<(&'static str, String)> = Vec::new();
    let changes = change::Change::all(&Convention::default())
        .into_iter()
        .map(|change| (change.kind(), change.summary()));
    let fits = fit::Fit::ALL.map(|fit| (fit.kind(), fit.summary().to_owned()));
    for (kind, summary) in changes.chain(fits) {
        if !kinds.iter().any(|(known, _)| *known == kind) {
            kinds.push((kind, summary));
        }
    }
    kinds.sort_unstable();
    kinds
}
