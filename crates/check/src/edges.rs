//! What the edges of silhouettes tell: persons that are elsewhere than the body, or of another size.

use super::bodies::Pair;
use super::findings::{Explained, mean};
use super::zoom::{Change, overlap};
use super::{Finding, Kind, Seen, Shadows};
use glam::DVec2;
use skinsplat_data::Sequence;

/// A ratio of sizes that is told apart from clothes and rounded silhouettes.
const SIZE: f64 = 0.035;
/// Edges of silhouettes are not known better than to this, pixels.
const PIXELS: f64 = 2.5;
/// A shift that is told apart, as a share of the image's longer side.
const SHIFT: f64 = 0.02;
/// The share of what an overlap lacks that a change must make good.
const EXPLAINED: f64 = 0.4;

/// Whether the person is elsewhere than the body, by the same way in every frame.
pub(super) fn moved(sequence: &Sequence, pairs: &[Pair<'_>], whole: &[Edges]) -> Option<Explained> {
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
        "the person is {:.1} % of the image to the {} of the body and {:.1} % {} it: principal point or translation",
        100.0 * across.abs() / side,
        if across < 0.0 { "left" } else { "right" },
        100.0 * down.abs() / side,
        if down < 0.0 { "above" } else { "below" }
    );
    let change = |_: &Seen, _: &Shadows| Some(Change { size: [1.0; 2], about: [0.0; 2], by: [across, down] });
    explained(pairs, change, Finding::new(Kind::Camera, &sequence.id, detail))
}

/// Whether the person is larger than the body, and whose fault that is.
pub(super) fn sized(sequence: &Sequence, pairs: &[Pair<'_>], whole: &[Edges]) -> Option<Explained> {
    let ratio = median(whole.iter().map(Edges::ratio).collect())?;
    let height = median(whole.iter().map(|e| e.body[3] - e.body[2]).collect())?;
    if (ratio - 1.0).abs() < SIZE.max(PIXELS / height) {
        return None;
    }
    let what = format!("the person is {ratio:.3} times as large as the body");
    let by_camera = blame(whole) == Some(Kind::Camera);
    let (kind, detail) = match by_camera {
        true => (Kind::Camera, format!("{what}, about the principal point: focal length")),
        false => (Kind::WrongGenderOrModel, format!("{what}, about its middle")),
    };
    let about = |seen: &Seen, shadows: &Shadows| match by_camera {
        true => Some([seen.camera.cx, seen.camera.cy]),
        false => shadows.centres[0],
    };
    let change = |seen: &Seen, shadows: &Shadows| {
        Some(Change { size: [ratio; 2], about: about(seen, shadows)?, by: [0.0; 2] })
    };
    explained(pairs, change, Finding::new(kind, &sequence.id, detail))
}

/// A finding if the change that it names makes a good part of what the overlap lacks: edges alone are moved by whatever hides a part of the
/// person, too, and by masks that are too wide or too narrow.
fn explained(
    pairs: &[Pair<'_>],
    change: impl Fn(&Seen, &Shadows) -> Option<Change>,
    finding: Finding,
) -> Option<Explained> {
    let overlaps = pairs.iter().filter_map(|pair| {
        let changed = overlap(pair, &change(pair.0, pair.1)?)?;
        Some([pair.1.body.overlap(&pair.1.mask)?, changed])
    });
    let overlaps: Vec<[f64; 2]> = overlaps.collect();
    let [given, changed] = [0, 1].map(|of| mean(overlaps.iter().map(|pair| pair[of])));
    let (given, gain) = (given?, changed? - given?);
    (gain > EXPLAINED * (1.0 - given)).then_some(Explained { gain, finding })
}

/// Whose fault a wrong size is, if edges can tell: of the point that it leaves in its place. That is the principal point if the focal
/// length is wrong, the body's middle or its model's origin if the body is.
pub(super) fn blame(whole: &[Edges]) -> Option<Kind> {
    let ratio = median(whole.iter().map(Edges::ratio).collect())?;
    let away = |of: fn(&Edges) -> [f64; 2]| median(whole.iter().map(|e| e.residual(ratio, of(e))).collect());
    let camera = away(|e| e.principal)?;
    let body = away(|e| e.centres[0])?.min(away(|e| e.centres[1])?);
    Some(if camera < body { Kind::Camera } else { Kind::WrongGenderOrModel })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Where mask and body end, in a frame that shows both whole.
pub(super) struct Edges {
    mask: [f64; 4],
    body: [f64; 4],
    principal: [f64; 2],
    centres: [[f64; 2]; 2],
    side: f64,
}

impl Edges {
    pub(super) fn of(seen: &Seen, shadows: &Shadows) -> Option<Self> {
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
