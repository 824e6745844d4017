//! What overlaps of silhouettes tell about the data.

use super::bodies::{Bodies, Pair};
use super::edges::{self, Edges};
use super::timing::Neighbours;
use super::{Finding, Kind, Seen, Shadows, lens, masks, parts, zoom};
use skinsplat_data::Sequence;

/// What is wrong, if a single change makes body and masks meet better.
pub(super) struct Explained {
    /// What the overlap gains by the change, in the mean over frames.
    pub(super) gain: f64,
    pub(super) finding: Finding,
}

/// Everything that is wrong with a sequence, which `small` is at the resolution of what was seen.
pub(super) fn of(sequence: &Sequence, small: &Sequence, seen: &[Seen]) -> Vec<Finding> {
    let mut found = masks::unreadable(sequence, seen);
    let usable: Vec<Pair<'_>> =
        seen.iter().filter_map(|seen| Some((seen, seen.shadows.as_ref().ok()?))).collect();
    let mut listed = |kind: Kind, test: &dyn Fn(&Shadows) -> bool, what: &str| {
        let of = usable.iter().filter(|(_, shadows)| test(shadows));
        let names: Vec<&str> = of.map(|(seen, _)| sequence.frames[seen.index].name.as_str()).collect();
        found.extend(masks::listed(kind, sequence, seen.len(), &names, what));
    };
    listed(Kind::EmptyMask, &|shadows| shadows.mask.area == 0, "no pixel of the mask");
    listed(Kind::MaskRange, &masks::is_full, "the mask covers the image");
    listed(Kind::BodyOutOfView, &|shadows| shadows.body.area == 0, "the camera does not see the body");
    found.extend(masks::dim(sequence, seen));
    found.extend(far_principal_point(sequence, &usable));
    let telling = |s: &Shadows| s.mask.area > 0 && s.body.area > 0 && !masks::is_full(s);
    let both = usable.into_iter().filter(|(_, shadows)| telling(shadows)).collect();
    let (both, inverted) = masks::inverted(sequence, both);
    found.extend(inverted);
    let bodies = Bodies::new(small);
    let (both, of_cameras) = parts::cameras(sequence, &bodies, both);
    found.extend(of_cameras);
    let neighbours = Neighbours::new(sequence, &bodies, &both);
    match explained(sequence, &neighbours, &both) {
        Some(explained) => found.push(explained.finding),
        None => found.extend(of_parts(sequence, &neighbours, &both)),
    }
    if !found.iter().any(|finding| finding.spoils) {
        found.extend(zoom::unexplained(sequence, &both));
    }
    found
}

/// The change under which body and masks meet best.
pub(super) fn explained(
    sequence: &Sequence,
    neighbours: &Neighbours<'_>,
    pairs: &[Pair<'_>],
) -> Option<Explained> {
    let whole: Vec<Edges> = pairs.iter().filter_map(|(seen, shadows)| Edges::of(seen, shadows)).collect();
    let changes = [
        edges::moved(sequence, pairs, &whole),
        neighbours.explained(),
        zoom::far_off(sequence, pairs, edges::blame(&whole)),
        zoom::stretched(sequence, pairs),
        lens::bent(sequence, pairs),
        edges::sized(sequence, pairs, &whole),
    ];
    changes.into_iter().flatten().max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// What is wrong with some of the frames.
fn of_parts(sequence: &Sequence, neighbours: &Neighbours<'_>, pairs: &[Pair<'_>]) -> Option<Finding> {
    neighbours.strangers().or_else(|| parts::misfits(sequence, pairs))
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// How far from the middle a principal point is not expected, as a share of the side.
const OFF_CENTRE: f64 = 0.25;
/// An overlap below which the body is somewhere else.
const ELSEWHERE: f64 = 0.5;

/// A principal point far from the middle of the image, of cameras under which body and masks do not meet. Pictures that were
/// cut out of others have such points too: there they meet.
fn far_principal_point(sequence: &Sequence, usable: &[(&Seen, &Shadows)]) -> Option<Finding> {
    let off = |at: f64, side: u32| (at / f64::from(side) - 0.5).abs();
    let far = |seen: &Seen| {
        let camera = &seen.camera;
        off(camera.cx, camera.width).max(off(camera.cy, camera.height)) > OFF_CENTRE
    };
    let far: Vec<&(&Seen, &Shadows)> = usable.iter().filter(|(seen, _)| far(seen)).collect();
    let first = far.first()?;
    let met = mean(far.iter().map(|(_, s)| s.body.overlap(&s.mask).unwrap_or(0.0)))?;
    let camera = &sequence.cameras[sequence.frames[first.0.index].camera];
    let detail = format!(
        "principal point ({:.1}, {:.1}) of images of {}x{}, where body and masks overlap by {met:.2}",
        camera.cx, camera.cy, camera.width, camera.height
    );
    (met < ELSEWHERE).then(|| Finding::new(Kind::Camera, &sequence.id, detail))
}
