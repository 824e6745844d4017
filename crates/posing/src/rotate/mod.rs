//! The rotation axis: one function per choice, a block at a time.

mod average;
mod dual;
mod faces;
mod lbs;
mod lifted;

pub(super) use faces::{FaceTurns, VertexTurns};

use super::blend::Blend;
use super::joints::Joints;
use super::layout::{Block, Chunk, LANES, Lanes};
use super::{JointLift, LbsProjection, RotationChoice};
use average::splat;
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::{Quaternion, rotation};
use std::borrow::Cow;

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
    /// The joints' rotations with signs.
    Lifted(Cow<'a, JointLift>),
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
        body: &skinsplat_core::scene::PosedBody<'_>,
        surface: Option<&'a super::seat::Surface>,
        lift: Option<&'a JointLift>,
    ) -> Self {
        match (choice, surface) {
            (RotationChoice::Lbs(projection), _) => Self::Lbs(projection),
            (RotationChoice::QuaternionAverage(solver), _) => Self::Average(solver),
            (RotationChoice::LiftedSum, _) => {
                Self::Lifted(lift.map_or_else(|| Cow::Owned(JointLift::from_rest(body)), Cow::Borrowed))
            }
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
        Source::Lifted(lift) => lifted::summed(lift.quaternions(), input),
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

/// The derivatives with respect to the canonical quaternions (to first order on the unit sphere) from those with respect
/// to [`Turn::posed`]. `torque`, with respect to a further rotation of [`Turn::relative`], is read only where R depends
/// on R_c.
#[inline(always)]
pub(super) fn turn_adjoint(
    source: &Source<'_>,
    input: &BlockInput<'_>,
    turn: &Turn,
    posed: &[Lanes; 4],
    torque: Option<&[Lanes; 3]>,
) -> [Lanes; 4] {
    match source {
        Source::Lbs(projection) if projection.converts() && !input.block.influences.is_empty() => {
            lbs::converted_adjoint(*projection, input, turn, posed, torque)
        }
        _ => {
            let mut canonical = [[0.0; LANES]; 4];
            for lane in 0..LANES {
                let back = rotation::conjugate(take(&turn.relative, lane));
                put(&mut canonical, lane, rotation::multiply(back, take(posed, lane)));
            }
            canonical
        }
    }
}

/// The derivatives with respect to the canonical means where [`Turn::means`] takes the place of Eq. 6: Rᵀ g.
#[inline(always)]
pub(super) fn means_adjoint(turn: &Turn, gradient: &[Lanes; 3]) -> [Lanes; 3] {
    let mut means = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let back = rotation::quaternion_to_matrix_raw(rotation::conjugate(take(&turn.relative, lane)));
        for axis in 0..3 {
            means[axis][lane] = back[axis][0] * gradient[0][lane]
                + back[axis][1] * gradient[1][lane]
                + back[axis][2] * gradient[2][lane];
        }
    }
    means
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

/// a + b per lane.
pub(super) fn sum(a: &[Lanes; 4], b: &[Lanes; 4]) -> [Lanes; 4] {
    let mut sum = *a;
    for (sum, b) in sum.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *sum += b;
    }
    sum
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
