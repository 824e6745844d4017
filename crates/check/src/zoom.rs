//! Focal lengths that are off by more than silhouettes inside the image can tell, and overlaps that nothing explains.

use super::findings::mean;
use super::{Finding, Kind, Seen, Shadows};
use skinsplat_data::Sequence;

/// Focal lengths that are tried, over the one that is given.
const ZOOMS: [f64; 14] = [0.25, 0.33, 0.4, 0.5, 0.6, 0.67, 0.75, 0.82, 1.22, 1.33, 1.5, 2.0, 2.5, 3.0];
/// Frames that are compared, at most.
const MOST: usize = 12;
/// Columns and rows that are looked at, at most.
const LINES: usize = 128;
/// By how much the overlap must be better for another focal length.
const BETTER: f64 = 0.15;
/// An overlap at which body and masks are of one person in one pose.
const FITS: f64 = 0.6;

/// A finding where masks fit far better under another focal length.
pub(super) fn far_off(sequence: &Sequence, both: &[(&Seen, &Shadows)]) -> Option<Finding> {
    let given = mean(both.iter().filter_map(|(_, s)| s.body.overlap(&s.mask)))?;
    let step = both.len().div_ceil(MOST).max(1);
    let zoomed =
        |zoom: f64| Some((zoom, mean(both.iter().step_by(step).filter_map(|pair| overlap(pair, zoom)))?));
    let (zoom, fit) = ZOOMS.iter().filter_map(|&zoom| zoomed(zoom)).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let detail = format!(
        "body and masks overlap by {fit:.2} for {given:.2} with about {zoom} times the focal length: focal length"
    );
    (fit > given + BETTER && fit > FITS).then(|| Finding::new(Kind::Camera, &sequence.id, detail))
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

/// Overlap of the mask with the body as another focal length would show it: about the principal point, over the pixels to which the
/// given one brings the body; none where the person fills them.
fn overlap((seen, Shadows { mask, body, .. }): &(&Seen, &Shadows), zoom: f64) -> Option<f64> {
    let camera = &seen.camera;
    let (mut common, mut either, mut seen) = (0.0, 0.0, 0.0);
    let stride = body.width.max(body.height).div_ceil(LINES).max(1);
    let inside = |u: f64, v: f64| {
        (0.0..f64::from(camera.width)).contains(&u) && (0.0..f64::from(camera.height)).contains(&v)
    };
    for y in (0..body.height).step_by(stride) {
        for x in (0..body.width).step_by(stride) {
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let (u, v) = (camera.cx + (x - camera.cx) / zoom, camera.cy + (y - camera.cy) / zoom);
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
