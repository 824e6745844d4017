//! The rotation nearest to the derivative of LBS.

use super::super::lanes::{LANES, Lanes, matrix, put, splat};
use super::super::push_forward::Across;
use super::BlockInput;
use super::average;
use skinsplat_core::math::{Matrix3, Quaternion, rotation};

/// The polar factor of J of each lane, determinant +1: the dominant eigenvector of Davenport's matrix K(J), as for the average
/// of Eq. 7. A lane too close to a tie for `f32` is decided in `f64`, by the average where J leaves it open.
#[inline(always)]
pub(super) fn of_block(arch: pulp::Arch, input: &BlockInput<'_>, across: Across) -> [Lanes; 4] {
    let (indices, _) = input.chunk.influences(input.block);
    let Some(jacobian) = input.jacobian.map(|jacobian| jacobian.of(across)) else {
        return super::super::lanes::identity();
    };
    if let (&[joint], true) = (indices, input.joints.rigid()) {
        return splat(input.joints.rotation[usize::from(joint)]);
    }
    let mut shift = [0.0; LANES];
    for entries in jacobian {
        for lane in 0..LANES {
            shift[lane] += entries[lane] * entries[lane];
        }
    }
    // Eigenvalues of K are at least -(s1 + s2 + s3): with this on top, the root of thrice the squares, none is negative, which
    // squaring needs to tell when it is done.
    for lane in 0..LANES {
        shift[lane] = (shift[lane] * 3.0).sqrt();
    }
    let average = average::dominant(arch, jacobian, &shift);
    let mut quats = average.quats;
    for lane in 0..LANES {
        if !average.settled[lane] {
            let own = rotation::unique_polar_of_rounded(matrix(jacobian, lane));
            put(&mut quats, lane, own.map_or_else(|| input.average_of(lane), |q| q.map(|c| c as f32)));
        }
    }
    quats
}

/// [`rotation::adjoint::nearest_rotation`] of a matrix in `f32`.
pub(crate) fn adjoint(m: &Matrix3<f32>, relative: Quaternion<f32>, torque: [f32; 3]) -> Matrix3<f32> {
    let of_m = rotation::adjoint::nearest_rotation(
        &m.map(|row| row.map(f64::from)),
        relative.map(f64::from),
        torque.map(f64::from),
    );
    of_m.map(|row| row.map(|c| c as f32))
}
