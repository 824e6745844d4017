//! Windows as sums of separable terms.

use super::{Precision, WindowShape};
use skinsplat_core::math::portable;

/// A symmetric odd window as `Σ_t vertical_t ⊗ horizontal_t`. Each filter is given by its half: `[k]` is the weight at
/// distance k from the centre.
pub(super) struct Window {
    /// The window has `2 radius + 1` taps per axis.
    pub(super) radius: usize,
    pub(super) terms: Vec<Term>,
}

pub(super) struct Term {
    pub(super) vertical: Vec<f64>,
    pub(super) horizontal: Vec<f64>,
}

impl Window {
    pub(super) fn new(shape: WindowShape) -> Self {
        let radius = shape.size() / 2;
        let terms = match shape {
            WindowShape::Uniform { size } => {
                let taps = vec![1.0 / size as f64; radius + 1];
                vec![Term { vertical: taps.clone(), horizontal: taps }]
            }
            WindowShape::Gaussian { sigma, precision: Precision::F64, .. } => {
                let taps = gaussian(radius, sigma);
                vec![Term { vertical: taps.clone(), horizontal: taps }]
            }
            WindowShape::Gaussian { sigma, precision: Precision::F32, .. } => rounded_gaussian(radius, sigma),
        };
        Self { radius, terms }
    }
}

/// `exp(-k² / (2 σ²))` at distances 0 to `radius`, normalised over the whole window.
fn gaussian(radius: usize, sigma: f64) -> Vec<f64> {
    let taps: Vec<f64> = (0..=radius).map(|k| bell(k, sigma)).collect();
    let sum = taps[0] + 2.0 * taps[1..].iter().sum::<f64>();
    taps.into_iter().map(|tap| tap / sum).collect()
}

fn bell(k: usize, sigma: f64) -> f64 {
    portable::exp(-((k * k) as f64) / (2.0 * sigma * sigma))
}

/// The window as 3DGS builds it in f32: taps rounded, their sum and the quotients rounded, and the outer product rounded
/// once more, so that it is no longer separable: one term per pair of rows at distance k from the centre. The sum is the
/// correctly rounded one, as PyTorch's vectorised `sum` gives for this window; adding in order is an ulp off.
fn rounded_gaussian(radius: usize, sigma: f64) -> Vec<Term> {
    let half: Vec<f32> = (0..=radius).map(|k| bell(k, sigma) as f32).collect();
    let sum: f64 = (0..=2 * radius).map(|i| f64::from(half[i.abs_diff(radius)])).sum();
    let taps: Vec<f32> = half.iter().map(|tap| tap / sum as f32).collect();
    let row = |k: usize| Term {
        vertical: (0..=radius).map(|j| f64::from(u8::from(j == k))).collect(),
        horizontal: taps.iter().map(|tap| f64::from(tap * taps[k])).collect(),
    };
    (0..=radius).map(row).collect()
}
