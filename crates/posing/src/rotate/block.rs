//! A block of Gaussians, rotated, and the way back.

use super::super::blend::Blend;
use super::super::joints::Joints;
use super::super::lanes::{LANES, Lanes, identity, multiply, put, take};
use super::super::layout::{Block, Chunk};
use super::{LbsProjection, Source, average, dual, lbs};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::{Quaternion, rotation};

/// How the Gaussians of a block are rotated.
pub(crate) struct Rotated {
    /// R relative to the rest pose, as unit quaternions.
    pub(crate) relative: [Lanes; 4],
    /// The quaternions that are drawn: R ⊗ R_c, of unit length except for [`LbsProjection::MatrixToQuaternionRaw`].
    pub(crate) posed: [Lanes; 4],
    /// The posed means, where the rotation comes with a motion of its own.
    pub(crate) means: Option<[Lanes; 3]>,
}

/// What a rotation of a block may read.
pub(crate) struct BlockInput<'a> {
    pub(crate) joints: &'a Joints,
    pub(crate) chunk: &'a Chunk,
    pub(crate) block: &'a Block,
    /// Index of the chunk's first Gaussian.
    pub(crate) start: usize,
    pub(crate) blend: &'a Blend,
}

impl BlockInput<'_> {
    /// The quaternion average of one lane: what degenerate cases fall back on.
    pub(crate) fn average_of(&self, lane: usize) -> Quaternion<f32> {
        let (indices, weights) = self.chunk.influences(self.block);
        average::of_lane(self.joints, indices, weights, lane, Solver::ClosedForm)
    }

    /// Index of a lane's Gaussian.
    pub(crate) fn gaussian(&self, lane: usize) -> usize {
        self.start + usize::from(self.block.index[lane])
    }

    /// The entries of the block's Gaussians.
    pub(crate) fn gather(&self, quats: &[Quaternion<f32>]) -> [Lanes; 4] {
        let mut gathered = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            put(&mut gathered, lane, quats[self.gaussian(lane)]);
        }
        gathered
    }
}

/// Rotates a block.
#[inline(always)]
pub(crate) fn rotate(arch: pulp::Arch, source: &Source<'_>, input: &BlockInput<'_>) -> Rotated {
    let (indices, weights) = input.chunk.influences(input.block);
    if indices.is_empty() {
        return Rotated { relative: identity(), posed: input.block.rotations, means: None };
    }
    let mut means = None;
    let relative = match source {
        Source::Lbs(
            projection @ (LbsProjection::MatrixToQuaternionRaw | LbsProjection::MatrixToQuaternion),
        ) => {
            return lbs::converted(*projection, input);
        }
        Source::Identity => identity(),
        Source::Lbs(projection) => lbs::projected(*projection, input),
        Source::Average(solver) => {
            average::average(arch, input.joints, indices, weights, input.blend, *solver)
        }
        Source::Dual => {
            let motions = dual::blend(input.joints, indices, weights);
            means = Some(motions.transform(&input.block.means));
            motions.real
        }
        Source::Faces(faces) => faces.of_block(input),
        Source::PerBlock(rotations) => rotations(input),
    };
    let posed = multiply(&relative, &input.block.rotations);
    Rotated { relative, posed, means }
}

/// The derivatives with respect to the canonical quaternions (to first order on the unit sphere) from those with respect
/// to [`Rotated::posed`]. `torque`, with respect to a further rotation of [`Rotated::relative`], is read only where R
/// depends on R_c.
#[inline(always)]
pub(crate) fn rotation_adjoint(
    source: &Source<'_>,
    input: &BlockInput<'_>,
    rotated: &Rotated,
    posed: &[Lanes; 4],
    torque: Option<&[Lanes; 3]>,
) -> [Lanes; 4] {
    match source {
        Source::Lbs(projection) if projection.converts() && !input.block.influences.is_empty() => {
            lbs::converted_adjoint(*projection, input, rotated, posed, torque)
        }
        _ => {
            let mut canonical = [[0.0; LANES]; 4];
            for lane in 0..LANES {
                let back = rotation::conjugate(take(&rotated.relative, lane));
                put(&mut canonical, lane, rotation::multiply(back, take(posed, lane)));
            }
            canonical
        }
    }
}

/// The derivatives with respect to the canonical means where [`Rotated::means`] takes the place of Eq. 6: Rᵀ g.
#[inline(always)]
pub(crate) fn means_adjoint(rotated: &Rotated, gradient: &[Lanes; 3]) -> [Lanes; 3] {
    let mut means = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let back = rotation::quaternion_to_matrix_raw(rotation::conjugate(take(&rotated.relative, lane)));
        for axis in 0..3 {
            means[axis][lane] = back[axis][0] * gradient[0][lane]
                + back[axis][1] * gradient[1][lane]
                + back[axis][2] * gradient[2][lane];
        }
    }
    means
}
