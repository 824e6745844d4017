//! The LPIPS variants by name, and the interface through which a scorer is handed to [`Wanted`](crate::Wanted).

use crate::{MetricsError, Planes};
use serde::{Deserialize, Serialize};

/// Backbone of LPIPS 0.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LpipsNet {
    /// AlexNet.
    Alex,
    /// VGG-16.
    Vgg,
}

/// What the network is fed for a colour v in \[0, 1\].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InputRange {
    /// `2 v - 1`, as LPIPS is defined (`normalize=True` in the reference code).
    Pm1,
    /// v itself: the slip of 3DGS's `metrics.py`, HUGS, iHuman, Animatable 3D Gaussians and HAHA. Values are about half
    /// as large; the two families must not be compared.
    Raw01,
}

impl LpipsNet {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Alex, Self::Vgg];

    /// Stable name.
    pub fn id(self) -> &'static str {
        match self {
            Self::Alex => "alex",
            Self::Vgg => "vgg",
        }
    }
}

/// A variant of LPIPS, written `alex-pm1`, `vgg-raw01`, ...
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct LpipsVariant {
    /// Backbone.
    pub net: LpipsNet,
    /// Input range.
    pub range: InputRange,
}

impl LpipsVariant {
    /// All four.
    pub const ALL: [Self; 4] = [
        Self { net: LpipsNet::Alex, range: InputRange::Pm1 },
        Self { net: LpipsNet::Alex, range: InputRange::Raw01 },
        Self { net: LpipsNet::Vgg, range: InputRange::Pm1 },
        Self { net: LpipsNet::Vgg, range: InputRange::Raw01 },
    ];

    /// Stable name.
    pub fn id(self) -> &'static str {
        match (self.net, self.range) {
            (LpipsNet::Alex, InputRange::Pm1) => "alex-pm1",
            (LpipsNet::Alex, InputRange::Raw01) => "alex-raw01",
            (LpipsNet::Vgg, InputRange::Pm1) => "vgg-pm1",
            (LpipsNet::Vgg, InputRange::Raw01) => "vgg-raw01",
        }
    }

    /// Its name among other metrics.
    pub fn metric(self) -> &'static str {
        match (self.net, self.range) {
            (LpipsNet::Alex, InputRange::Pm1) => "lpips_alex_pm1",
            (LpipsNet::Alex, InputRange::Raw01) => "lpips_alex_raw01",
            (LpipsNet::Vgg, InputRange::Pm1) => "lpips_vgg_pm1",
            (LpipsNet::Vgg, InputRange::Raw01) => "lpips_vgg_raw01",
        }
    }
}

impl TryFrom<String> for LpipsVariant {
    type Error = String;

    fn try_from(id: String) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|variant| variant.id() == id);
        found.ok_or_else(|| format!("\"{id}\"; expected {}", Self::ALL.map(Self::id).join(", ")))
    }
}

impl From<LpipsVariant> for String {
    fn from(variant: LpipsVariant) -> Self {
        variant.id().to_owned()
    }
}

/// Something that computes LPIPS; handed to [`crate::Protocol::score_with`].
pub trait PerceptualDistance: Sync {
    /// The distance of two images of equal size, prepared by the protocol (composited, clamped, quantised, cropped);
    /// values are colours in \[0, 1\], the variant's input range is applied by the scorer.
    ///
    /// # Errors
    /// Images smaller than the network accepts, or a variant whose weights are not loaded.
    fn distance(&self, render: &Planes, truth: &Planes, variant: LpipsVariant) -> Result<f64, MetricsError>;
}
