//! One number, quaternion or matrix per Gaussian of a block: structures of arrays, so that a loop over lanes is vector code.

use skinsplat_core::math::{Quaternion, rotation};

/// Gaussians per block.
pub(crate) const LANES: usize = 8;

/// One number per Gaussian of a block.
pub(crate) type Lanes = [f32; LANES];

/// One lane.
#[inline(always)]
pub(crate) fn take(quats: &[Lanes; 4], lane: usize) -> Quaternion<f32> {
    [quats[0][lane], quats[1][lane], quats[2][lane], quats[3][lane]]
}

/// Sets one lane.
#[inline(always)]
pub(crate) fn put(quats: &mut [Lanes; 4], lane: usize, q: Quaternion<f32>) {
    for k in 0..4 {
        quats[k][lane] = q[k];
    }
}

/// The same quaternion in every lane.
#[inline(always)]
pub(crate) fn splat(q: Quaternion<f32>) -> [Lanes; 4] {
    [[q[0]; LANES], [q[1]; LANES], [q[2]; LANES], [q[3]; LANES]]
}

/// No rotation.
#[inline(always)]
pub(crate) fn identity() -> [Lanes; 4] {
    splat(rotation::identity())
}

/// a ⊗ b per lane.
#[inline(always)]
pub(crate) fn multiply(a: &[Lanes; 4], b: &[Lanes; 4]) -> [Lanes; 4] {
    let mut product = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        put(&mut product, lane, rotation::multiply(take(a, lane), take(b, lane)));
    }
    product
}

/// a + b per lane.
pub(crate) fn sum(a: &[Lanes; 4], b: &[Lanes; 4]) -> [Lanes; 4] {
    let mut sum = *a;
    for (sum, b) in sum.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *sum += b;
    }
    sum
}
