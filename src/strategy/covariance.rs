//! The covariance axis: factors M with Σ = M Mᵀ, a block at a time.

use super::CovarianceChoice;
use super::blend::Blend;
use super::layout::{LANES, Lanes};
use super::rotate::take;
use crate::math::{Matrix3, rotation};

/// M per lane, row-major, from the posed quaternions or the blend.
#[inline(always)]
pub(super) fn factors(
    choice: CovarianceChoice,
    posed: &[Lanes; 4],
    blend: &Blend,
    canonical: &[Lanes; 4],
    scales: &[Lanes; 3],
) -> [Lanes; 9] {
    let mut factors = [[0.0; LANES]; 9];
    match choice {
        CovarianceChoice::Rotate | CovarianceChoice::Surfel => {
            for lane in 0..LANES {
                let rotation = rotation::quaternion_to_matrix_raw(take(posed, lane));
                put(&mut factors, lane, &rotation, scales);
            }
        }
        CovarianceChoice::Affine | CovarianceChoice::AffineConjugate => {
            let sign = if choice == CovarianceChoice::Affine { 1.0 } else { -1.0 };
            for lane in 0..LANES {
                let [w, x, y, z] = take(canonical, lane);
                let own = rotation::quaternion_to_matrix_raw([w, sign * x, sign * y, sign * z]);
                put(&mut factors, lane, &product(&blend.matrix(lane), &own), scales);
            }
        }
    }
    factors
}

/// Sets one lane to `matrix diag(scales)`.
#[inline(always)]
fn put(factors: &mut [Lanes; 9], lane: usize, matrix: &Matrix3<f32>, scales: &[Lanes; 3]) {
    for row in 0..3 {
        for column in 0..3 {
            factors[3 * row + column][lane] = matrix[row][column] * scales[column][lane];
        }
    }
}

/// a b, without the array adaptors that keep a loop from being vectorised.
#[inline(always)]
fn product(a: &Matrix3<f32>, b: &Matrix3<f32>) -> Matrix3<f32> {
    let mut product = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            product[row][column] =
                a[row][0] * b[0][column] + a[row][1] * b[1][column] + a[row][2] * b[2][column];
        }
    }
    product
}
