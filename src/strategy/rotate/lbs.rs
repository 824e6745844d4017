//! The blended matrix B = Σ w_j L_j made a rotation, one Gaussian at a time.

use super::super::LbsProjection;
use super::super::layout::{LANES, Lanes};
use super::average::splat;
use super::{BlockInput, Turn, put, take};
use crate::math::{Quaternion, matrix3, rotation};

/// The projections that need B alone. A rigid joint alone is its own projection.
///
/// Where Gram-Schmidt is ill-posed (two columns or rows parallel, or one zero) the nearest rotation takes its place.
#[inline(never)]
pub(super) fn projected(projection: LbsProjection, input: &BlockInput<'_>) -> [Lanes; 4] {
    let (indices, _) = input.chunk.influences(input.block);
    if let (&[joint], true) = (indices, input.joints.rigid()) {
        return splat(input.joints.rotation[usize::from(joint)]);
    }
    let mut turn = splat(rotation::identity());
    for lane in 0..LANES {
        let b = input.blend.matrix(lane);
        let projected = match projection {
            LbsProjection::GramSchmidtRows => rotation::gram_schmidt_rows(b),
            LbsProjection::Polar => None,
            LbsProjection::GramSchmidtColumns
            | LbsProjection::MatrixToQuaternion
            | LbsProjection::MatrixToQuaternionRaw => rotation::gram_schmidt_columns(b),
        };
        let quat = match projected {
            Some(matrix) => rotation::matrix_to_quaternion(matrix),
            None => nearest(input, lane),
        };
        put(&mut turn, lane, quat);
    }
    turn
}

/// PyTorch3D's quaternion of B R_c, raw or normalised: the posed quaternion itself.
#[inline(never)]
pub(super) fn converted(projection: LbsProjection, input: &BlockInput<'_>) -> Turn {
    let identity = splat(rotation::identity());
    let mut turn = Turn { relative: identity, posed: identity, means: None };
    for lane in 0..LANES {
        let canonical = take(&input.block.rotations, lane);
        let turned =
            matrix3::multiply(input.blend.matrix(lane), rotation::quaternion_to_matrix_raw(canonical));
        let raw = rotation::matrix_to_quaternion_raw(turned);
        let unit = rotation::normalize(raw).unwrap_or(canonical);
        put(&mut turn.relative, lane, rotation::multiply(unit, rotation::conjugate(canonical)));
        put(
            &mut turn.posed,
            lane,
            if projection == LbsProjection::MatrixToQuaternionRaw { raw } else { unit },
        );
    }
    turn
}

/// The rotation nearest to B, computed in `f64`; where several are equally near, the quaternion average's choice.
fn nearest(input: &BlockInput<'_>, lane: usize) -> Quaternion<f32> {
    let b = input.blend.matrix(lane).map(|row| row.map(f64::from));
    rotation::polar(b).map_or_else(|| input.average_of(lane), |q| q.map(|c| c as f32))
}
