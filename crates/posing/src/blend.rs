//! Linear blend skinning of a block (Eq. 6): the blended matrix B and what it does to the means.

use super::joints::Joints;
use super::lanes::{self, LANES, Lanes};
use skinsplat_core::math::Matrix3;

/// The blended affine map of each lane.
pub(super) struct Blend {
    /// B = Σ w_j L_j, row-major.
    pub(super) linear: [Lanes; 9],
    /// Σ w_j t_j, metres.
    pub(super) translation: [Lanes; 3],
    /// Σ w_j.
    pub(super) weight: Lanes,
}

impl Blend {
    /// What Gaussians without joints get.
    pub(super) const IDENTITY: Self = Self {
        linear: {
            let (o, i) = ([0.0; LANES], [1.0; LANES]);
            [i, o, o, o, i, o, o, o, i]
        },
        translation: [[0.0; LANES]; 3],
        weight: [1.0; LANES],
    };

    /// Blends the joints of a block.
    #[inline(always)]
    pub(super) fn new(joints: &Joints, indices: &[u16], weights: &[Lanes]) -> Self {
        if indices.is_empty() {
            return Self::IDENTITY;
        }
        let mut translation = [[0.0; LANES]; 3];
        for (axis, total) in translation.iter_mut().enumerate() {
            *total = sum(indices, weights, |joint| joints.translation[joint][axis]);
        }
        let linear = rotations(&joints.linear, indices, weights);
        Self { linear, translation, weight: sum(indices, weights, |_| 1.0) }
    }

    /// B x + t.
    #[inline(always)]
    pub(super) fn transform(&self, x: &[Lanes; 3]) -> [Lanes; 3] {
        let mut moved = [[0.0; LANES]; 3];
        for row in 0..3 {
            let (a, b, c) = (&self.linear[3 * row], &self.linear[3 * row + 1], &self.linear[3 * row + 2]);
            for lane in 0..LANES {
                let linear = a[lane] * x[0][lane] + b[lane] * x[1][lane] + c[lane] * x[2][lane];
                moved[row][lane] = linear + self.translation[row][lane];
            }
        }
        moved
    }

    /// Bᵀ g.
    #[inline(always)]
    pub(super) fn transform_adjoint(&self, g: &[Lanes; 3]) -> [Lanes; 3] {
        let mut back = [[0.0; LANES]; 3];
        for column in 0..3 {
            let (a, b, c) = (&self.linear[column], &self.linear[3 + column], &self.linear[6 + column]);
            for lane in 0..LANES {
                back[column][lane] = a[lane] * g[0][lane] + b[lane] * g[1][lane] + c[lane] * g[2][lane];
            }
        }
        back
    }

    /// B of one lane.
    #[inline(always)]
    pub(super) fn matrix(&self, lane: usize) -> Matrix3<f32> {
        lanes::matrix(&self.linear, lane)
    }
}

/// Σ w_j M_j.
#[inline(always)]
pub(super) fn rotations(matrices: &[Matrix3<f32>], indices: &[u16], weights: &[Lanes]) -> [Lanes; 9] {
    let mut blend = [[0.0; LANES]; 9];
    for (entry, total) in blend.iter_mut().enumerate() {
        *total = sum(indices, weights, |joint| matrices[joint].as_flattened()[entry]);
    }
    blend
}

/// Σ w_j s_j, the growth of each lane; 1 for Gaussians without joints.
#[inline(never)]
pub(super) fn growth(scales: &[f32], indices: &[u16], weights: &[Lanes]) -> Lanes {
    if indices.is_empty() {
        return [1.0; LANES];
    }
    sum(indices, weights, |joint| scales[joint])
}

/// Σ w_j v_j of one number per joint. A loop over joints for each number, eight lanes at once: all numbers in one loop are more
/// than compilers keep as vectors.
#[inline(always)]
fn sum(indices: &[u16], weights: &[Lanes], of_joint: impl Fn(usize) -> f32) -> Lanes {
    let mut sum = [0.0; LANES];
    for (&joint, weight) in indices.iter().zip(weights) {
        let value = of_joint(usize::from(joint));
        for lane in 0..LANES {
            sum[lane] += weight[lane] * value;
        }
    }
    sum
}
