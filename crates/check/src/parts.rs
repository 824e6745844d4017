//! What is wrong with a part of a sequence: one of its cameras, some of its frames.

use super::bodies::{Bodies, Pair};
use super::findings::{explained, mean};
use super::timing::Neighbours;
use super::{Finding, Kind};
use skinsplat_data::Sequence;
use std::collections::BTreeMap;

/// By how much the overlap of a camera's frames is below that of the other cameras' before it is looked at by itself.
const WORSE: f64 = 0.08;
/// An overlap below which body and masks of a frame do not belong together, if others do by more than [`FINE`].
const BAD: f64 = 0.5;
const FINE: f64 = 0.7;
/// Of fewer frames nobody knows which are usual.
const FEWEST: usize = 4;

/// Cameras whose frames fit much worse than those of the other cameras, and the pairs of the others.
pub(super) fn cameras<'a>(
    sequence: &Sequence,
    bodies: &Bodies<'_>,
    pairs: Vec<Pair<'a>>,
) -> (Vec<Pair<'a>>, Vec<Finding>) {
    let mut by_camera: BTreeMap<usize, Vec<Pair<'a>>> = BTreeMap::new();
    for pair in &pairs {
        by_camera.entry(bodies.camera_of(pair.0)).or_default().push(*pair);
    }
    // Cameras of one frame each are one that moves; of two nobody knows which is right.
    if by_camera.len() < 3 || 3 * by_camera.len() > 2 * pairs.len() {
        return (pairs, Vec::new());
    }
    let fits =
        |pairs: &[Pair<'_>]| mean(pairs.iter().filter_map(|(_, s)| s.body.overlap(&s.mask))).unwrap_or(0.0);
    let mut means: Vec<f64> = by_camera.values().map(|pairs| fits(pairs)).collect();
    means.sort_by(f64::total_cmp);
    let usual = means[means.len() / 2];
    let (mut right, mut findings) = (Vec::new(), Vec::new());
    for own in by_camera.into_values() {
        let fit = fits(&own);
        if fit >= usual - WORSE {
            right.extend(own);
            continue;
        }
        let name = &sequence.frames[own[0].0.index].name;
        let unexplained = || {
            let detail = format!("body and masks overlap by {fit:.2}");
            Finding::new(Kind::Camera, &sequence.id, detail)
        };
        let found = explained(sequence, &Neighbours::new(sequence, bodies, &own), &own)
            .map_or_else(unexplained, |e| e.finding);
        let detail = format!("the camera of {name} alone (others overlap by {usual:.2}): {}", found.detail);
        findings.push(Finding { detail, ..found });
    }
    right.sort_by_key(|(seen, _)| seen.index);
    (right, findings)
}

/// Frames that fit badly among frames that fit.
pub(super) fn misfits(sequence: &Sequence, pairs: &[Pair<'_>]) -> Option<Finding> {
    let overlaps: Vec<(usize, f64)> =
        pairs.iter().filter_map(|(seen, s)| Some((seen.index, s.body.overlap(&s.mask)?))).collect();
    let mut sorted: Vec<f64> = overlaps.iter().map(|(_, overlap)| *overlap).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = *sorted.get(sorted.len() / 2)?;
    let bad: Vec<&(usize, f64)> = overlaps.iter().filter(|(_, overlap)| *overlap < BAD).collect();
    let (first, overlap) = bad.first()?;
    let detail = format!(
        "{} of {} frames fit no pose ({} first: overlap {overlap:.2}, {usual:.2} in the middle of all): its pose or its mask",
        bad.len(),
        overlaps.len(),
        sequence.frames[*first].name
    );
    let spoils = 4 * bad.len() > overlaps.len();
    (overlaps.len() >= FEWEST && usual > FINE)
        .then(|| Finding { spoils, ..Finding::new(Kind::FrameOffset, &sequence.id, detail) })
}
