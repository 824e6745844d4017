//! The rotation axis: every choice in one list, and what each is read from in a pose.
//!
//! A further choice is a variant, a row and an arm of [`Source::new`] here (the compiler asks for all three), and one
//! function in a file of its own: from [`BlockInput`] to R of eight Gaussians.

mod average;
mod block;
mod dispatch;
mod dual;
mod faces;
mod faces_adjoint;
mod lbs;
mod lifted;
mod polar;
mod to_joints;

pub(crate) use block::{BlockInput, Rotated};
pub(crate) use dispatch::{drawn_adjoint, means_adjoint, rotate, rotate_by_average, rotation_adjoint};
pub(crate) use faces_adjoint::{FaceSums, OfFace, to_centroid};
pub use lbs::LbsProjection;
pub(crate) use lbs::{blend_adjoint, projection_adjoint};
pub(crate) use polar::adjoint as polar_adjoint;
pub(crate) use to_joints::torques_to_joints;

use super::face_frame::FaceFrame;
use super::joints::Joints;
use super::lanes::Lanes;
use super::surface::Surface;
use super::{Across, JointLift, PosingError};
use faces::{FaceRotations, VertexRotations};
use skinsplat_core::math::Quaternion;
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::scene::PosedBody;
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

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
    /// The normalised sum of the joints' quaternions with signs that belong together ([`JointLift`]): as the average for
    /// nearby joints, and continuous where that jumps.
    LiftedSum,
    /// The normalised sum of the joints' quaternions with w ≥ 0 each, signs not aligned: what an engine does that sums
    /// quaternions as its matrices give them. Wrong where two of them end in opposite hemispheres.
    JointSum,
    /// The rotation nearest to J, the derivative of LBS with its weights' gradients: the rotation of the posed surface.
    PushForward(Across),
    /// Dual-quaternion blending; the mean of a Gaussian with weights of its own follows it too.
    DualQuaternion,
}

/// A rotation choice with an id of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedRotation {
    /// Stable id.
    pub id: &'static str,
    /// What it is, in a line.
    pub summary: &'static str,
    /// The choice.
    pub choice: RotationChoice,
}

/// [`RotationChoice::NAMED`] and the ids, from one list. A choice that is not in it does not compile.
macro_rules! named_rotations {
    ($(($id:literal, $summary:literal, $($choice:tt)+)),+ $(,)?) => {
        impl RotationChoice {
            /// The choices whose id takes no parameter. The ids of [`Solver`] stand for
            /// [`RotationChoice::QuaternionAverage`], and `vertex-average-` may be followed by one.
            pub const NAMED: [NamedRotation; [$($id),+].len()] =
                [$(NamedRotation { id: $id, summary: $summary, choice: Self::$($choice)+ }),+];
        }

        impl fmt::Display for RotationChoice {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match self {
                    $(Self::$($choice)+ => f.write_str($id),)+
                    Self::QuaternionAverage(solver) => write!(f, "{solver}"),
                    Self::VertexAverage(solver) => write!(f, "{VERTEX_AVERAGE}{solver}"),
                }
            }
        }
    };
}

named_rotations![
    (
        "gram-schmidt-columns",
        "Gram-Schmidt over the columns of the blended matrix",
        Lbs(LbsProjection::GramSchmidtColumns)
    ),
    (
        "gram-schmidt-rows",
        "Gram-Schmidt over the rows of the blended matrix",
        Lbs(LbsProjection::GramSchmidtRows)
    ),
    (
        "matrix-to-quaternion-raw",
        "PyTorch3D's quaternion of B R_c, not normalised: HUGS",
        Lbs(LbsProjection::MatrixToQuaternionRaw)
    ),
    (
        "matrix-to-quaternion",
        "PyTorch3D's quaternion of B R_c, normalised",
        Lbs(LbsProjection::MatrixToQuaternion)
    ),
    (
        "lbs-polar",
        "the rotation nearest to the blended matrix (the quaternion average, by another road)",
        Lbs(LbsProjection::Polar)
    ),
    (
        "face-splattingavatar",
        "the tangent frame of the face, along its first edge",
        FaceFrame(FaceFrame::SplattingAvatar)
    ),
    ("face-ihuman", "iHuman's frame of the face: the same rotation", FaceFrame(FaceFrame::IHuman)),
    ("face-haha", "HAHA's frame of the face, along its second edge", FaceFrame(FaceFrame::Haha)),
    (
        "face-haha-scaled",
        "HAHA's frame; means and scales follow the size of the face too",
        FaceFrame(FaceFrame::HahaScaled)
    ),
    (
        "vertex-average",
        "Eq. 7 at the vertices, and again over the face with barycentric weights",
        VertexAverage(Solver::ClosedForm)
    ),
    (
        "vertex-quaternions-w",
        "face rotations summed at vertices and over the face, w at least 0: SplattingAvatar",
        VertexQuaternions(SignPolicy::NonNegativeW)
    ),
    (
        "vertex-quaternions-largest",
        "the same, the largest component positive",
        VertexQuaternions(SignPolicy::LargestPositive)
    ),
    (
        "vertex-quaternions-align",
        "the same, signs aligned to the first",
        VertexQuaternions(SignPolicy::AlignToFirst)
    ),
    ("lifted-sum", "joint quaternions summed with signs that belong together: no jump at 180°", LiftedSum),
    (
        "sum-w",
        "joint quaternions summed with w at least 0 each, signs not aligned: an engine's mistake",
        JointSum
    ),
    (
        "push-forward",
        "the rotation nearest to J, the derivative of LBS with its weights' gradients",
        PushForward(Across::Constant)
    ),
    (
        "push-forward-normal",
        "the same, the normal of the surface carried to the posed one",
        PushForward(Across::Normal)
    ),
    ("dual-quaternion", "dual-quaternion blending, of the mean too", DualQuaternion),
];

/// What goes before the id of a solver.
const VERTEX_AVERAGE: &str = "vertex-average-";

impl RotationChoice {
    /// The choices of [`Self::NAMED`].
    pub fn named() -> impl Iterator<Item = Self> + Clone {
        Self::NAMED.into_iter().map(|named| named.choice)
    }

    /// True if R is read from the posed mesh or from the face of the Gaussian.
    pub fn needs_faces(self) -> bool {
        match self {
            Self::FaceFrame(_)
            | Self::VertexAverage(_)
            | Self::VertexQuaternions(_)
            | Self::PushForward(_) => true,
            Self::Lbs(_)
            | Self::QuaternionAverage(_)
            | Self::LiftedSum
            | Self::JointSum
            | Self::DualQuaternion => false,
        }
    }

    /// True if the mean of a Gaussian with weights of its own follows R, not Eq. 6.
    pub(crate) fn moves_means(self) -> bool {
        match self {
            Self::DualQuaternion | Self::FaceFrame(FaceFrame::HahaScaled) => true,
            Self::Lbs(_)
            | Self::FaceFrame(_)
            | Self::QuaternionAverage(_)
            | Self::VertexAverage(_)
            | Self::VertexQuaternions(_)
            | Self::PushForward(_)
            | Self::JointSum
            | Self::LiftedSum => false,
        }
    }

    /// How J goes on across the surface, where it is read.
    pub(crate) fn across(self) -> Option<Across> {
        if let Self::PushForward(across) = self { Some(across) } else { None }
    }
}

impl FromStr for RotationChoice {
    type Err = PosingError;

    fn from_str(id: &str) -> Result<Self, PosingError> {
        if let Some(named) = Self::NAMED.iter().find(|named| named.id == id) {
            return Ok(named.choice);
        }
        let unknown = |_| {
            let forms = Solver::FORMS.map(|(form, _)| form).join(", ");
            let named = Self::NAMED.map(|named| named.id).join(", ");
            let expected = format!("{forms}, {VERTEX_AVERAGE}SOLVER, {named}");
            PosingError::UnknownId { axis: "rotation", id: id.to_owned(), expected }
        };
        match id.strip_prefix(VERTEX_AVERAGE) {
            Some(solver) => solver.parse().map(Self::VertexAverage).map_err(unknown),
            None => id.parse().map(Self::QuaternionAverage).map_err(unknown),
        }
    }
}

impl TryFrom<String> for RotationChoice {
    type Error = PosingError;

    fn try_from(id: String) -> Result<Self, PosingError> {
        id.parse()
    }
}

impl From<RotationChoice> for String {
    fn from(choice: RotationChoice) -> Self {
        choice.to_string()
    }
}

/// R of a block's lanes, as unit quaternions.
type BlockRotations<'a> = dyn Fn(&BlockInput<'_>) -> [Lanes; 4] + Sync + 'a;

/// What R is read from in one pose, besides the blend.
pub(crate) enum Source<'a> {
    /// Nothing: no Gaussian moves, or nobody asks how it is rotated.
    Identity,
    /// The blended matrix.
    Lbs(LbsProjection),
    /// The joints' rotations.
    Average(Solver),
    /// The joints' rigid motions.
    Dual,
    /// One rotation per face.
    Faces(FaceRotations<'a>),
    /// The derivative of LBS.
    PushForward(Across),
    /// One rotation per vertex, combined over the face.
    Vertices(VertexRotations<'a>),
    /// Joint quaternions with signs that belong together.
    Lifted(Cow<'a, JointLift>),
    /// Anything else: R of each lane, as unit quaternions. No pose is followed through it.
    PerBlock(Box<BlockRotations<'a>>),
}

impl<'a> Source<'a> {
    /// Everything that is computed once per pose. An avatar that knows no faces must be one that does not move.
    pub(crate) fn new(
        choice: RotationChoice,
        joints: &Joints,
        body: &PosedBody<'_>,
        surface: Option<&'a Surface>,
        lift: Option<&'a JointLift>,
    ) -> Self {
        let on = |made: &dyn Fn(&'a Surface) -> Self| surface.map_or(Self::Identity, made);
        match choice {
            RotationChoice::Lbs(projection) => Self::Lbs(projection),
            RotationChoice::QuaternionAverage(solver) => Self::Average(solver),
            RotationChoice::DualQuaternion => Self::Dual,
            RotationChoice::PushForward(across) => Self::PushForward(across),
            RotationChoice::FaceFrame(kind) => {
                on(&|surface| Self::Faces(FaceRotations::new(kind, body, surface)))
            }
            RotationChoice::VertexAverage(solver) => {
                on(&|surface| Self::Vertices(VertexRotations::averaged(solver, joints, body, surface)))
            }
            RotationChoice::VertexQuaternions(policy) => {
                on(&|surface| Self::Vertices(VertexRotations::summed(policy, body, surface)))
            }
            RotationChoice::JointSum => Self::Lifted(Cow::Owned(JointLift::with_positive_w(body))),
            RotationChoice::LiftedSum => {
                Self::Lifted(lift.map_or_else(|| Cow::Owned(JointLift::from_rest(body)), Cow::Borrowed))
            }
        }
    }

    /// Rotations that somebody else has computed, one per Gaussian.
    pub(crate) fn given(rotations: &'a [Quaternion<f32>]) -> Self {
        Self::per_block(move |input| input.gather(rotations))
    }

    fn per_block(rotations: impl Fn(&BlockInput<'_>) -> [Lanes; 4] + Sync + 'a) -> Self {
        Self::PerBlock(Box::new(rotations))
    }

    /// True if the drawn quaternion is read from B R_c, so that R depends on R_c.
    pub(crate) fn converts(&self) -> bool {
        matches!(self, Self::Lbs(projection) if projection.converts())
    }

    /// How J goes on across the surface, where R is read from it, so that R depends on the mean.
    pub(crate) fn across(&self) -> Option<Across> {
        if let Self::PushForward(across) = self { Some(*across) } else { None }
    }

    /// True if the quaternion that is drawn is not of unit length.
    pub(crate) fn is_raw(&self) -> bool {
        matches!(self, Self::Lbs(LbsProjection::MatrixToQuaternionRaw))
    }

    /// True if the mean of a Gaussian with weights of its own follows R, not Eq. 6.
    pub(crate) fn moves_means(&self) -> bool {
        matches!(self, Self::Dual) || self.scaled_faces().is_some()
    }

    /// The rotations of the faces, where means and scales follow the faces' size.
    pub(crate) fn scaled_faces(&self) -> Option<&FaceRotations<'a>> {
        match self {
            Self::Faces(faces) if faces.kind == FaceFrame::HahaScaled => Some(faces),
            _ => None,
        }
    }
}
