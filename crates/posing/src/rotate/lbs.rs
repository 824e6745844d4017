//! The blended matrix B = Σ w_j L_j made a rotation, one Gaussian at a time.

use super::super::lanes::{
    LANES, Lanes, identity, matrix, multiply, product, put, put_matrix, splat, take, transposed,
};
use super::{BlockInput, Rotated};
use skinsplat_core::math::{Matrix3, Quaternion, dot4, matrix3, rotation};

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

/// PyTorch3D's quaternion of B R_c, raw or normalised: the posed quaternion itself. Where joints scale, B is the blend of
/// their rotations: HUGS converts before it scales.
#[inline(never)]
pub(super) fn converted(arch: pulp::Arch, projection: LbsProjection, input: &BlockInput<'_>) -> Rotated {
    let canonical = &input.block.rotations;
    let rotations = input.blended_rotations();
    let blend = rotations.as_ref().unwrap_or(&input.blend.linear);
    let Conversion { raw, mut unit, usual, .. } = arch.dispatch(Convert { blend, canonical });
    if !usual {
        for lane in 0..LANES {
            let own = rotation::normalize(take(&raw, lane));
            put(&mut unit, lane, own.unwrap_or(take(canonical, lane)));
        }
    }
    let mut back = *canonical;
    back[1..].as_flattened_mut().iter_mut().for_each(|c| *c = -*c);
    let raw_is_drawn = projection == LbsProjection::MatrixToQuaternionRaw;
    let relative = multiply(&unit, &back);
    Rotated { relative, drawn_by: relative, posed: if raw_is_drawn { raw } else { unit }, means: None }
}

/// The conversion of a block.
struct Conversion {
    /// B R_c, row-major.
    turned: [Lanes; 9],
    /// Its quaternion, not normalised.
    raw: [Lanes; 4],
    /// Of unit length, if all are `usual`.
    unit: [Lanes; 4],
    /// No squared length leaves the range in which its root and the inverse of that are as good as any.
    usual: bool,
}

struct Convert<'a> {
    blend: &'a [Lanes; 9],
    canonical: &'a [Lanes; 4],
}

impl pulp::NullaryFnOnce for Convert<'_> {
    type Output = Conversion;

    #[inline(always)]
    fn call(self) -> Conversion {
        let mut own = [[0.0; LANES]; 9];
        for lane in 0..LANES {
            let rotation = rotation::quaternion_to_matrix_raw(take(self.canonical, lane));
            put_matrix(&mut own, lane, &rotation);
        }
        let turned = product(self.blend, &own);
        let mut raw = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            put(&mut raw, lane, rotation::matrix_to_quaternion_raw(matrix(&turned, lane)));
        }
        let (mut unit, mut usual) = (raw, 0);
        for lane in 0..LANES {
            let squared = dot4(take(&raw, lane), take(&raw, lane));
            let inverse = 1.0 / squared.sqrt();
            unit.iter_mut().for_each(|c| c[lane] *= inverse);
            usual += u32::from((squared > LEAST_SQUARE) & (squared < MOST_SQUARE));
        }
        Conversion { turned, raw, unit, usual: usual as usize == LANES }
    }
}

/// Squared lengths between which [`rotation::normalize`] multiplies by the inverse root.
const LEAST_SQUARE: f32 = f32::MIN_POSITIVE / (f32::EPSILON * f32::EPSILON);
const MOST_SQUARE: f32 = f32::EPSILON / f32::MIN_POSITIVE;

/// [`converted`] walked backwards, through B R_c. See [`super::rotation_adjoint`].
#[inline(never)]
pub(super) fn converted_adjoint(
    arch: pulp::Arch,
    projection: LbsProjection,
    input: &BlockInput<'_>,
    rotated: &Rotated,
    posed: &[Lanes; 4],
    torque: Option<&[Lanes; 3]>,
) -> [Lanes; 4] {
    let raw_is_drawn = projection == LbsProjection::MatrixToQuaternionRaw;
    let rotations = input.blended_rotations();
    let blend = rotations.as_ref().unwrap_or(&input.blend.linear);
    if torque.is_none() {
        let convert = Convert { blend, canonical: &input.block.rotations };
        if let Some(result) = arch.dispatch(ConvertAdjoint { convert, raw_is_drawn, posed }) {
            return result;
        }
    }
    let mut result = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        let (b, canonical) = (matrix(blend, lane), take(&input.block.rotations, lane));
        let torque = torque
            .map(|torque| ([0, 1, 2].map(|axis: usize| torque[axis][lane]), take(&rotated.relative, lane)));
        let of_lane = lane_adjoint(raw_is_drawn, b, canonical, take(posed, lane), torque);
        put(&mut result, lane, of_lane);
    }
    result
}

/// All lanes at once, without a torque; `None` if a lane needs care.
struct ConvertAdjoint<'a> {
    convert: Convert<'a>,
    raw_is_drawn: bool,
    posed: &'a [Lanes; 4],
}

impl pulp::NullaryFnOnce for ConvertAdjoint<'_> {
    type Output = Option<[Lanes; 4]>;

    #[inline(always)]
    fn call(self) -> Option<[Lanes; 4]> {
        let Convert { blend, canonical } = self.convert;
        let Conversion { turned, raw, unit, usual } = Convert { blend, canonical }.call();
        if !usual {
            return None;
        }
        let mut of_raw = *self.posed;
        if !self.raw_is_drawn {
            for lane in 0..LANES {
                let (unit, raw) = (take(&unit, lane), take(&raw, lane));
                let of_unit = take(self.posed, lane);
                put(&mut of_raw, lane, rotation::adjoint::normalize(unit, 1.0 / dot4(unit, raw), of_unit));
            }
        }
        let mut of_turned = [[0.0; LANES]; 9];
        for lane in 0..LANES {
            let (turned, of_raw) = (matrix(&turned, lane), take(&of_raw, lane));
            let of_lane = rotation::adjoint::matrix_to_quaternion_raw(turned, of_raw);
            put_matrix(&mut of_turned, lane, &of_lane);
        }
        let of_own = product(&transposed(blend), &of_turned);
        let mut result = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            let own = matrix(&of_own, lane);
            let of_canonical = rotation::adjoint::quaternion_to_matrix_raw(take(canonical, lane), &own);
            put(&mut result, lane, sum([0.0; 4], of_canonical));
        }
        Some(result)
    }
}

/// One lane, whatever it holds. With a torque comes R, which it is a derivative by.
fn lane_adjoint(
    raw_is_drawn: bool,
    b: Matrix3<f32>,
    canonical: Quaternion<f32>,
    of_posed: Quaternion<f32>,
    torque: Option<([f32; 3], Quaternion<f32>)>,
) -> Quaternion<f32> {
    let turned = matrix3::multiply(b, rotation::quaternion_to_matrix_raw(canonical));
    let raw = rotation::matrix_to_quaternion_raw(turned);
    let Some(unit) = rotation::normalize(raw) else { return of_posed };
    let of_length = |of_unit| rotation::adjoint::normalize(unit, 1.0 / dot4(unit, raw), of_unit);
    let mut of_raw = if raw_is_drawn { of_posed } else { of_length(of_posed) };
    let mut of_canonical = [0.0; 4];
    if let Some((torque, relative)) = torque {
        // R = unit ⊗ R_c⁻¹: rotating R_c on rotates R back, seen from where R starts.
        let relative = rotation::conjugate(relative);
        let back = matrix3::apply(rotation::quaternion_to_matrix_raw(relative), torque).map(|t| -t);
        of_raw = sum(of_raw, of_length(rotation::adjoint::from_torque(unit, torque)));
        of_canonical = rotation::adjoint::from_torque(canonical, back);
    }
    let of_turned = rotation::adjoint::matrix_to_quaternion_raw(turned, of_raw);
    let of_own = matrix3::multiply(matrix3::transpose(b), of_turned);
    sum(of_canonical, rotation::adjoint::quaternion_to_matrix_raw(canonical, &of_own))
}

/// [`converted`] walked backwards to the blend that it converts, of one lane: from the derivative with respect to what is drawn
/// and to a further rotation of R.
pub(crate) fn blend_adjoint(
    projection: LbsProjection,
    b: Matrix3<f32>,
    canonical: Quaternion<f32>,
    of_posed: Quaternion<f32>,
    torque: [f32; 3],
) -> Matrix3<f32> {
    let own = rotation::quaternion_to_matrix_raw(canonical);
    let turned = matrix3::multiply(b, own);
    let raw = rotation::matrix_to_quaternion_raw(turned);
    let Some(unit) = rotation::normalize(raw) else { return [[0.0; 3]; 3] };
    let of_length = |of_unit| rotation::adjoint::normalize(unit, 1.0 / dot4(unit, raw), of_unit);
    let raw_is_drawn = projection == LbsProjection::MatrixToQuaternionRaw;
    let of_drawn = if raw_is_drawn { of_posed } else { of_length(of_posed) };
    let of_raw = sum(of_drawn, of_length(rotation::adjoint::from_torque(unit, torque)));
    let of_turned = rotation::adjoint::matrix_to_quaternion_raw(turned, of_raw);
    matrix3::multiply(of_turned, matrix3::transpose(own))
}

/// [`projected`] walked backwards to the blend, of one lane that does not hang on one rigid joint alone: from the derivative with
/// respect to a further rotation of R. Zero where R is not unique.
pub(crate) fn projection_adjoint(
    projection: LbsProjection,
    b: Matrix3<f32>,
    relative: Quaternion<f32>,
    torque: [f32; 3],
) -> Matrix3<f32> {
    let projected = match projection {
        LbsProjection::GramSchmidtRows => rotation::gram_schmidt_rows(b).map(|r| (r, true)),
        LbsProjection::GramSchmidtColumns => rotation::gram_schmidt_columns(b).map(|r| (r, false)),
        LbsProjection::Polar | LbsProjection::MatrixToQuaternion | LbsProjection::MatrixToQuaternionRaw => {
            None
        }
    };
    match projected {
        Some((r, true)) => rotation::adjoint::gram_schmidt_rows(&b, &r, torque),
        Some((r, false)) => rotation::adjoint::gram_schmidt_columns(&b, &r, torque),
        None => super::polar_adjoint(&b, relative, torque),
    }
}

#[inline(always)]
fn sum(a: Quaternion<f32>, b: Quaternion<f32>) -> Quaternion<f32> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

/// The rotation nearest to B, computed in `f64`; where several are equally near, the quaternion average's choice.
fn nearest(input: &BlockInput<'_>, lane: usize) -> Quaternion<f32> {
    rotation::unique_polar_of_rounded(input.blend.matrix(lane))
        .map_or_else(|| input.average_of(lane), |q| q.map(|c| c as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::random::SplitMix64;

    /// The bits of the functions of one matrix, for any blend on every branch.
    #[test]
    fn lanes_have_the_bits_of_single_matrices() {
        let mut random = SplitMix64::new(5);
        let mut number = || 2.0 * random.unit_f32() - 1.0;
        for _ in 0..500 {
            let blend: [Lanes; 9] = std::array::from_fn(|_| std::array::from_fn(|_| number()));
            let posed: [Lanes; 4] = std::array::from_fn(|_| std::array::from_fn(|_| number()));
            let mut canonical = identity();
            for lane in 0..LANES {
                let q = [number(), number(), number(), number()];
                put(&mut canonical, lane, rotation::normalize(q).unwrap());
            }
            let arch = pulp::Arch::default();
            let found = arch.dispatch(Convert { blend: &blend, canonical: &canonical });
            let adjoints = [true, false].map(|raw_is_drawn| {
                let convert = Convert { blend: &blend, canonical: &canonical };
                arch.dispatch(ConvertAdjoint { convert, raw_is_drawn, posed: &posed }).unwrap()
            });
            for lane in 0..LANES {
                let (b, own) = (matrix(&blend, lane), take(&canonical, lane));
                let turned = matrix3::multiply(b, rotation::quaternion_to_matrix_raw(own));
                let raw = rotation::matrix_to_quaternion_raw(turned);
                assert_eq!(take(&found.raw, lane), raw);
                assert_eq!(take(&found.unit, lane), rotation::normalize(raw).unwrap());
                for (raw_is_drawn, adjoint) in [true, false].into_iter().zip(&adjoints) {
                    let expected = lane_adjoint(raw_is_drawn, b, own, take(&posed, lane), None);
                    assert_eq!(take(adjoint, lane), expected);
                }
            }
        }
    }
}
