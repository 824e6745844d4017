//! Whether masks fit the body of another gender better.

use super::{Finding, Kind, findings, look};
use rayon::prelude::*;
use skinsplat_data::Sequence;
use skinsplat_data::select::evenly_spaced;

/// Frames that are compared, at most.
const MOST: usize = 12;
/// Fewer decide nothing.
const FEWEST: usize = 4;
/// By how much the overlap must be better, in the mean over frames.
const BETTER: f64 = 0.008;
/// The same, where frames are few.
const FAR_BETTER: f64 = 0.1;

/// A finding where masks fit one of the `others` better in four frames of five: the same sequence with the body of another gender, which
/// is called so, in the place of its own. Of several the one that fits best.
pub fn of_another_gender(own: &Sequence, others: &[(&str, &Sequence)], frames: &[usize]) -> Option<Finding> {
    let found = others.iter().filter_map(|(gender, other)| fits_better([own, other], gender, frames));
    found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, finding)| finding)
}

/// The overlap with the other body, and what is said of it. None if the bodies are the same.
fn fits_better([own, other]: [&Sequence; 2], gender: &str, frames: &[usize]) -> Option<(f64, Finding)> {
    if own.body.vertices == other.body.vertices || own.frames.len() != other.frames.len() {
        return None;
    }
    let small = [own, other].map(|sequence| sequence.reduced(super::SIDE));
    let overlap = |sequence: &Sequence, index: usize| {
        let shadows = look(sequence, index).shadows.ok()?;
        shadows.body.overlap(&shadows.mask)
    };
    let frames = evenly_spaced(frames, Some(MOST));
    let pairs: Vec<[f64; 2]> = frames
        .par_iter()
        .filter_map(|&index| Some([overlap(&small[0], index)?, overlap(&small[1], index)?]))
        .collect();
    let better = pairs.iter().filter(|[own, other]| other > own).count();
    let [own_fit, other_fit] = [0, 1].map(|of| findings::mean(pairs.iter().map(|pair| pair[of])));
    let (own_fit, other_fit) = (own_fit?, other_fit?);
    let enough = pairs.len() >= FEWEST || other_fit > own_fit + FAR_BETTER;
    if !enough || 5 * better < 4 * pairs.len() || other_fit < own_fit + BETTER {
        return None;
    }
    let detail =
        format!("masks fit the {gender} body better than this one: overlap {other_fit:.3} for {own_fit:.3}");
    Some((other_fit, Finding::new(Kind::WrongGenderOrModel, &own.id, detail)))
}
