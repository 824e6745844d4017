//! What is wrong with masks themselves, and with frames that cannot be read.

use super::bodies::Pair;
use super::findings::mean;
use super::{Finding, Kind, Seen, Shadows};
use skinsplat_data::{FrameSource, MaskReading, Sequence, frames};
use std::collections::BTreeMap;

/// Frames that cannot be read, by kind.
pub(super) fn unreadable(sequence: &Sequence, seen: &[Seen]) -> Vec<Finding> {
    let mut by_kind: BTreeMap<Kind, Vec<&str>> = BTreeMap::new();
    for problem in seen.iter().filter_map(|seen| seen.shadows.as_ref().err()) {
        by_kind.entry(problem.kind).or_default().push(&problem.text);
    }
    let finding = |(kind, texts): (Kind, Vec<&str>)| {
        let detail = format!("{} of {} frames: {}", texts.len(), seen.len(), texts[0]);
        // Labels in the place of a mask are as bad as no mask.
        Finding { spoils: true, ..Finding::new(kind, &sequence.id, detail) }
    };
    by_kind.into_iter().map(finding).collect()
}

/// Frames of which something is true; of most of them, nothing can be made of the sequence.
pub(super) fn listed(
    kind: Kind,
    sequence: &Sequence,
    all: usize,
    names: &[&str],
    what: &str,
) -> Option<Finding> {
    let first = names.first()?;
    let some = names.len();
    let finding =
        Finding::new(kind, &sequence.id, format!("{what} in {some} of {all} frames, {first} first"));
    Some(Finding { spoils: finding.spoils || 2 * some > all, ..finding })
}

/// Masks in images of which no value reaches the half, or whose values are 0 and 1 of many.
pub(super) fn dim(sequence: &Sequence, seen: &[Seen]) -> Option<Finding> {
    let mut dim = Vec::new();
    for seen in seen {
        let FrameSource::Files(files) = &sequence.frames[seen.index].source else { continue };
        let Some(mask) = files.mask.as_ref().filter(|mask| mask.reading == MaskReading::Coverage) else {
            continue;
        };
        let Ok(Some(stored)) = frames::stored_range(&mask.path) else { continue };
        if stored.largest > 0.0 && stored.largest < 0.5 * stored.full {
            dim.push((&sequence.frames[seen.index].name, stored));
        }
    }
    let (name, stored) = dim.first()?;
    // A person of whom a camera sees no more than an edge has a dim mask, but not one of 0 and 1.
    if 2 * dim.len() < seen.len() && stored.largest != 1.0 {
        return None;
    }
    let read = if stored.largest == 1.0 { "read as 0 and 1" } else { "dim where the person is" };
    let detail = format!(
        "{} of {} masks hold at most {} of {} ({name} first): {read}",
        dim.len(),
        seen.len(),
        stored.largest,
        stored.full
    );
    let spoils = stored.largest != 1.0;
    Some(Finding { spoils, ..Finding::new(Kind::MaskRange, &sequence.id, detail) })
}

/// By how much a body must overlap better what a mask leaves out.
const BETTER_OUTSIDE: f64 = 0.2;

/// Masks that mark the background, and the pairs without them.
pub(super) fn inverted<'a>(sequence: &Sequence, pairs: Vec<Pair<'a>>) -> (Vec<Pair<'a>>, Option<Finding>) {
    let inverted = |(_, shadows): &Pair<'_>| {
        let [plain, outside] = both_overlaps(shadows);
        outside > plain + BETTER_OUTSIDE && shadows.mask.share_of_border() > 0.5
    };
    let (wrong, right): (Vec<_>, Vec<_>) = pairs.into_iter().partition(inverted);
    let Some((first, _)) = wrong.first() else { return (right, None) };
    let [plain, outside] =
        [0, 1].map(|of| mean(wrong.iter().map(|(_, shadows)| both_overlaps(shadows)[of])).unwrap_or(0.0));
    let detail = format!(
        "the body overlaps what the masks leave out by {outside:.2}, the masks by {plain:.2}, in {} of {} frames, {} first",
        wrong.len(),
        wrong.len() + right.len(),
        sequence.frames[first.index].name
    );
    let finding = Finding::new(Kind::InvertedMasks, &sequence.id, detail);
    // The few that are not told as inverted in a sequence of inverted masks tell nothing.
    let right = if wrong.len() > right.len() { Vec::new() } else { right };
    (right, Some(finding))
}

/// Overlap of the body with the mask, and with what the mask leaves out.
fn both_overlaps(Shadows { mask, body, .. }: &Shadows) -> [f64; 2] {
    [body.overlap(mask), body.overlap_with_outside(mask)].map(|overlap| overlap.unwrap_or(0.0))
}

/// A mask that covers more of the image than this has no background.
const ALL: f64 = 0.98;
/// A body that covers less of it cannot be why.
const SOME: f64 = 0.8;

/// True if the mask covers the image, and the body does not.
pub(super) fn is_full(Shadows { mask, body, .. }: &Shadows) -> bool {
    let share = |area: u32| f64::from(area) / (mask.width * mask.height) as f64;
    share(mask.area) > ALL && share(body.area) < SOME
}
