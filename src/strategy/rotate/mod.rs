//! The rotation axis: one function per choice, a block at a time.

mod average;
mod dual;
mod faces;
mod lbs;

pub(super) use faces::{FaceTurns, VertexTurns};

use super::blend::Blend;
use super::joints::Joints;
use super::layout::{Block, Chunk, LANES, Lanes};
use super::{LbsProjection, RotationChoice};
use crate::math::average::Solver;
use crate::math::{Quaternion, rotation};
use average::splat;

/// How the Gaussians of a block turn.
pub(super) struct Turn {
    /// R relative to the rest pose, as unit quaternions.
    pub(super) relative: [Lanes; 4],
    /// The quaternions that are drawn: R ⊗ R_c, of unit length except for [`LbsProjection::MatrixToQuaternionRaw`].
    pub(super) posed: [Lanes; 4],
    /// The posed means, where the rotation comes with a motion of its own.
    pub(super) means: Option<[Lanes; 3]>,
}

/// What the rotation of a pose is read from, besides the blend.
pub(super) enum Source<'a> {
    /// Nothing: no Gaussian moves, or nobody asks how it turns.
    Identity,
    /// The blended matrix.
    Lbs(LbsProjection),
    /// The joints' rotations.
    Average(Solver),
    /// The joints' rigid motions.
    Dual,
    /// One rotation per face.
    Faces(FaceTurns<'a>),
    /// One rotation per vertex, combined over a face.
    Vertices(VertexTurns<'a>),
}

impl<'a> Source<'a> {
    /// Everything that is computed once per pose. An avatar that knows no faces must be one that does not move.
    pub(super) fn new(
        choice: RotationChoice,
        joints: &Joints,
        body: &crate::scene::PosedBody<'_>,
        surface: Option<&'a super::seat::Surface>,
    ) -> Self {
        match (choice, surface) {
            (RotationChoice::Lbs(projection), _) => Self::Lbs(projection),
            (RotationChoice::QuaternionAverage(solver), _) => Self::Average(solver),
            (RotationChoice::DualQuaternion, _) => Self::Dual,
            (RotationChoice::FaceFrame(kind), Some(surface)) => {
                Self::Faces(FaceTurns::new(kind, body, surface))
            }
            (RotationChoice::VertexAverage(solver), Some(surface)) => {
                Self::Vertices(VertexTurns::averaged(solver, joints, body, surface))
            }
            (RotationChoice::VertexQuaternions(policy), Some(surface)) => {
                Self::Vertices(VertexTurns::summed(policy, body, surface))
            }
            (
                RotationChoice::FaceFrame(_)
                | RotationChoice::VertexAverage(_)
                | RotationChoice::VertexQuaternions(_),
                None,
            ) => Self::Identity,
        }
    }
}

/// What a block is turned with.
pub(super) struct BlockInput<'a> {
    pub(super) joints: &'a Joints,
    pub(super) chunk: &'a Chunk,
    pub(super) block: &'a Block,
    /// Index of the chunk's first Gaussian.
    pub(super) start: usize,
    pub(super) blend: &'a Blend,
}

impl BlockInput<'_> {
    /// The quaternion average of one lane: what degenerate cases fall back on.
    pub(super) fn average_of(&self, lane: usize) -> Quaternion<f32> {
        let (indices, weights) = self.chunk.influences(self.block);
        average::of_lane(self.joints, indices, weights, lane, Solver::ClosedForm)
    }

    /// Index of a lane's Gaussian.
    pub(super) fn gaussian(&self, lane: usize) -> usize {
        self.start + usize::from(self.block.index[lane])
    }
}

/// Turns a block.
#[inline(always)]
pub(super) fn turn(arch: pulp::Arch, source: &Source<'_>, input: &BlockInput<'_>) -> Turn {
    let (indices, weights) = input.chunk.influences(input.block);
    if indices.is_empty() {
        return Turn { relative: splat(rotation::identity()), posed: input.block.rotations, means: None };
    }
    let mut means = None;
    let relative = match source {
        Source::Lbs(
            projection @ (LbsProjection::MatrixToQuaternionRaw | LbsProjection::MatrixToQuaternion),
        ) => {
            return lbs::converted(*projection, input);
        }
        Source::Identity => splat(rotation::identity()),
        Source::Lbs(projection) => lbs::projected(*projection, input),
        Source::Average(solver) => {
            average::average(arch, input.joints, indices, weights, input.blend, *solver)
        }
        Source::Dual => {
            let motions = dual::blend(input.joints, indices, weights);
            means = Some(motions.transform(&input.block.means));
            motions.real
        }
        Source::Faces(turns) => turns.of_block(input),
        Source::Vertices(turns) => turns.of_block(input),
    };
    let posed = multiply(&relative, &input.block.rotations);
    Turn { relative, posed, means }
}

/// a ⊗ b per lane.
#[inline(always)]
fn multiply(a: &[Lanes; 4], b: &[Lanes; 4]) -> [Lanes; 4] {
    let mut product = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        put(&mut product, lane, rotation::multiply(take(a, lane), take(b, lane)));
    }
    product
}

/// One lane.
#[inline(always)]
pub(super) fn take(quats: &[Lanes; 4], lane: usize) -> Quaternion<f32> {
    [quats[0][lane], quats[1][lane], quats[2][lane], quats[3][lane]]
}

/// Sets one lane.
#[inline(always)]
pub(super) fn put(quats: &mut [Lanes; 4], lane: usize, q: Quaternion<f32>) {
    for k in 0..4 {
        quats[k][lane] = q[k];
    }
}
