//! The colour axis: rotated SH, or frames to read the view direction in.

use super::ColourChoice;
use super::lanes::{Lanes, take};
use super::rotate::BlockInput;
use glam::Mat3;
use skinsplat_core::math::{Matrix3, Quaternion, matrix3, rotation, sh};

/// A determinant this small relative to the cube of the largest entry is no direction to invert along.
const SINGULAR: f32 = 1e-6;

/// The matrix F that takes a world direction to the one in which a lane's SH are read.
///
/// A blend that is zero (B = 0 happens: four half turns about three axes and none) leaves no direction, and one that is
/// singular has no inverse; both are read with the transposed quaternion average of the joints.
pub(super) fn view_frame(
    choice: ColourChoice,
    relative: &[Lanes; 4],
    input: &BlockInput<'_>,
    lane: usize,
) -> Mat3 {
    let b = input.blend.matrix(lane);
    let back = |q| matrix3::transpose(rotation::quaternion_to_matrix_raw(q));
    let frame = match choice {
        ColourChoice::None | ColourChoice::RotateSh => matrix3::identity(),
        ColourChoice::ViewRotation => back(take(relative, lane)),
        ColourChoice::ViewBlend if largest(b) > SINGULAR => matrix3::transpose(b),
        ColourChoice::ViewBlend => back(input.average_of(lane)),
        ColourChoice::ViewBlendInverse => {
            inverse_direction(b).unwrap_or_else(|| back(input.average_of(lane)))
        }
    };
    Mat3::from_cols_array_2d(&matrix3::transpose(frame))
}

/// The derivative with respect to B of one lane, from that with respect to its [`view_frame`]. Lengths of directions do not count,
/// so the derivative is taken to have no part that scales the frame. Zero where another frame takes the place of a singular one,
/// and under choices that do not read B.
pub(super) fn blend_adjoint(choice: ColourChoice, b: Matrix3<f32>, of_frame: &Matrix3<f32>) -> Matrix3<f32> {
    let zero = [[0.0; 3]; 3];
    match choice {
        ColourChoice::None | ColourChoice::RotateSh | ColourChoice::ViewRotation => zero,
        ColourChoice::ViewBlend if largest(b) > SINGULAR => matrix3::transpose(*of_frame),
        ColourChoice::ViewBlend => zero,
        ColourChoice::ViewBlendInverse => {
            let Some(frame) = inverse_direction(b) else { return zero };
            let product = matrix3::multiply(frame, b);
            let multiple = (product[0][0] + product[1][1] + product[2][2]) / 3.0;
            // F = c B⁻¹: δF = −F δB F / c.
            let back = matrix3::transpose(frame);
            let of_blend = matrix3::multiply(matrix3::multiply(back, *of_frame), back);
            of_blend.map(|row| row.map(|entry| -entry / multiple))
        }
    }
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

/// The SH of one Gaussian turned by R (Eq. 9).
#[inline]
pub(super) fn rotate_sh(quat: Quaternion<f32>, degree: usize, input: &[[f32; 3]], output: &mut [[f32; 3]]) {
    output.copy_from_slice(input);
    sh::Rotation::from_unit_quaternion(quat, degree).apply(output);
}

/// Adds to the derivative with respect to the SH of one Gaussian: Dᵀ is the D of the inverse.
#[inline]
pub(super) fn rotate_sh_adjoint(
    quat: Quaternion<f32>,
    degree: usize,
    upstream: &[[f32; 3]],
    gradient: &mut [[f32; 3]],
) {
    let mut back = [[0.0; 3]; sh::count(sh::MAX_DEGREE)];
    let back = &mut back[..upstream.len()];
    rotate_sh(rotation::conjugate(quat), degree, upstream, back);
    add_sh(back, gradient);
}

/// Adds to the derivative with respect to SH that stay.
#[inline]
pub(super) fn add_sh(upstream: &[[f32; 3]], gradient: &mut [[f32; 3]]) {
    for (sum, own) in gradient.as_flattened_mut().iter_mut().zip(upstream.as_flattened()) {
        *sum += own;
    }
}

/// The derivative with respect to a further rotation of SH that R has turned.
pub(super) fn sh_torque(
    quat: Quaternion<f32>,
    degree: usize,
    input: &[[f32; 3]],
    upstream: &[[f32; 3]],
) -> [f32; 3] {
    let mut turned = [[0.0; 3]; sh::count(sh::MAX_DEGREE)];
    let turned = &mut turned[..input.len()];
    rotate_sh(quat, degree, input, turned);
    sh::torque(degree, turned, upstream)
}
