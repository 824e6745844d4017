//! The colour axis: rotated SH, or frames to read the view direction in.

use super::ColourChoice;
use super::blend::Blend;
use super::layout::Lanes;
use super::rotate::take;
use crate::math::{Matrix3, matrix3, rotation, sh};
use glam::Mat3;

/// A determinant this small relative to the cube of the largest entry is no direction to invert along.
const SINGULAR: f32 = 1e-6;

/// The matrix F that takes a world direction to the one in which a lane's SH are read; `None` if the choice has none.
///
/// A blend that is zero (B = 0 happens: four half turns about three axes and none) leaves no direction, and one that is
/// singular has no inverse; both are read with Rᵀ.
#[inline(always)]
pub(super) fn view_frame(
    choice: ColourChoice,
    relative: &[Lanes; 4],
    blend: &Blend,
    lane: usize,
) -> Option<Mat3> {
    let turned = || matrix3::transpose(rotation::quaternion_to_matrix_raw(take(relative, lane)));
    let frame = match choice {
        ColourChoice::None | ColourChoice::RotateSh => return None,
        ColourChoice::ViewRotation => turned(),
        ColourChoice::ViewBlend => {
            let b = blend.matrix(lane);
            if largest(b) > SINGULAR { matrix3::transpose(b) } else { turned() }
        }
        ColourChoice::ViewBlendInverse => inverse_direction(blend.matrix(lane)).unwrap_or_else(turned),
    };
    Some(Mat3::from_cols_array_2d(&matrix3::transpose(frame)))
}

fn largest(m: Matrix3<f32>) -> f32 {
    m.as_flattened().iter().fold(0.0, |largest: f32, entry| largest.max(entry.abs()))
}

/// A positive multiple of the inverse.
fn inverse_direction(m: Matrix3<f32>) -> Option<Matrix3<f32>> {
    let scale = largest(m);
    let [a, b, c] = m.map(|row| row.map(|entry| entry / scale));
    let cofactors = [matrix3::cross(b, c), matrix3::cross(c, a), matrix3::cross(a, b)];
    let determinant = matrix3::dot(a, cofactors[0]);
    let sign = 1.0f32.copysign(determinant);
    let adjugate = matrix3::transpose(cofactors).map(|row| row.map(|entry| entry * sign));
    (scale > SINGULAR && determinant.abs() > SINGULAR).then_some(adjugate)
}

/// SH of a lane turned by R (Eq. 9): `input` and `output` hold the coefficients of one Gaussian.
#[inline(always)]
pub(super) fn rotate_sh(
    relative: &[Lanes; 4],
    lane: usize,
    degree: usize,
    input: &[[f32; 3]],
    output: &mut [[f32; 3]],
) {
    output.copy_from_slice(input);
    sh::Rotation::from_unit_quaternion(take(relative, lane), degree).apply(output);
}
