//! Errors per pixel and the peak signal-to-noise ratio; the peak is 1.

use super::{MetricsError, Planes};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;

/// How one PSNR comes from the mean squared errors of three channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PsnrVariant {
    /// `-10 log10(MSE)` with the MSE over all values of the image.
    #[default]
    Image,
    /// The mean of the PSNRs of R, G and B, as 3DGS's and HUGS's `psnr()` computes on a C x H x W tensor. Infinite if one
    /// channel is identical.
    MeanOfChannels,
    /// `20 log10(1 / (RMSE + 1e-8))` over the image, as SplattingAvatar: 160 dB for identical images.
    RmseEpsilon,
}

impl PsnrVariant {
    /// The PSNR, dB, of channel-wise mean squared errors. Infinite for identical images, except with `RmseEpsilon`.
    pub fn psnr(self, channel_mse: [f64; 3]) -> f64 {
        let decibel = |mse: f64| -10.0 * portable::log10(mse);
        match self {
            Self::Image => decibel(mean(channel_mse)),
            Self::MeanOfChannels => mean(channel_mse.map(decibel)),
            Self::RmseEpsilon => -20.0 * portable::log10(mean(channel_mse).sqrt() + 1e-8),
        }
    }
}

/// Sums of squared and absolute differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorSums {
    /// Pixels (or the sum of their weights).
    pub pixels: f64,
    /// Σ (a - b)² per channel.
    pub squared: [f64; 3],
    /// Σ |a - b| per channel.
    pub absolute: [f64; 3],
}

impl ErrorSums {
    /// Compares two images, with a weight per pixel if given (0 leaves a pixel out).
    ///
    /// # Errors
    /// Images of different sizes; weights of which none is above 0 give NaN means and are the caller's to refuse.
    pub fn new(a: &Planes, b: &Planes, weights: Option<&[f64]>) -> Result<Self, MetricsError> {
        MetricsError::check_size("truth", (b.width(), b.height()), (a.width(), a.height()))?;
        let width = a.width();
        let pixels = match weights {
            None => a.pixels() as f64,
            Some(weights) => weights.iter().sum(),
        };
        let (mut squared, mut absolute) = ([0.0; 3], [0.0; 3]);
        for c in 0..3 {
            let (a, b) = (&a.channels()[c], &b.channels()[c]);
            let rows: Vec<(f64, f64)> = (a.par_chunks(width).zip(b.par_chunks(width)).enumerate())
                .map(|(y, (a, b))| row_sums(a, b, weights.map(|w| &w[y * width..(y + 1) * width])))
                .collect();
            for (row_squared, row_absolute) in rows {
                squared[c] += row_squared;
                absolute[c] += row_absolute;
            }
        }
        Ok(Self { pixels, squared, absolute })
    }

    /// Mean squared error of R, G and B.
    pub fn channel_mse(&self) -> [f64; 3] {
        self.squared.map(|sum| sum / self.pixels)
    }

    /// Mean squared error over all values.
    pub fn mse(&self) -> f64 {
        mean(self.channel_mse())
    }

    /// Mean absolute error over all values.
    pub fn mae(&self) -> f64 {
        mean(self.absolute.map(|sum| sum / self.pixels))
    }
}

/// Mean of three channels.
pub fn mean(channels: [f64; 3]) -> f64 {
    (channels[0] + channels[1] + channels[2]) / 3.0
}

/// Number of partial sums per row: enough for two AVX-512 registers, and the same on every machine, so that the order of
/// the additions is too.
pub(crate) const LANES: usize = 16;

/// Σ value(row0\[i\], row1\[i\], ...) over rows of equal length, in [`LANES`] interleaved partial sums.
#[inline(always)]
pub(crate) fn lane_sum<const N: usize>(rows: [&[f64]; N], value: impl Fn([f64; N]) -> f64) -> f64 {
    let split = rows.map(|row| row.as_chunks::<LANES>());
    let mut lanes = [0.0; LANES];
    for chunk in 0..split[0].0.len() {
        let chunks = split.map(|(chunks, _)| &chunks[chunk]);
        for lane in 0..LANES {
            lanes[lane] += value(chunks.map(|values| values[lane]));
        }
    }
    for lane in 0..split[0].1.len() {
        lanes[lane] += value(split.map(|(_, rest)| rest[lane]));
    }
    lanes.iter().sum()
}

fn row_sums(a: &[f64], b: &[f64], weights: Option<&[f64]>) -> (f64, f64) {
    let square = |a: f64, b: f64| (a - b) * (a - b);
    match weights {
        None => (lane_sum([a, b], |[a, b]| square(a, b)), lane_sum([a, b], |[a, b]| (a - b).abs())),
        Some(w) => (
            lane_sum([a, b, w], |[a, b, w]| w * square(a, b)),
            lane_sum([a, b, w], |[a, b, w]| w * (a - b).abs()),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_of_known_errors() {
        let mse = [0.01, 0.0001, 0.001];
        assert!((PsnrVariant::MeanOfChannels.psnr(mse) - 30.0).abs() < 1e-12);
        assert!((PsnrVariant::Image.psnr(mse) - -10.0 * (0.0111f64 / 3.0).log10()).abs() < 1e-12);
        assert!((PsnrVariant::RmseEpsilon.psnr([0.0; 3]) - 160.0).abs() < 1e-9);
        assert_eq!(PsnrVariant::Image.psnr([0.0; 3]), f64::INFINITY);
        assert_eq!(PsnrVariant::MeanOfChannels.psnr([0.1, 0.0, 0.1]), f64::INFINITY);
    }

    #[test]
    fn lane_sums_reach_every_value() {
        for n in 0..70usize {
            let row: Vec<f64> = (0..n).map(|i| i as f64).collect();
            assert_eq!(lane_sum([&row, &row], |[a, b]| a + b), (n * n.saturating_sub(1)) as f64);
        }
    }
}
