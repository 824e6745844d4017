//! The choices of an SSIM, and the combinations that have a name.

use crate::MetricsError;
use serde::{Deserialize, Serialize};

/// The window over which means and variances are taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "shape", rename_all = "kebab-case")]
pub enum WindowShape {
    /// `exp(-d² / (2 σ²))`, normalised.
    Gaussian {
        /// Taps per axis, odd.
        size: usize,
        /// Standard deviation, pixels.
        sigma: f64,
        /// Precision in which the weights are built; the filtering is f64 in any case.
        precision: Precision,
    },
    /// All weights equal.
    Uniform {
        /// Taps per axis, odd.
        size: usize,
    },
}

impl WindowShape {
    /// Taps per axis.
    pub fn size(self) -> usize {
        match self {
            Self::Gaussian { size, .. } | Self::Uniform { size } => size,
        }
    }
}

/// Precision of window weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Weights in f64.
    F64,
    /// Weights and their outer product rounded to f32 as in 3DGS's `loss_utils.py`: moves the index by some 1e-6.
    F32,
}

/// What the window sees beyond the border, and hence which pixels the map has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Border {
    /// Zeros; the map is as large as the image.
    ZeroPad,
    /// Nothing: the map has the pixels whose window fits.
    Valid,
    /// The image mirrored without repeating its edge; the map is as large as the image.
    Reflect,
}

/// The range L of values in the constants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DataRange {
    /// As given.
    Fixed(f64),
    /// max(max a - min a, max b - min b) over all channels: torchmetrics without `data_range`.
    Extent,
}

/// How variances are normalised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Covariance {
    /// `E[x²] - E[x]²`.
    Population,
    /// The same times n / (n - 1) for a window of n pixels.
    Sample,
}

/// All choices of an SSIM.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SsimSettings {
    /// Window.
    pub window: WindowShape,
    /// Border.
    pub border: Border,
    /// Normalisation of the variances.
    pub covariance: Covariance,
    /// Range of the values.
    pub data_range: DataRange,
    /// Average-pool both images by round(min(width, height) / 256) first, where that is above 1 (piq's default).
    pub downsample: bool,
}

impl Border {
    /// Smallest width and height that a window of this radius accepts.
    pub fn minimum_size(self, radius: usize) -> usize {
        match self {
            Self::ZeroPad => 1,
            Self::Valid => 2 * radius + 1,
            Self::Reflect => radius + 1,
        }
    }
}

impl SsimSettings {
    /// Checks that the window is odd and of a size that makes sense, and that numbers are finite and positive.
    pub(super) fn check(&self) -> Result<(), MetricsError> {
        let bad = |field, problem: String, expected| Err(MetricsError::Settings { field, problem, expected });
        let size = self.window.size();
        if size.is_multiple_of(2) || !(3..=255).contains(&size) {
            return bad("window.size", format!("{size}"), "an odd number from 3 to 255");
        }
        if let WindowShape::Gaussian { sigma, .. } = self.window
            && !(sigma.is_finite() && sigma > 0.0)
        {
            return bad("window.sigma", format!("{sigma}"), "a finite number above 0");
        }
        match self.data_range {
            DataRange::Fixed(range) if !(range.is_finite() && range > 0.0) => {
                bad("data_range", format!("{range}"), "a finite number above 0")
            }
            _ => Ok(()),
        }
    }
}

/// The variants that have a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SsimVariant {
    /// Gaussian 11 x 11, σ 1.5, zero padding: 3DGS, HUGS, GauHuman.
    #[serde(rename = "gaussian11-zero-pad")]
    ZeroPad,
    /// The same without padding: SplattingAvatar, nerfbaselines, torchmetrics up to 1.4, scikit-image with
    /// `gaussian_weights`, piq without downsampling.
    #[serde(rename = "gaussian11-valid", alias = "torchmetrics-1.4")]
    Valid,
    /// The same over the reflect-padded image: torchmetrics from 1.5.0 on.
    #[serde(rename = "gaussian11-reflect", alias = "torchmetrics-1.5")]
    Reflect,
    /// Uniform 7 x 7, sample covariance, no padding: scikit-image's default with `data_range=1`.
    Uniform7,
    /// The same with L = 2: what older scikit-image took for float images without `data_range`.
    #[serde(rename = "uniform7-range2")]
    Uniform7Range2,
    /// `ZeroPad` with the window rounded to f32 as 3DGS does.
    #[serde(rename = "gaussian11-zero-pad-f32-window")]
    ZeroPadF32Window,
    /// `Reflect` with L from the images: torchmetrics from 1.5.0 on without `data_range`.
    #[serde(rename = "gaussian11-reflect-extent")]
    ReflectExtent,
    /// `Valid` after piq's downsampling.
    #[serde(rename = "gaussian11-valid-downsampled")]
    ValidDownsampled,
}

impl SsimVariant {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::ZeroPad,
        Self::Valid,
        Self::Reflect,
        Self::Uniform7,
        Self::Uniform7Range2,
        Self::ZeroPadF32Window,
        Self::ReflectExtent,
        Self::ValidDownsampled,
    ];

    /// Stable name of the metric.
    pub fn id(self) -> &'static str {
        match self {
            Self::ZeroPad => "ssim_zero_pad",
            Self::Valid => "ssim_valid",
            Self::Reflect => "ssim_reflect",
            Self::Uniform7 => "ssim_uniform7",
            Self::Uniform7Range2 => "ssim_uniform7_range2",
            Self::ZeroPadF32Window => "ssim_zero_pad_f32_window",
            Self::ReflectExtent => "ssim_reflect_extent",
            Self::ValidDownsampled => "ssim_valid_downsampled",
        }
    }

    /// What the name stands for.
    pub fn settings(self) -> SsimSettings {
        let gaussian = |border| SsimSettings {
            window: WindowShape::Gaussian { size: 11, sigma: 1.5, precision: Precision::F64 },
            border,
            covariance: Covariance::Population,
            data_range: DataRange::Fixed(1.0),
            downsample: false,
        };
        let uniform = |range| SsimSettings {
            window: WindowShape::Uniform { size: 7 },
            border: Border::Valid,
            covariance: Covariance::Sample,
            data_range: DataRange::Fixed(range),
            downsample: false,
        };
        match self {
            Self::ZeroPad => gaussian(Border::ZeroPad),
            Self::Valid => gaussian(Border::Valid),
            Self::Reflect => gaussian(Border::Reflect),
            Self::Uniform7 => uniform(1.0),
            Self::Uniform7Range2 => uniform(2.0),
            Self::ZeroPadF32Window => SsimSettings {
                window: WindowShape::Gaussian { size: 11, sigma: 1.5, precision: Precision::F32 },
                ..gaussian(Border::ZeroPad)
            },
            Self::ReflectExtent => {
                SsimSettings { data_range: DataRange::Extent, ..gaussian(Border::Reflect) }
            }
            Self::ValidDownsampled => SsimSettings { downsample: true, ..gaussian(Border::Valid) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_without_meaning_are_named() {
        let good = SsimVariant::Valid.settings();
        assert_eq!(good.check(), Ok(()));
        let gaussian = |size, sigma| WindowShape::Gaussian { size, sigma, precision: Precision::F64 };
        for (settings, field) in [
            (SsimSettings { window: WindowShape::Uniform { size: 8 }, ..good }, "window.size"),
            (SsimSettings { window: WindowShape::Uniform { size: 1 }, ..good }, "window.size"),
            (SsimSettings { window: gaussian(11, 0.0), ..good }, "window.sigma"),
            (SsimSettings { window: gaussian(11, f64::NAN), ..good }, "window.sigma"),
            (SsimSettings { data_range: DataRange::Fixed(0.0), ..good }, "data_range"),
        ] {
            let error = settings.check().unwrap_err();
            assert!(
                matches!(error, MetricsError::Settings { field: found, .. } if found == field),
                "{error}"
            );
        }
    }

    #[test]
    fn names_are_unique_and_torchmetrics_is_pinned() {
        let names = SsimVariant::ALL.map(|variant| serde_json::to_string(&variant).unwrap());
        let ids = SsimVariant::ALL.map(SsimVariant::id);
        for i in 0..names.len() {
            assert!(!names[..i].contains(&names[i]) && !ids[..i].contains(&ids[i]));
            assert_eq!(serde_json::from_str::<SsimVariant>(&names[i]).unwrap(), SsimVariant::ALL[i]);
        }
        let named = |name: &str| serde_json::from_str::<SsimVariant>(&format!("\"{name}\"")).unwrap();
        assert_eq!(named("torchmetrics-1.4"), SsimVariant::Valid);
        assert_eq!(named("torchmetrics-1.5"), SsimVariant::Reflect);
    }
}
