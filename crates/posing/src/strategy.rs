//! The axes of a strategy as plain data: closed enums, each variant with a stable id. (The rotation's are in `rotate`.)

use super::{Across, PosingError, RotationChoice, joints};
use skinsplat_core::scene::{ColourClamp, PosedBody};
use std::fmt;
use std::str::FromStr;

/// How Gaussians rotate, spread and shine when a body moves.
///
/// For a Gaussian with canonical rotation R_c, scales S, SH s and skinning weights w_j, and joints with rotations R_j
/// relative to the rest pose, B = Σ w_j R_j is the blend (the linear part of LBS) and R the rotation that
/// [`RotationChoice`] makes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Strategy {
    /// Where R comes from.
    pub rotation: RotationChoice,
    /// What becomes of the covariance.
    pub covariance: CovarianceChoice,
    /// What becomes of the colour.
    pub colour: ColourChoice,
    /// How colours leave the SH evaluation.
    #[cfg_attr(feature = "serde", serde(default))]
    pub clamp: ClampChoice,
}

/// What becomes of Σ_c = R_c S² R_cᵀ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum CovarianceChoice {
    /// R Σ_c Rᵀ.
    Rotate,
    /// B Σ_c Bᵀ: not a rotation, splats shrink where joints disagree (3DGS-Avatar).
    Affine,
    /// B R_cᵀ S² R_c Bᵀ: as `Affine` with R_c transposed, as Animatable's kernel fills its matrix.
    AffineConjugate,
    /// J Σ_c Jᵀ with the derivative J of the map that carries the means, weights constant across the surface: what LBS does to
    /// a small Gaussian.
    PushForward,
    /// The same, with the normal carried to the posed normal and its length kept.
    PushForwardNormal,
    /// A Σ_c Aᵀ with the quaternion average A (Eq. 7), whatever R turns the SH: to tell their parts in a difference apart.
    RotateByAverage,
    /// R Σ_c Rᵀ for the nearest disc of iHuman: R_c snapped to \[n | r1' | r2'\] of the rest face, 1 mm thick.
    Surfel,
}

/// What becomes of the SH.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum ColourChoice {
    /// Nothing: highlights stay fixed in the world.
    None,
    /// SH rotated by R (Eq. 9).
    RotateSh,
    /// View directions multiplied by Bᵀ, as 3DGS-Avatar and Animatable do.
    ViewBlend,
    /// View directions multiplied by B⁻¹ (up to length): what Bᵀ is sometimes taken for.
    ViewBlendInverse,
    /// View directions multiplied by Rᵀ: the image of `RotateSh` (within 2.4e-7), for nine multiplications per Gaussian and
    /// view. The choice for a pose that is seen once: posing and rendering are 1.26 times faster at degree 3
    /// (`reports/trade`, "Only what a scene requires").
    ViewRotation,
}

/// How colours leave the SH evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum ClampChoice {
    /// At 0 from below, as 3DGS does.
    #[default]
    NonNegative,
    /// To \[0, 1\], as Animatable does.
    Unit,
}

/// The list of choices, `FromStr` and `Display` from a table of ids, each with a line on what it is.
macro_rules! named {
    ($choice:ty, $axis:literal, [$(($id:literal, $variant:ident, $summary:literal)),+ $(,)?]) => {
        impl $choice {
            /// Every choice.
            pub const ALL: [Self; [$($id),+].len()] = [$(Self::$variant),+];

            /// What it is, in a line.
            pub fn summary(self) -> &'static str {
                match self { $(Self::$variant => $summary),+ }
            }
        }

        impl fmt::Display for $choice {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $id),+ })
            }
        }

        impl FromStr for $choice {
            type Err = PosingError;

            fn from_str(id: &str) -> Result<Self, PosingError> {
                match id {
                    $($id => Ok(Self::$variant),)+
                    _ => Err(PosingError::UnknownId {
                        axis: $axis,
                        id: id.to_owned(),
                        expected: [$($id),+].join(", "),
                    }),
                }
            }
        }
    };
}

named!(
    CovarianceChoice,
    "covariance",
    [
        ("rotate", Rotate, "rotated by R"),
        ("affine", Affine, "deformed by the blended matrix B"),
        ("affine-conjugate", AffineConjugate, "deformed by B with R_c transposed: Animatable's kernel"),
        ("push-forward", PushForward, "deformed by J, the derivative of LBS with its weights' gradients"),
        ("push-forward-normal", PushForwardNormal, "the same, the length across the surface kept"),
        ("rotate-by-average", RotateByAverage, "rotated by the quaternion average, whatever R is"),
        ("surfel", Surfel, "rotated by R as the nearest disc of the face, 1 mm thick: iHuman"),
    ]
);
named!(
    ColourChoice,
    "colour",
    [
        ("none", None, "SH left alone: highlights stay fixed in the world"),
        ("rotate-sh", RotateSh, "SH rotated by R (Eq. 9)"),
        (
            "view-blend",
            ViewBlend,
            "the view direction multiplied by the transposed B: 3DGS-Avatar, Animatable"
        ),
        ("view-blend-inverse", ViewBlendInverse, "the view direction multiplied by the inverse of B"),
        (
            "view-rotation",
            ViewRotation,
            "the view direction turned back by R: the image of rotate-sh, cheaper where a pose is seen from few sides"
        ),
    ]
);
named!(
    ClampChoice,
    "clamp",
    [
        ("non-negative", NonNegative, "colours cut at 0 from below: 3DGS"),
        ("unit", Unit, "colours cut to [0, 1]: Animatable"),
    ]
);

impl CovarianceChoice {
    /// True if the covariance is rotated and keeps its shape, so that it has to be told of joints that scale.
    pub(crate) fn keeps_shape(self) -> bool {
        match self {
            Self::Rotate | Self::RotateByAverage | Self::Surfel => true,
            Self::Affine | Self::AffineConjugate | Self::PushForward | Self::PushForwardNormal => false,
        }
    }

    /// How J goes on across the surface, where it is read.
    pub(crate) fn across(self) -> Option<Across> {
        match self {
            Self::PushForward => Some(Across::Constant),
            Self::PushForwardNormal => Some(Across::Normal),
            Self::Rotate | Self::RotateByAverage | Self::Surfel | Self::Affine | Self::AffineConjugate => {
                None
            }
        }
    }
}

impl Strategy {
    /// The ways across the surface in which the derivative of LBS is read: by the rotation, by the covariance.
    pub(crate) fn across(&self) -> [Option<Across>; 2] {
        [self.rotation.across(), self.covariance.across()]
    }

    /// The first joint of a posed body that scales by unequal factors, which a strategy that only rotates Gaussians cannot
    /// follow; `None` if there is none, or the strategy deforms covariances.
    pub fn ignored_scale(&self, body: &PosedBody<'_>) -> Option<usize> {
        self.covariance.keeps_shape().then(|| joints::first_sheared(&body.joints)).flatten()
    }
}

impl From<ClampChoice> for ColourClamp {
    fn from(choice: ClampChoice) -> Self {
        match choice {
            ClampChoice::NonNegative => Self::NonNegative,
            ClampChoice::Unit => Self::Unit,
        }
    }
}
