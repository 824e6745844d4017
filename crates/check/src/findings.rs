//! What overlaps of silhouettes tell about the data.

use super::{Finding, Kind, Seen, Shadows, lens, zoom};
use glam::DVec2;
use skinsplat_data::{FrameSource, MaskReading, Sequence, frames};
use std::collections::BTreeMap;

/// Everything that is wrong with a sequence.
pub(super) fn of(sequence: &Sequence, seen: &[Seen]) -> Vec<Finding> {
    let mut found = unreadable(sequence, seen);
    let usable: Vec<(&Seen, &Shadows)> =
        seen.iter().filter_map(|seen| Some((seen, seen.shadows.as_ref().ok()?))).collect();
    let name = |seen: &Seen| sequence.frames[seen.index].name.as_str();
    let named = |test: &dyn Fn(&Shadows) -> bool| -> Vec<&str> {
        usable.iter().filter(|(_, shadows)| test(shadows)).map(|(seen, _)| name(seen)).collect()
    };
    found.extend(listed(
        Kind::EmptyMask,
        sequence,
        seen.len(),
        &named(&|shadows| shadows.mask.area == 0),
        "no pixel of the mask",
    ));
    found.extend(listed(
        Kind::BodyOutOfView,
        sequence,
        seen.len(),
        &named(&|shadows| shadows.body.area == 0),
        "the camera does not see the body",
    ));
    found.extend(dim_masks(sequence, seen));
    found.extend(far_principal_point(sequence, &usable));
    let both: Vec<(&Seen, &Shadows)> =
        usable.into_iter().filter(|(_, shadows)| shadows.mask.area > 0 && shadows.body.area > 0).collect();
    let plain = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)));
    let outside = mean(both.iter().filter_map(|(_, s)| s.body.overlap_with_outside(&s.mask)));
    if let (Some(plain), Some(outside)) = (plain, outside)
        && outside > plain + 0.2
        && mean(both.iter().map(|(_, s)| s.mask.share_of_border())).is_some_and(|share| share > 0.5)
    {
        let detail =
            format!("the body overlaps what the masks leave out by {outside:.2}, the masks by {plain:.2}");
        found.push(Finding::new(Kind::InvertedMasks, &sequence.id, detail));
        return found;
    }
    let whole: Vec<Edges> = both.iter().filter_map(|(seen, shadows)| Edges::of(seen, shadows)).collect();
    let finding = moved(sequence, &whole).or_else(|| order(sequence, &both));
    let finding = finding.or_else(|| zoom::far_off(sequence, &both, blame(&whole)));
    let finding = finding.or_else(|| lens::bent(sequence, &both));
    found.extend(finding.or_else(|| sized(sequence, &whole)));
    if !found.iter().any(|finding| finding.spoils) {
        found.extend(zoom::unexplained(sequence, &both));
    }
    found
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Frames that cannot be read, by kind.
fn unreadable(sequence: &Sequence, seen: &[Seen]) -> Vec<Finding> {
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
fn listed(kind: Kind, sequence: &Sequence, all: usize, names: &[&str], what: &str) -> Option<Finding> {
    let first = names.first()?;
    let some = names.len();
    let finding =
        Finding::new(kind, &sequence.id, format!("{what} in {some} of {all} frames, {first} first"));
    Some(Finding { spoils: finding.spoils || 2 * some > all, ..finding })
}

/// Masks in images of which no value reaches the half, or whose values are 0 and 1 of many.
fn dim_masks(sequence: &Sequence, seen: &[Seen]) -> Option<Finding> {
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
    // A person of whom a camera sees no more than an edge has a dim mask.
    if 2 * dim.len() < seen.len() {
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

/// Frames that are compared with one another, at most.
const MOST: usize = 160;
/// By how much the overlap must be better for other frames' poses.
const BETTER: f64 = 0.03;

/// Whether the poses of other frames fit better: by a shift, or in another order.
fn order(sequence: &Sequence, both: &[(&Seen, &Shadows)]) -> Option<Finding> {
    let mut by_camera: BTreeMap<usize, Vec<(&Seen, &Shadows)>> = BTreeMap::new();
    for &(seen, shadows) in both {
        by_camera.entry(sequence.frames[seen.index].camera).or_default().push((seen, shadows));
    }
    let one = by_camera.into_values().max_by_key(Vec::len)?;
    let one = &one[..one.len().min(MOST)];
    let n = one.len();
    if n < 4 {
        return None;
    }
    // Of the bodies, only those under one camera can be compared with any mask.
    let overlap = |body: usize, mask: usize| one[body].1.body.overlap(&one[mask].1.mask).unwrap_or(0.0);
    let own = mean((0..n).map(|i| overlap(i, i)))?;
    let shifted = |shift: isize| {
        let pairs = (0..n).filter_map(|i| Some((i.checked_add_signed(shift).filter(|&j| j < n)?, i)));
        mean(pairs.map(|(body, mask)| overlap(body, mask)))
    };
    let reach = (n as isize - 3).min(40);
    let best = (-reach..=reach).filter(|&s| s != 0).filter_map(|s| Some((s, shifted(s)?)));
    let (shift, shifted) = best.max_by(|a, b| a.1.total_cmp(&b.1))?;
    if shifted > own + BETTER {
        let name = |i: usize| &sequence.frames[one[i].0.index].name;
        let (frame, other) = if shift > 0 { (0, shift as usize) } else { (shift.unsigned_abs(), 0) };
        let detail = format!(
            "poses are {} frames {} (overlap {shifted:.2} for {own:.2}): {} has the pose of {}",
            shift.abs(),
            if shift > 0 { "late" } else { "early" },
            name(other),
            name(frame),
        );
        return Some(Finding::new(Kind::FrameOffset, &sequence.id, detail));
    }
    let best =
        |mask: usize| (0..n).map(|body| (body, overlap(body, mask))).max_by(|a, b| a.1.total_cmp(&b.1));
    let matches: Vec<(usize, f64)> = (0..n).filter_map(best).collect();
    let gained = mean(matches.iter().map(|&(_, overlap)| overlap))? - own;
    let moved = matches
        .iter()
        .enumerate()
        .filter(|&(mask, &(body, best))| body != mask && best > overlap(mask, mask) + BETTER);
    let moved: Vec<(usize, usize)> = moved.map(|(mask, &(body, _))| (mask, body)).collect();
    let distinct = moved.iter().map(|&(_, body)| body).collect::<std::collections::BTreeSet<_>>().len();
    // Poses that are merely wrong fit others by chance, and many of them the same one.
    if gained < BETTER || 10 * moved.len() < 3 * n || 10 * distinct < 6 * moved.len() {
        return None;
    }
    let (mask, body) = moved[0];
    let name = |i: usize| &sequence.frames[one[i].0.index].name;
    let detail = format!(
        "{} of {n} frames fit the poses of others, in another order (overlap {:.2} for {own:.2}): {} that of {}",
        moved.len(),
        own + gained,
        name(mask),
        name(body)
    );
    Some(Finding::new(Kind::FrameOffset, &sequence.id, detail))
}

/// A ratio of sizes that is told apart from clothes and rounded silhouettes.
const SIZE: f64 = 0.035;
/// Edges of silhouettes are not known better than to this, pixels.
const PIXELS: f64 = 2.5;
/// A shift that is told apart, as a share of the image's longer side.
const SHIFT: f64 = 0.02;

/// Whether the person is elsewhere than the body, by the same way in every frame.
fn moved(sequence: &Sequence, whole: &[Edges]) -> Option<Finding> {
    let side = whole.first()?.side;
    let shifts = |axis: usize| whole.iter().map(|e| e.shift(axis)).collect::<Vec<f64>>();
    let across = median(shifts(0))?;
    let down = median(shifts(1))?;
    let length = DVec2::new(across, down).length();
    let away = |e: &Edges| DVec2::new(e.shift(0) - across, e.shift(1) - down).length();
    if length < (SHIFT * side).max(PIXELS) || median(whole.iter().map(away).collect())? > 0.35 * length {
        return None;
    }
    let detail = format!(
        "the person is {:.1} % of the image to the side of the body and {:.1} % below it: principal point or translation",
        100.0 * across / side,
        100.0 * down / side
    );
    Some(Finding::new(Kind::Camera, &sequence.id, detail))
}

/// Whether the person is larger than the body, and whose fault that is.
fn sized(sequence: &Sequence, whole: &[Edges]) -> Option<Finding> {
    let ratio = median(whole.iter().map(Edges::ratio).collect())?;
    let height = median(whole.iter().map(|e| e.body[3] - e.body[2]).collect())?;
    if (ratio - 1.0).abs() < SIZE.max(PIXELS / height) {
        return None;
    }
    let what = format!("the person is {ratio:.3} times as large as the body");
    Some(if blame(whole) == Some(Kind::Camera) {
        Finding::new(Kind::Camera, &sequence.id, format!("{what}, about the principal point: focal length"))
    } else {
        Finding::new(Kind::WrongGenderOrModel, &sequence.id, format!("{what}, about its middle"))
    })
}

/// Whose fault a wrong size is, if edges can tell: of the point that it leaves in its place. That is the principal point if the focal
/// length is wrong, the body's middle or its model's origin if the body is.
fn blame(whole: &[Edges]) -> Option<Kind> {
    let ratio = median(whole.iter().map(Edges::ratio).collect())?;
    let away = |of: fn(&Edges) -> [f64; 2]| median(whole.iter().map(|e| e.residual(ratio, of(e))).collect());
    let camera = away(|e| e.principal)?;
    let body = away(|e| e.centres[0])?.min(away(|e| e.centres[1])?);
    Some(if camera < body { Kind::Camera } else { Kind::WrongGenderOrModel })
}

/// Where mask and body end, in a frame that shows both whole.
struct Edges {
    mask: [f64; 4],
    body: [f64; 4],
    principal: [f64; 2],
    centres: [[f64; 2]; 2],
    side: f64,
}

impl Edges {
    fn of(seen: &Seen, shadows: &Shadows) -> Option<Self> {
        if shadows.mask.is_cut() || shadows.body.is_cut() {
            return None;
        }
        let camera = &seen.camera;
        Some(Self {
            mask: shadows.mask.bounds()?,
            body: shadows.body.bounds()?,
            principal: [camera.cx, camera.cy],
            centres: [shadows.centres[0]?, shadows.centres[1]?],
            side: f64::from(camera.width.max(camera.height)),
        })
    }

    /// Height of the mask over that of the body: clothes widen more than they lengthen.
    fn ratio(&self) -> f64 {
        (self.mask[3] - self.mask[2]) / (self.body[3] - self.body[2])
    }

    /// From the middle of the body to that of the mask along an axis, pixels.
    fn shift(&self, axis: usize) -> f64 {
        let middle = |b: &[f64; 4]| 0.5 * (b[2 * axis] + b[2 * axis + 1]);
        middle(&self.mask) - middle(&self.body)
    }

    /// How far the mask's edges are from those of the body scaled about a point, pixels.
    fn residual(&self, ratio: f64, about: [f64; 2]) -> f64 {
        let edge = |i: usize| {
            let point = about[i / 2];
            (self.mask[i] - (point + ratio * (self.body[i] - point))).abs()
        };
        (0..4).map(edge).sum()
    }
}
