//! What an optimiser minimises on one frame, with its derivatives: `(1 − λ) L1 + λ (1 − SSIM)` on colour (3DGS) and L1 on
//! the silhouette, both as means over all pixels of the frame.
//!
//! Outside the bounding box of both silhouettes render and truth are the same background: nothing is computed there, and
//! the values are those of the whole frame.

mod dssim;

use dssim::Dssim;
use skinsplat_core::scene::{Image, Mask, RenderedGradient};
use std::ops::Range;

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weights {
    /// λ, the share of `1 − SSIM` in the colour term.
    pub(crate) ssim: f32,
    /// Of the L1 distance of the silhouettes.
    pub(crate) silhouette: f32,
}

/// The terms on one frame, unweighted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrameLoss {
    /// Mean absolute difference over pixels and channels.
    pub(crate) l1: f64,
    /// Mean SSIM (11x11, σ 1.5, zero-padded, as in 3DGS), 1 for equal images.
    pub(crate) ssim: f64,
    /// Mean absolute difference of alpha.
    pub(crate) silhouette: f64,
    /// Mean squared difference over pixels and channels, for the PSNR of progress lines.
    pub(crate) mse: f64,
    /// The weighted sum.
    pub(crate) total: f64,
}

/// Computes losses; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Losses {
    dssim: Dssim,
}

/// A rectangle of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) x: Range<usize>,
    pub(crate) y: Range<usize>,
}

impl Losses {
    /// The loss of a render (colour over a background, alpha) against the truth over the same background, and its
    /// derivatives.
    ///
    /// # Panics
    /// If the sizes differ.
    pub(crate) fn frame(
        &mut self,
        (image, alpha): (&Image, &Mask),
        (true_image, true_alpha): (&Image, &Mask),
        weights: &Weights,
        gradient: &mut RenderedGradient,
    ) -> FrameLoss {
        let size = (image.width(), image.height());
        assert_eq!((true_image.width(), true_image.height()), size, "truth and render are of one size");
        reset(gradient, size);
        let pixels = (size.0 * size.1) as f64;
        let mut loss = FrameLoss { ssim: 1.0, ..FrameLoss::default() };
        let Some(window) = occupied(alpha, true_alpha) else { return loss };
        let channels = 3.0 * pixels;
        let mut gradient_alpha = gradient.alpha.take();
        {
            let weight = ((1.0 - f64::from(weights.ssim)) / channels) as f32;
            for y in window.y.clone() {
                let row = y * size.0 + window.x.start..y * size.0 + window.x.end;
                let (a, b) = (&image.pixels()[row.clone()], &true_image.pixels()[row.clone()]);
                let out = &mut gradient.image.pixels_mut()[row];
                let (l1, mse) = absolute(a.as_flattened(), b.as_flattened(), weight, out.as_flattened_mut());
                loss.l1 += l1 / channels;
                loss.mse += mse / channels;
            }
        }
        if let Some(out) = &mut gradient_alpha
            && weights.silhouette > 0.0
        {
            let weight = (f64::from(weights.silhouette) / pixels) as f32;
            for y in window.y.clone() {
                let row = y * size.0 + window.x.start..y * size.0 + window.x.end;
                let (a, b) = (&alpha.values()[row.clone()], &true_alpha.values()[row.clone()]);
                let (l1, _) = absolute(a, b, weight, &mut out.values_mut()[row]);
                loss.silhouette += l1 / pixels;
            }
        }
        gradient.alpha = gradient_alpha;
        if weights.ssim > 0.0 {
            let weight = -f64::from(weights.ssim) / channels;
            let sum = self.dssim.add(image, true_image, &window, weight as f32, &mut gradient.image);
            loss.ssim = 1.0 + sum / channels;
        }
        let share = f64::from(weights.ssim);
        let colour = (1.0 - share) * loss.l1 + share * (1.0 - loss.ssim);
        loss.total = colour + f64::from(weights.silhouette) * loss.silhouette;
        loss
    }
}

/// The smallest rectangle outside which both silhouettes are empty, widened by the radius of the SSIM window, in which
/// pixels still influence windows that differ; `None` if both are empty.
fn occupied(a: &Mask, b: &Mask) -> Option<Window> {
    let (width, height) = (a.width(), a.height());
    let seen = |row: usize, x: usize| a.at(x, row) > 0.0 || b.at(x, row) > 0.0;
    let (mut x, mut y) = (width..0, height..0);
    for row in 0..height {
        let Some(first) = (0..width).find(|&x| seen(row, x)) else { continue };
        let last = (first..width).rev().find(|&x| seen(row, x)).unwrap_or(first);
        x = x.start.min(first)..x.end.max(last + 1);
        y = y.start.min(row)..row + 1;
    }
    if x.is_empty() {
        return None;
    }
    let widened = |r: Range<usize>, size: usize| {
        r.start.saturating_sub(dssim::RADIUS)..(r.end + dssim::RADIUS).min(size)
    };
    Some(Window { x: widened(x, width), y: widened(y, height) })
}

/// Σ|a − b| and Σ(a − b)², and `weight * sign(a − b)` (0 where equal).
fn absolute(a: &[f32], b: &[f32], weight: f32, gradient: &mut [f32]) -> (f64, f64) {
    let (mut l1, mut squares) = (0.0, 0.0);
    for ((a, b), gradient) in a.iter().zip(b).zip(gradient) {
        let difference = a - b;
        l1 += f64::from(difference.abs());
        squares += f64::from(difference) * f64::from(difference);
        *gradient = if difference == 0.0 { 0.0 } else { weight.copysign(difference) };
    }
    (l1, squares)
}

/// Makes the derivatives fit the image, with zeros.
fn reset(gradient: &mut RenderedGradient, (width, height): (usize, usize)) {
    if (gradient.image.width(), gradient.image.height()) != (width, height) {
        gradient.image = Image::filled(width, height, [0.0; 3]);
        gradient.alpha = Some(Mask::filled(width, height, 0.0));
        return;
    }
    gradient.image.pixels_mut().fill([0.0; 3]);
    match &mut gradient.alpha {
        Some(alpha) => alpha.values_mut().fill(0.0),
        none => *none = Some(Mask::filled(width, height, 0.0)),
    }
}

#[cfg(test)]
mod tests;
