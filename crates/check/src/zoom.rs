//! Focal lengths and sizes that are off by more than silhouettes inside the image can tell, and overlaps that nothing explains.

use super::findings::mean;
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
pub(super) fn far_off(
    sequence: &Sequence,
    both: &[(&Seen, &Shadows)],
    to_blame: Option<Kind>,
) -> Option<Finding> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let step = both.len().div_ceil(MOST).max(1);
    let best = |about: fn(&Seen, &Shadows) -> Option<[f64; 2]>| {
        let zoomed = |zoom: f64| {
            let pairs = both.iter().step_by(step);
            Some((zoom, mean(pairs.filter_map(|pair| overlap(pair, zoom, about(pair.0, pair.1)?)))?))
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
            Some(Finding::new(Kind::WrongGenderOrModel, &sequence.id, detail))
        }
        _ => far(fit).then(|| {
            let detail = format!(
                "body and masks overlap by {fit:.2} for {given:.2} with about {zoom:.2} times the focal length: focal length"
            );
            Finding::new(Kind::Camera, &sequence.id, detail)
        }),
    }
}

/// A finding where body and masks do not meet, whatever the reason.
pub(super) fn unexplained(sequence: &Sequence, both: &[(&Seen, &Shadows)]) -> Option<Finding> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let detail = format!(
        "body and masks overlap by {given:.2} only, and no shift, order, size or lens explains it: poses, translation, \
         scale, model or masks of another person or convention"
    );
    (given < FITS).then(|| Finding::new(Kind::WrongGenderOrModel, &sequence.id, detail))
}

/// A part of the image that a person fills by more than this tells nothing.
const FILLED: f64 = 0.8;

/// Overlap of the mask with the body as another focal length (about the principal point) or size (about its middle) would show it, over
/// the pixels to which the given one brings the body; none where the person fills them.
fn overlap(
    (seen, Shadows { mask, body, .. }): &(&Seen, &Shadows),
    zoom: f64,
    [middle_x, middle_y]: [f64; 2],
) -> Option<f64> {
    let camera = &seen.camera;
    let (mut common, mut either, mut seen) = (0.0, 0.0, 0.0);
    let stride = body.width.max(body.height).div_ceil(LINES).max(1);
    let inside = |u: f64, v: f64| {
        (0.0..f64::from(camera.width)).contains(&u) && (0.0..f64::from(camera.height)).contains(&v)
    };
    for y in (0..body.height).step_by(stride) {
        for x in (0..body.width).step_by(stride) {
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let (u, v) = (middle_x + (x - middle_x) / zoom, middle_y + (y - middle_y) / zoom);
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
