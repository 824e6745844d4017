//! Focal lengths and sizes that are off by more than silhouettes inside the image can tell, and overlaps that nothing explains.

use super::bodies::Pair;
use super::findings::{Explained, mean};
use super::{Finding, Kind, Seen, Shadows};
use skinsplat_data::Sequence;

/// Focal lengths that are tried, over the one that is given.
const ZOOMS: [f64; 16] =
    [0.25, 0.33, 0.4, 0.5, 0.6, 0.67, 0.75, 0.82, 0.9, 1.1, 1.22, 1.33, 1.5, 2.0, 2.5, 3.0];
/// Those near the best of them, over it.
const FINER: [f64; 9] = [0.92, 0.94, 0.96, 0.98, 1.0, 1.02, 1.04, 1.06, 1.08];
/// Frames that are compared, at most.
const MOST: usize = 12;
/// Columns and rows that are looked at, at most.
const LINES: usize = 128;
/// By how much the overlap must be better for another focal length.
const BETTER: f64 = 0.15;
/// An overlap at which body and masks are of one person in one pose.
const FITS: f64 = 0.6;

/// Sizes that a body may have in the place of another: beyond, it is the camera.
const SIZES: std::ops::Range<f64> = 0.6..1.6;

/// By how much one of two overlaps must be better to decide; else edges do.
const CLEAR: f64 = 0.005;

/// A finding where masks fit far better under another focal length, or with a body of another size: whichever fits better, or,
/// where both fit as well, whichever edges blame.
pub(super) fn far_off(sequence: &Sequence, both: &[Pair<'_>], to_blame: Option<Kind>) -> Option<Explained> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let step = both.len().div_ceil(MOST).max(1);
    let best = |about: fn(&Seen, &Shadows) -> Option<[f64; 2]>| {
        let zoomed = |zoom: f64| {
            let pairs = both.iter().step_by(step);
            let change = |pair: &Pair<'_>| {
                Some(Change { size: [zoom; 2], about: about(pair.0, pair.1)?, by: [0.0; 2] })
            };
            Some((zoom, mean(pairs.filter_map(|pair| overlap(pair, &change(pair)?)))?))
        };
        let of = |zooms: &mut dyn Iterator<Item = f64>| {
            zooms.filter_map(zoomed).max_by(|a: &(f64, f64), b| a.1.total_cmp(&b.1))
        };
        let (zoom, _) = of(&mut ZOOMS.into_iter())?;
        of(&mut FINER.into_iter().map(|factor| zoom * factor))
    };
    let (zoom, fit) = best(|seen, _| Some([seen.camera.cx, seen.camera.cy]))?;
    let sizes = [best(|_, shadows| shadows.centres[0]), best(|_, shadows| shadows.centres[1])];
    let plausible = sizes.into_iter().flatten().filter(|(size, _)| SIZES.contains(size));
    let body = plausible.max_by(|a, b| a.1.total_cmp(&b.1));
    let far = |fit: f64| fit > given + BETTER && fit > FITS;
    let of_camera = |by_size: f64| match to_blame {
        Some(kind) if (fit - by_size).abs() < CLEAR => kind == Kind::Camera,
        _ => fit > by_size,
    };
    match body {
        Some((size, by_size)) if far(by_size) && !of_camera(by_size) => {
            let detail = format!(
                "body and masks overlap by {by_size:.2} for {given:.2} with a body of about {size:.2} times the size: scale, shape or \
                 model"
            );
            let finding = Finding::new(Kind::WrongGenderOrModel, &sequence.id, detail);
            Some(Explained { gain: by_size - given, finding })
        }
        _ => far(fit).then(|| {
            let detail = format!(
                "body and masks overlap by {fit:.2} for {given:.2} with about {zoom:.2} times the focal length: focal length, or \
                 scale and translation"
            );
            Explained { gain: fit - given, finding: Finding::new(Kind::Camera, &sequence.id, detail) }
        }),
    }
}

/// Ratios of focal lengths that are tried, over the one that is given.
const STRETCHES: [f64; 8] = [0.75, 0.8, 0.85, 0.9, 1.11, 1.18, 1.25, 1.33];

/// A finding where masks fit far better under another horizontal or vertical focal length.
pub(super) fn stretched(sequence: &Sequence, both: &[Pair<'_>]) -> Option<Explained> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let step = both.len().div_ceil(MOST).max(1);
    let fit = |size: [f64; 2]| {
        let change = |seen: &Seen| Change { size, about: [seen.camera.cx, seen.camera.cy], by: [0.0; 2] };
        mean(both.iter().step_by(step).filter_map(|pair| overlap(pair, &change(pair.0))))
    };
    let tried =
        STRETCHES.iter().flat_map(|&factor| [("fx", factor, [factor, 1.0]), ("fy", factor, [1.0, factor])]);
    let fits = tried.filter_map(|(which, factor, size)| Some((which, factor, fit(size)?)));
    let (which, factor, fit) = fits.max_by(|a, b| a.2.total_cmp(&b.2))?;
    let detail = format!(
        "body and masks overlap by {fit:.2} for {given:.2} with about {factor:.2} times {which}: focal length"
    );
    let finding = Finding::new(Kind::Camera, &sequence.id, detail);
    (fit > given + BETTER && fit > FITS).then_some(Explained { gain: fit - given, finding })
}

/// An overlap that leaves doubts.
const DOUBTFUL: f64 = 0.7;

/// A finding where body and masks do not meet, or barely, whatever the reason.
pub(super) fn unexplained(sequence: &Sequence, both: &[Pair<'_>]) -> Option<Finding> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let tried = match both.len() {
        0..4 => "so few frames tell no more",
        _ => "no shift, order, size or lens that was tried explains it",
    };
    let detail = format!(
        "body and masks overlap by {given:.2} only, and {tried}: poses, translation, scale, model or masks of another person or \
         convention"
    );
    let finding =
        Finding { spoils: given < FITS, ..Finding::new(Kind::WrongGenderOrModel, &sequence.id, detail) };
    (given < DOUBTFUL).then_some(finding)
}

/// A part of the image that a person fills by more than this tells nothing.
const FILLED: f64 = 0.8;

/// What is done to a silhouette.
pub(super) struct Change {
    /// How much wider and higher it becomes,
    pub(super) size: [f64; 2],
    /// about this pixel,
    pub(super) about: [f64; 2],
    /// and then by how many pixels it moves.
    pub(super) by: [f64; 2],
}

/// Overlap of the mask with the body after a change, over the pixels to which the change brings pixels of the image; none where the
/// person fills them.
pub(super) fn overlap((seen, Shadows { mask, body, .. }): &Pair<'_>, change: &Change) -> Option<f64> {
    let Change { size: [wider, higher], about: [middle_x, middle_y], by: [across, down] } = change;
    let camera = &seen.camera;
    let (mut common, mut either, mut seen) = (0.0, 0.0, 0.0);
    let stride = body.width.max(body.height).div_ceil(LINES).max(1);
    let inside = |u: f64, v: f64| {
        (0.0..f64::from(camera.width)).contains(&u) && (0.0..f64::from(camera.height)).contains(&v)
    };
    for y in (0..body.height).step_by(stride) {
        for x in (0..body.width).step_by(stride) {
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let (u, v) =
                (middle_x + (x - across - middle_x) / wider, middle_y + (y - down - middle_y) / higher);
            if !inside(u, v) {
                continue;
            }
            let (body, mask) = (body.at(u as usize, v as usize), mask.at(x as usize, y as usize));
            seen += 1.0;
            common += f64::from(u8::from(body && mask));
            either += f64::from(u8::from(body || mask));
        }
    }
    (either > 0.0 && common < FILLED * seen).then(|| common / either)
}
