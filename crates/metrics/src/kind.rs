//! The columns of a results table.

use serde::{Deserialize, Serialize};

/// A quantity that tables show, with what a table needs to know about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MetricKind {
    /// Peak signal-to-noise ratio, dB.
    Psnr,
    /// Structural similarity.
    Ssim,
    /// Learned perceptual distance.
    Lpips,
    /// Number of Gaussians of the avatar.
    Splats,
}

impl MetricKind {
    /// All of them, in the order of the columns.
    pub const ALL: [Self; 4] = [Self::Psnr, Self::Ssim, Self::Lpips, Self::Splats];

    /// Stable name in files.
    pub fn id(self) -> &'static str {
        match self {
            Self::Psnr => "psnr",
            Self::Ssim => "ssim",
            Self::Lpips => "lpips",
            Self::Splats => "splats",
        }
    }

    /// Column title.
    pub fn title(self) -> &'static str {
        match self {
            Self::Psnr => "PSNR",
            Self::Ssim => "SSIM",
            Self::Lpips => "LPIPS",
            Self::Splats => "Splats",
        }
    }

    /// Digits after the point, as the paper prints them.
    pub fn decimals(self) -> usize {
        match self {
            Self::Psnr => 2,
            Self::Ssim | Self::Lpips => 4,
            Self::Splats => 0,
        }
    }

    /// Whether more is better; the paper counts fewer splats as better (Table 3).
    pub fn higher_is_better(self) -> bool {
        matches!(self, Self::Psnr | Self::Ssim)
    }

    /// The metric of this name.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id)
    }
}
