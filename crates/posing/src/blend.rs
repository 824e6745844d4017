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
        let mut blend =
            Self { linear: [[0.0; LANES]; 9], translation: [[0.0; LANES]; 3], weight: [0.0; LANES] };
        for (&joint, weight) in indices.iter().zip(weights) {
            let joint = usize::from(joint);
            add(&mut blend.linear, &joints.linear[joint], weight);
            for (sum, &t) in blend.translation.iter_mut().zip(&joints.translation[joint]) {
                for lane in 0..LANES {
                    sum[lane] += weight[lane] * t;
                }
            }
            for lane in 0..LANES {
                blend.weight[lane] += weight[lane];
            }
        }
        blend
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

/// Σ w_j R_j where the joints also scale, so that it is not [`Blend::linear`].
#[inline(always)]
pub(super) fn rotations(matrices: &[Matrix3<f32>], indices: &[u16], weights: &[Lanes]) -> [Lanes; 9] {
    let mut sum = [[0.0; LANES]; 9];
    for (&joint, weight) in indices.iter().zip(weights) {
        add(&mut sum, &matrices[usize::from(joint)], weight);
    }
    sum
}

/// Σ w_j s_j, the growth of each lane; 1 for Gaussians without joints.
#[inline(never)]
pub(super) fn growth(scales: &[f32], indices: &[u16], weights: &[Lanes]) -> Lanes {
    if indices.is_empty() {
        return [1.0; LANES];
    }
    let mut sum = [0.0; LANES];
    for (&joint, weight) in indices.iter().zip(weights) {
        let scale = scales[usize::from(joint)];
        for lane in 0..LANES {
            sum[lane] += weight[lane] * scale;
        }
    }
    sum
}

#[inline(always)]
fn add(sum: &mut [Lanes; 9], matrix: &Matrix3<f32>, weight: &Lanes) {
    for (sum, &entry) in sum.iter_mut().zip(matrix.as_flattened()) {
        for lane in 0..LANES {
            sum[lane] += weight[lane] * entry;
        }
    }
}
