//! A block of Gaussians: what a rotation reads, and what it answers.

use super::super::blend::{self, Blend};
use super::super::joints::Joints;
use super::super::lanes::{LANES, Lanes, put};
use super::super::layout::{Block, Chunk};
use super::super::push_forward::Jacobian;
use super::average;
use skinsplat_core::math::Quaternion;
use skinsplat_core::math::average::Solver;

/// How the Gaussians of a block are rotated.
pub(crate) struct Rotated {
    /// R relative to the rest pose, as unit quaternions.
    pub(crate) relative: [Lanes; 4],
    /// What R_c is multiplied by where it is drawn: R, or the quaternion average.
    pub(crate) drawn_by: [Lanes; 4],
    /// The quaternions that are drawn: R ⊗ R_c, of unit length except for a raw conversion.
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
    /// Where the strategy reads it.
    pub(crate) jacobian: Option<&'a Jacobian>,
}

impl BlockInput<'_> {
    /// The quaternion average of one lane: what degenerate cases fall back on.
    pub(crate) fn average_of(&self, lane: usize) -> Quaternion<f32> {
        let (indices, weights) = self.chunk.influences(self.block);
        average::of_lane(self.joints, indices, weights, lane, Solver::ClosedForm)
    }

    /// By how much the Gaussians of the block grow with their joints; `None` if no joint scales.
    pub(crate) fn growth(&self) -> Option<Lanes> {
        let scales = self.joints.scale.as_deref()?;
        let (indices, weights) = self.chunk.influences(self.block);
        Some(blend::growth(scales, indices, weights))
    }

    /// Σ w_j R_j, row-major, where the joints also scale; else it is the blended matrix, and `None`.
    pub(crate) fn blended_rotations(&self) -> Option<[Lanes; 9]> {
        let matrices = self.joints.rotation_matrix.as_deref().filter(|_| self.joints.scale.is_some())?;
        let (indices, weights) = self.chunk.influences(self.block);
        Some(blend::rotations(matrices, indices, weights))
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
