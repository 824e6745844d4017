//! The blended matrix B = Σ w_j L_j made a rotation, one Gaussian at a time.

use super::super::lanes::{LANES, Lanes, identity, put, splat, take};
use super::{BlockInput, Rotated};
use skinsplat_core::math::{Quaternion, dot4, matrix3, rotation};

/// How the blend B is made a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LbsProjection {
    /// Gram-Schmidt over the columns, the first kept in direction.
    GramSchmidtColumns,
    /// Gram-Schmidt over the rows, the first kept in direction.
    GramSchmidtRows,
    /// PyTorch3D's conversion of B·R_c, *not* normalised, drawn as the 3DGS kernels do: HUGS. Not a rotation.
    MatrixToQuaternionRaw,
    /// The same conversion of B·R_c, normalised.
    MatrixToQuaternion,
    /// The nearest rotation (SVD with the determinant corrected). On rigid joints this *is* the quaternion average.
    Polar,
}

impl LbsProjection {
    /// True if it projects B R_c, not B.
    pub(crate) fn converts(self) -> bool {
        match self {
            Self::MatrixToQuaternionRaw | Self::MatrixToQuaternion => true,
            Self::GramSchmidtColumns | Self::GramSchmidtRows | Self::Polar => false,
        }
    }
}

/// The projections that need B alone. A rigid joint alone is its own projection.
///
/// Where Gram-Schmidt is ill-posed (two columns or rows parallel, or one zero) the nearest rotation takes its place.
#[inline(never)]
pub(super) fn projected(projection: LbsProjection, input: &BlockInput<'_>) -> [Lanes; 4] {
    let (indices, _) = input.chunk.influences(input.block);
    if let (&[joint], true) = (indices, input.joints.rigid()) {
        return splat(input.joints.rotation[usize::from(joint)]);
    }
    let mut relative = identity();
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
        put(&mut relative, lane, quat);
    }
    relative
}

/// PyTorch3D's quaternion of B R_c, raw or normalised: the posed quaternion itself.
#[inline(never)]
pub(super) fn converted(projection: LbsProjection, input: &BlockInput<'_>) -> Rotated {
    let mut rotated = Rotated { relative: identity(), posed: identity(), means: None };
    for lane in 0..LANES {
        let canonical = take(&input.block.rotations, lane);
        let turned =
            matrix3::multiply(input.blend.matrix(lane), rotation::quaternion_to_matrix_raw(canonical));
        let raw = rotation::matrix_to_quaternion_raw(turned);
        let unit = rotation::normalize(raw).unwrap_or(canonical);
        put(&mut rotated.relative, lane, rotation::multiply(unit, rotation::conjugate(canonical)));
        put(
            &mut rotated.posed,
            lane,
            if projection == LbsProjection::MatrixToQuaternionRaw { raw } else { unit },
        );
    }
    rotated
}

/// [`converted`] walked backwards, through B R_c. See [`super::rotation_adjoint`].
#[inline(never)]
pub(super) fn converted_adjoint(
    projection: LbsProjection,
    input: &BlockInput<'_>,
    rotated: &Rotated,
    posed: &[Lanes; 4],
    torque: Option<&[Lanes; 3]>,
) -> [Lanes; 4] {
    let mut result = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        let (canonical, of_posed) = (take(&input.block.rotations, lane), take(posed, lane));
        let b = input.blend.matrix(lane);
        let turned = matrix3::multiply(b, rotation::quaternion_to_matrix_raw(canonical));
        let raw = rotation::matrix_to_quaternion_raw(turned);
        let Some(unit) = rotation::normalize(raw) else {
            put(&mut result, lane, of_posed);
            continue;
        };
        let of_length = |of_unit| rotation::adjoint::normalize(unit, 1.0 / dot4(unit, raw), of_unit);
        let raw_is_drawn = projection == LbsProjection::MatrixToQuaternionRaw;
        let mut of_raw = if raw_is_drawn { of_posed } else { of_length(of_posed) };
        let mut of_canonical = [0.0; 4];
        if let Some(torque) = torque {
            // R = unit ⊗ R_c⁻¹: rotating R_c on rotates R back, seen from where R starts.
            let torque = [0, 1, 2].map(|axis: usize| torque[axis][lane]);
            let relative = rotation::conjugate(take(&rotated.relative, lane));
            let back = matrix3::apply(rotation::quaternion_to_matrix_raw(relative), torque).map(|t| -t);
            of_raw = sum(of_raw, of_length(rotation::adjoint::from_torque(unit, torque)));
            of_canonical = rotation::adjoint::from_torque(canonical, back);
        }
        let of_turned = rotation::adjoint::matrix_to_quaternion_raw(turned, of_raw);
        let of_own = matrix3::multiply(matrix3::transpose(b), of_turned);
        let through_turned = rotation::adjoint::quaternion_to_matrix_raw(canonical, &of_own);
        put(&mut result, lane, sum(of_canonical, through_turned));
    }
    result
}

fn sum(a: Quaternion<f32>, b: Quaternion<f32>) -> Quaternion<f32> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

/// The rotation nearest to B, computed in `f64`; where several are equally near, the quaternion average's choice.
fn nearest(input: &BlockInput<'_>, lane: usize) -> Quaternion<f32> {
    rotation::unique_polar_of_rounded(input.blend.matrix(lane))
        .map_or_else(|| input.average_of(lane), |q| q.map(|c| c as f32))
}
