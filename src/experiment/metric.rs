//! The quantities that a table can have as columns.

use serde::{Deserialize, Serialize};

/// One quantity per frame and variant. A further column of the tables is a further arm here (and where the compiler
/// then points).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Peak signal-to-noise ratio, dB, in the protocol's variant.
    Psnr,
    /// Structural similarity, in the protocol's variant.
    Ssim,
    /// Learned perceptual distance, in the protocol's variant.
    Lpips,
    /// Gaussians in the avatar.
    Splats,
}

impl Metric {
    /// Every metric.
    pub const ALL: [Self; 4] = [Self::Psnr, Self::Ssim, Self::Lpips, Self::Splats];

    /// The id used in TOML, CSV and JSON.
    pub fn id(self) -> &'static str {
        match self {
            Self::Psnr => "psnr",
            Self::Ssim => "ssim",
            Self::Lpips => "lpips",
            Self::Splats => "splats",
        }
    }

    /// The title used in tables, unless the experiment gives its own.
    pub fn title(self) -> &'static str {
        match self {
            Self::Psnr => "PSNR",
            Self::Ssim => "SSIM",
            Self::Lpips => "LPIPS",
            Self::Splats => "Splats",
        }
    }

    /// Whether more is better.
    pub fn higher_is_better(self) -> bool {
        matches!(self, Self::Psnr | Self::Ssim)
    }

    /// Digits after the decimal point in the literature.
    pub fn decimals(self) -> usize {
        match self {
            Self::Psnr => 2,
            Self::Ssim | Self::Lpips => 4,
            Self::Splats => 0,
        }
    }
}
