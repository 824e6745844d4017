//! One number, quaternion or matrix per Gaussian of a block: structures of arrays, so that a loop over lanes is vector code.

use skinsplat_core::math::{Matrix3, Quaternion, rotation};

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

/// One lane of row-major matrices.
#[inline(always)]
pub(crate) fn matrix(entries: &[Lanes; 9], lane: usize) -> Matrix3<f32> {
    let row = |r: usize| [entries[3 * r][lane], entries[3 * r + 1][lane], entries[3 * r + 2][lane]];
    [row(0), row(1), row(2)]
}

/// Sets one lane of row-major matrices.
#[inline(always)]
pub(crate) fn put_matrix(entries: &mut [Lanes; 9], lane: usize, m: &Matrix3<f32>) {
    for row in 0..3 {
        for column in 0..3 {
            entries[3 * row + column][lane] = m[row][column];
        }
    }
}

/// a b per lane.
#[inline(always)]
pub(crate) fn product(a: &[Lanes; 9], b: &[Lanes; 9]) -> [Lanes; 9] {
    let mut product = [[0.0; LANES]; 9];
    for row in 0..3 {
        for column in 0..3 {
            for lane in 0..LANES {
                product[3 * row + column][lane] = a[3 * row][lane] * b[column][lane]
                    + a[3 * row + 1][lane] * b[3 + column][lane]
                    + a[3 * row + 2][lane] * b[6 + column][lane];
            }
        }
    }
    product
}

/// aᵀ per lane.
#[inline(always)]
pub(crate) fn transposed(a: &[Lanes; 9]) -> [Lanes; 9] {
    [a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]]
}
