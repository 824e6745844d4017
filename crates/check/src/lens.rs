//! Whether pictures were taken through a lens that the cameras do not know of.
//!
//! Cameras here are pinholes. Where pictures still have their lens distortion, or were undistorted twice, silhouettes fit once
//! the masks are bent about the principal point: a point at distance r moves to `s r (1 + k r^2 / R^2)`, with R half the
//! image's diagonal. A better overlap than any size s alone gives is a lens. Loose clothes and wrong focal lengths are sizes.

use super::bodies::Pair;
use super::findings::{Explained, mean};
use super::{Finding, Kind, Shadows};
use skinsplat_core::scene::Camera;
use skinsplat_data::Sequence;
use std::ops::Range;

/// By how much the overlap must be better than without a lens.
const BETTER: f64 = 0.03;
/// The same, as a share of what is missing to a perfect overlap: two numbers fit any outline a little better.
const OF_THE_REST: f64 = 1.0 / 3.0;
/// Columns and rows that are looked at, at most: silhouettes need no more.
const LINES: usize = 128;
/// Frames that are compared, at most.
const MOST: usize = 12;
/// Coefficients k that are tried: below zero straight lines bulge outwards, as most lenses have it.
const LENSES: [f64; 8] = [-0.16, -0.12, -0.08, -0.05, 0.05, 0.08, 0.12, 0.16];
/// Sizes s that are tried.
const SIZES: [f64; 9] = [0.84, 0.88, 0.92, 0.96, 1.0, 1.04, 1.08, 1.12, 1.16];

/// A finding if masks fit better through a lens.
pub(super) fn bent(sequence: &Sequence, both: &[Pair<'_>]) -> Option<Explained> {
    let step = both.len().div_ceil(MOST).max(1);
    let frames: Vec<Frame<'_>> =
        both.iter().step_by(step).map(|(seen, shadows)| Frame::new(shadows, &seen.camera)).collect();
    let overlap = |k: f64, size: f64| mean(frames.iter().filter_map(|frame| frame.through(k, size)));
    let best = |k: f64| SIZES.iter().filter_map(|&size| overlap(k, size)).max_by(f64::total_cmp);
    let plain = best(0.0)?;
    if plain > 1.0 - BETTER {
        return None;
    }
    let fits = LENSES.iter().filter_map(|&k| Some((k, best(k)?)));
    let (k, fit) = fits.max_by(|a, b| a.1.total_cmp(&b.1))?;
    if fit < plain + BETTER.max(OF_THE_REST * (1.0 - plain)) {
        return None;
    }
    let (percent, what) = (100.0 * k.abs(), if k < 0.0 { "not undistorted" } else { "undistorted twice" });
    let detail = format!(
        "body and masks overlap by {fit:.2} for {plain:.2} through a lens that moves corners by {percent:.0} %: {what}?"
    );
    let finding = Finding::new(Kind::Camera, &sequence.id, detail);
    Some(Explained { gain: fit - overlap(0.0, 1.0)?, finding })
}

/// A frame, and where to look.
struct Frame<'a> {
    shadows: &'a Shadows,
    camera: &'a Camera,
    columns: Range<usize>,
    rows: Range<usize>,
}

impl<'a> Frame<'a> {
    /// Outside the columns and rows neither is the body, nor can any lens of any size bring the mask there.
    fn new(shadows: &'a Shadows, camera: &'a Camera) -> Self {
        let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
        let nearest = least(&SIZES) * (1.0 + least(&LENSES));
        let away = |edge: f64, centre: f64| [edge, centre + (edge - centre) / nearest];
        let (mut x, mut y) = (Vec::new(), Vec::new());
        if let Some([left, right, top, bottom]) = shadows.mask.bounds() {
            x.extend([left, right].iter().flat_map(|&edge| away(edge, camera.cx)));
            y.extend([top, bottom].iter().flat_map(|&edge| away(edge, camera.cy)));
        }
        if let Some([left, right, top, bottom]) = shadows.body.bounds() {
            x.extend([left, right]);
            y.extend([top, bottom]);
        }
        let (columns, rows) = (range(&x, shadows.body.width), range(&y, shadows.body.height));
        Self { shadows, camera, columns, rows }
    }

    /// Overlap of the body with a mask seen through a lens, over the pixels that the lens leaves in the image; none if there
    /// is nothing to overlap.
    fn through(&self, k: f64, size: f64) -> Option<f64> {
        let Self { shadows: Shadows { mask, body, .. }, camera, columns, rows } = self;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let corner = 0.25 * (width * width + height * height);
        let (mut common, mut either) = (0_u32, 0_u32);
        let stride = body.width.max(body.height).div_ceil(LINES).max(1);
        for y in rows.clone().step_by(stride) {
            for x in columns.clone().step_by(stride) {
                let (u, v) = (x as f64 + 0.5 - camera.cx, y as f64 + 0.5 - camera.cy);
                let factor = size * (1.0 + k * (u * u + v * v) / corner);
                let (u, v) = (camera.cx + factor * u, camera.cy + factor * v);
                if !(0.0..width).contains(&u) || !(0.0..height).contains(&v) {
                    continue;
                }
                let (a, b) = (body.at(x, y), mask.at(u as usize, v as usize));
                common += u32::from(a && b);
                either += u32::from(a || b);
            }
        }
        (either > 0).then(|| f64::from(common) / f64::from(either))
    }
}

/// From the least to the greatest, of the columns or rows of an image.
fn range(edges: &[f64], most: usize) -> Range<usize> {
    let least = edges.iter().copied().fold(f64::INFINITY, f64::min).floor().max(0.0) as usize;
    let greatest = edges.iter().copied().fold(0.0, f64::max).ceil() as usize;
    least.min(most)..greatest.min(most)
}
