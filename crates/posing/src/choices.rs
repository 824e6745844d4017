//! The axes of a strategy as plain data: closed enums, each variant with a stable id.

use super::StrategyError;
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::scene::ColourClamp;
use std::fmt;
use std::str::FromStr;

/// How Gaussians turn, spread and shine when a body moves.
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

/// How the blend B is made a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LbsProjection {
    /// Gram-Schmidt over the columns, the first kept in direction.
    GramSchmidtColumns,
    /// Gram-Schmidt over the rows, the first kept in direction.
    GramSchmidtRows,
    /// PyTorch3D's conversion of B·R_c, *not* normalised, drawn as the 3DGS kernels do: HUGS. Not a rotation.
    MatrixToQuaternionRaw,
    /// The same conversion of B·R_c, normalised.
    MatrixToQuaternion,
    /// The nearest rotation (SVD with the determinant corrected). On rigid joints this *is* the quaternion average.
    Polar,
}

/// Orthonormal frames on a triangle, from one edge and the normal. R is the posed frame times the transposed rest frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceFrame {
    /// Tangent v0→v1, columns \[d×n, −n, d\].
    SplattingAvatar,
    /// Tangent v1→v0, columns \[n, r1, r2\] turned in the plane. The turn is constant, so R is that of SplattingAvatar.
    IHuman,
    /// Tangent v1→v2, columns \[e1, n, e1×n\].
    Haha,
    /// HAHA in full: means and scales also follow the size k of the triangle, measured from its centroid.
    HahaScaled,
}

/// Where the rotation R of a Gaussian relative to its canonical orientation comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "String", into = "String"))]
pub enum RotationChoice {
    /// The LBS matrix, made a rotation.
    Lbs(LbsProjection),
    /// The frame of the face that the Gaussian sits on (or is nearest to in the rest pose).
    FaceFrame(FaceFrame),
    /// Eq. 7: the average of the joints' rotations with the skinning weights.
    QuaternionAverage(Solver),
    /// Eq. 7 per vertex, then again over the three vertices of the face with barycentric weights (paper §4.2, §4.3).
    VertexAverage(Solver),
    /// SplattingAvatar: face rotations summed at vertices (rest areas), vertex quaternions summed barycentrically.
    VertexQuaternions(SignPolicy),
    /// The normalised sum of the joints' quaternions with signs that belong together ([`JointLift`](super::JointLift)):
    /// as the average for nearby joints, and continuous where that jumps.
    LiftedSum,
    /// Dual-quaternion blending; the mean of a Gaussian with weights of its own follows it too.
    DualQuaternion,
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

/// The ids of [`Solver`].
const SOLVERS: &str = "closed-form, eigen, polar, nlerp, power-N[-START], squaring-N";

impl RotationChoice {
    /// The choices whose id takes no parameter. The ids of [`Solver`] stand for [`RotationChoice::QuaternionAverage`],
    /// and `vertex-average-` may be followed by one.
    pub const NAMED: [Self; 15] = [
        Self::Lbs(LbsProjection::GramSchmidtColumns),
        Self::Lbs(LbsProjection::GramSchmidtRows),
        Self::Lbs(LbsProjection::MatrixToQuaternionRaw),
        Self::Lbs(LbsProjection::MatrixToQuaternion),
        Self::Lbs(LbsProjection::Polar),
        Self::FaceFrame(FaceFrame::SplattingAvatar),
        Self::FaceFrame(FaceFrame::IHuman),
        Self::FaceFrame(FaceFrame::Haha),
        Self::FaceFrame(FaceFrame::HahaScaled),
        Self::VertexAverage(Solver::ClosedForm),
        Self::VertexQuaternions(SignPolicy::NonNegativeW),
        Self::VertexQuaternions(SignPolicy::LargestPositive),
        Self::VertexQuaternions(SignPolicy::AlignToFirst),
        Self::LiftedSum,
        Self::DualQuaternion,
    ];

    /// True if R is read from the posed mesh or from the face of the Gaussian.
    pub fn needs_faces(self) -> bool {
        match self {
            Self::FaceFrame(_) | Self::VertexAverage(_) | Self::VertexQuaternions(_) => true,
            Self::Lbs(_) | Self::QuaternionAverage(_) | Self::LiftedSum | Self::DualQuaternion => false,
        }
    }
}

impl fmt::Display for RotationChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lbs(LbsProjection::GramSchmidtColumns) => "gram-schmidt-columns",
            Self::Lbs(LbsProjection::GramSchmidtRows) => "gram-schmidt-rows",
            Self::Lbs(LbsProjection::MatrixToQuaternionRaw) => "matrix-to-quaternion-raw",
            Self::Lbs(LbsProjection::MatrixToQuaternion) => "matrix-to-quaternion",
            Self::Lbs(LbsProjection::Polar) => "lbs-polar",
            Self::FaceFrame(FaceFrame::SplattingAvatar) => "face-splattingavatar",
            Self::FaceFrame(FaceFrame::IHuman) => "face-ihuman",
            Self::FaceFrame(FaceFrame::Haha) => "face-haha",
            Self::FaceFrame(FaceFrame::HahaScaled) => "face-haha-scaled",
            Self::QuaternionAverage(solver) => return write!(f, "{solver}"),
            Self::VertexAverage(Solver::ClosedForm) => "vertex-average",
            Self::VertexAverage(solver) => return write!(f, "vertex-average-{solver}"),
            Self::VertexQuaternions(SignPolicy::NonNegativeW) => "vertex-quaternions-w",
            Self::VertexQuaternions(SignPolicy::LargestPositive) => "vertex-quaternions-largest",
            Self::VertexQuaternions(SignPolicy::AlignToFirst) => "vertex-quaternions-align",
            Self::LiftedSum => "lifted-sum",
            Self::DualQuaternion => "dual-quaternion",
        })
    }
}

impl FromStr for RotationChoice {
    type Err = StrategyError;

    fn from_str(id: &str) -> Result<Self, StrategyError> {
        if let Some(choice) = Self::NAMED.iter().find(|choice| choice.to_string() == id) {
            return Ok(*choice);
        }
        let unknown = || {
            let named = Self::NAMED.map(|choice| choice.to_string()).join(", ");
            let expected = format!("{SOLVERS}, vertex-average-SOLVER, {named}");
            StrategyError::UnknownId { axis: "rotation", id: id.to_owned(), expected }
        };
        match id.strip_prefix("vertex-average-") {
            Some(solver) => solver.parse().ok().map(Self::VertexAverage).ok_or_else(unknown),
            None => id.parse().ok().map(Self::QuaternionAverage).ok_or_else(unknown),
        }
    }
}

impl TryFrom<String> for RotationChoice {
    type Error = StrategyError;

    fn try_from(id: String) -> Result<Self, StrategyError> {
        id.parse()
    }
}

impl From<RotationChoice> for String {
    fn from(choice: RotationChoice) -> Self {
        choice.to_string()
    }
}

/// The list of choices, `FromStr` and `Display` from a table of ids.
macro_rules! named {
    ($choice:ty, $axis:literal, [$(($id:literal, $variant:ident)),+ $(,)?]) => {
        impl $choice {
            /// Every choice.
            pub const ALL: [Self; [$($id),+].len()] = [$(Self::$variant),+];
        }

        impl fmt::Display for $choice {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $id),+ })
            }
        }

        impl FromStr for $choice {
            type Err = StrategyError;

            fn from_str(id: &str) -> Result<Self, StrategyError> {
                match id {
                    $($id => Ok(Self::$variant),)+
                    _ => Err(StrategyError::UnknownId {
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
    [("rotate", Rotate), ("affine", Affine), ("affine-conjugate", AffineConjugate), ("surfel", Surfel),]
);
named!(
    ColourChoice,
    "colour",
    [
        ("none", None),
        ("rotate-sh", RotateSh),
        ("view-blend", ViewBlend),
        ("view-blend-inverse", ViewBlendInverse),
        ("view-rotation", ViewRotation),
    ]
);
named!(ClampChoice, "clamp", [("non-negative", NonNegative), ("unit", Unit)]);

impl From<ClampChoice> for ColourClamp {
    fn from(choice: ClampChoice) -> Self {
        match choice {
            ClampChoice::NonNegative => Self::NonNegative,
            ClampChoice::Unit => Self::Unit,
        }
    }
}
