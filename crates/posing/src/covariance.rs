//! The covariance axis: factors M with Σ = M Mᵀ, a block at a time, forwards and backwards.

use super::CovarianceChoice;
use super::lanes::{self, LANES, Lanes, take};
use super::rotate::BlockInput;
use skinsplat_core::math::{Matrix3, Quaternion, matrix3, rotation};

/// M per lane, row-major, from the posed quaternions or the map that deforms (see [`deforming`]).
#[inline(always)]
pub(super) fn factors(
    choice: CovarianceChoice,
    posed: &[Lanes; 4],
    map: &[Lanes; 9],
    canonical: &[Lanes; 4],
    scales: &[Lanes; 3],
) -> [Lanes; 9] {
    let mut factors = [[0.0; LANES]; 9];
    match choice {
        CovarianceChoice::Rotate | CovarianceChoice::RotateByAverage | CovarianceChoice::Surfel => {
            for lane in 0..LANES {
                let rotation = rotation::quaternion_to_matrix_raw(take(posed, lane));
                put(&mut factors, lane, &rotation, scales);
            }
        }
        CovarianceChoice::Affine
        | CovarianceChoice::AffineConjugate
        | CovarianceChoice::PushForward
        | CovarianceChoice::PushForwardNormal => {
            let sign = if choice == CovarianceChoice::AffineConjugate { -1.0 } else { 1.0 };
            for lane in 0..LANES {
                let [w, x, y, z] = take(canonical, lane);
                let own = rotation::quaternion_to_matrix_raw([w, sign * x, sign * y, sign * z]);
                put(&mut factors, lane, &product(&lanes::matrix(map, lane), &own), scales);
            }
        }
    }
    factors
}

/// What deforms covariances: the blend, or the derivative of LBS where the choice asks for it.
#[inline(always)]
pub(super) fn deforming<'a>(choice: CovarianceChoice, input: &BlockInput<'a>) -> &'a [Lanes; 9] {
    match (choice.across(), input.jacobian) {
        (Some(across), Some(jacobian)) => jacobian.of(across),
        _ => &input.blend.linear,
    }
}

/// Derivatives with respect to what [`factors`] read.
pub(super) struct CovarianceGradient {
    /// Each component of the quaternion by itself: of the posed one if the choice rotates, of R_c if it deforms.
    pub(super) rotation: [Lanes; 4],
    /// Logarithms of the scales.
    pub(super) log_scales: [Lanes; 3],
}

/// From the derivative with respect to M, row-major.
#[inline(always)]
pub(super) fn adjoint(
    choice: CovarianceChoice,
    posed: &[Lanes; 4],
    map: &[Lanes; 9],
    canonical: &[Lanes; 4],
    scales: &[Lanes; 3],
    gradient: &[Lanes; 9],
) -> CovarianceGradient {
    let mut result = CovarianceGradient { rotation: [[0.0; LANES]; 4], log_scales: [[0.0; LANES]; 3] };
    match choice {
        CovarianceChoice::Rotate | CovarianceChoice::RotateByAverage | CovarianceChoice::Surfel => {
            for lane in 0..LANES {
                let q = take(posed, lane);
                let of_matrix = scaled(&lanes::matrix(gradient, lane), scales, lane);
                result.put(lane, q, &of_matrix);
            }
        }
        CovarianceChoice::Affine
        | CovarianceChoice::AffineConjugate
        | CovarianceChoice::PushForward
        | CovarianceChoice::PushForwardNormal => {
            let sign = if choice == CovarianceChoice::AffineConjugate { -1.0 } else { 1.0 };
            for lane in 0..LANES {
                let [w, x, y, z] = take(canonical, lane);
                let of_product = scaled(&lanes::matrix(gradient, lane), scales, lane);
                let of_own = product(&matrix3::transpose(lanes::matrix(map, lane)), &of_product);
                result.put(lane, [w, sign * x, sign * y, sign * z], &of_own);
            }
            for imaginary in &mut result.rotation[1..] {
                imaginary.iter_mut().for_each(|c| *c *= sign);
            }
        }
    }
    result
}

/// The derivative with respect to the deforming map of one lane, G (R_c S)ᵀ, from that with respect to M.
pub(super) fn map_adjoint(
    choice: CovarianceChoice,
    canonical: &[Lanes; 4],
    scales: &[Lanes; 3],
    gradient: &[Lanes; 9],
    lane: usize,
) -> Matrix3<f32> {
    let [w, x, y, z] = take(canonical, lane);
    let sign = if choice == CovarianceChoice::AffineConjugate { -1.0 } else { 1.0 };
    let own = rotation::quaternion_to_matrix_raw([w, sign * x, sign * y, sign * z]);
    let shape = scaled(&own, scales, lane);
    product(&lanes::matrix(gradient, lane), &matrix3::transpose(shape))
}

impl CovarianceGradient {
    /// One lane of `R(q) diag(s)`, from the derivative with respect to R times s.
    #[inline(always)]
    fn put(&mut self, lane: usize, q: Quaternion<f32>, of_rotation: &Matrix3<f32>) {
        let own = rotation::quaternion_to_matrix_raw(q);
        for column in 0..3 {
            self.log_scales[column][lane] = own[0][column] * of_rotation[0][column]
                + own[1][column] * of_rotation[1][column]
                + own[2][column] * of_rotation[2][column];
        }
        lanes::put(&mut self.rotation, lane, rotation::adjoint::quaternion_to_matrix_raw(q, of_rotation));
    }
}

/// `matrix diag(scales)`.
#[inline(always)]
fn scaled(matrix: &Matrix3<f32>, scales: &[Lanes; 3], lane: usize) -> Matrix3<f32> {
    let mut scaled = *matrix;
    for row in 0..3 {
        for column in 0..3 {
            scaled[row][column] *= scales[column][lane];
        }
    }
    scaled
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
