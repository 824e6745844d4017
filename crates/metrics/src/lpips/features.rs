//! Feature maps, and the distance of two of them.

use rayon::prelude::*;

/// Values of several channels on a grid of pixels, the channels of a pixel next to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values per pixel.
    pub channels: usize,
    /// `height * width * channels` values.
    pub values: Vec<f32>,
}

/// Partial sums over channels: their number sets the order of additions, whatever the vector width.
const LANES: usize = 8;

/// Keeps the division by the length of a pixel's features defined where they are all 0.
const EPSILON: f64 = 1e-10;

impl FeatureMap {
    /// All zeros.
    pub fn zeros(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, values: vec![0.0; width * height * channels] }
    }

    /// The channels of a pixel.
    pub fn at(&self, x: usize, y: usize) -> &[f32] {
        &self.values[(y * self.width + x) * self.channels..][..self.channels]
    }

    /// The mean over the pixels of `Σ_c w_c (a_c / |a| - b_c / |b|)²`. Sums run in f64 in a fixed order.
    pub(super) fn weighted_distance(&self, other: &Self, weights: &[f64]) -> f64 {
        let arch = skinsplat_simd::arch();
        let row = self.width * self.channels;
        let rows = self.values.par_chunks_exact(row).zip(other.values.par_chunks_exact(row));
        let sums: Vec<f64> = rows.map(|(a, b)| arch.dispatch(Row { a, b, weights })).collect();
        sums.iter().sum::<f64>() / (self.width * self.height) as f64
    }
}

/// One row of two maps.
struct Row<'a> {
    a: &'a [f32],
    b: &'a [f32],
    weights: &'a [f64],
}

impl pulp::NullaryFnOnce for Row<'_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let channels = self.weights.len();
        let pixels = self.a.chunks_exact(channels).zip(self.b.chunks_exact(channels));
        let mut sum = 0.0;
        for (a, b) in pixels {
            let (inverse_a, inverse_b) = (inverse_length(a), inverse_length(b));
            let mut sums = [0.0; LANES];
            let lanes = lanes(a).iter().zip(lanes(b)).zip(self.weights.as_chunks::<LANES>().0);
            for ((a, b), weights) in lanes {
                for (((sum, &a), &b), &weight) in sums.iter_mut().zip(a).zip(b).zip(weights) {
                    let difference = f64::from(a) * inverse_a - f64::from(b) * inverse_b;
                    *sum += weight * (difference * difference);
                }
            }
            sum += sums.iter().sum::<f64>();
        }
        sum
    }
}

/// All channels: their number is a multiple of [`LANES`] in both networks.
#[inline(always)]
fn lanes(values: &[f32]) -> &[[f32; LANES]] {
    let (lanes, rest) = values.as_chunks();
    debug_assert!(rest.is_empty());
    lanes
}

#[inline(always)]
fn inverse_length(values: &[f32]) -> f64 {
    let mut sums = [0.0; LANES];
    for values in lanes(values) {
        for (sum, &value) in sums.iter_mut().zip(values) {
            *sum += f64::from(value) * f64::from(value);
        }
    }
    1.0 / (sums.iter().sum::<f64>().sqrt() + EPSILON)
}
