//! The rotation nearest to the derivative of LBS.

use super::super::lanes::{LANES, Lanes, matrix, put, splat};
use super::super::push_forward::Across;
use super::BlockInput;
use super::average;
use skinsplat_core::math::{Matrix3, Quaternion, matrix3, rotation};

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

/// The derivative with respect to J of one lane, from that with respect to a further rotation of its polar factor R: with
/// J = R P and P symmetric, (tr P I − P) ω = vee(Rᵀ dJ − dJᵀ R) for the rotation ω, seen from where R starts. Zero where that
/// has no answer.
pub(crate) fn adjoint(jacobian: &Matrix3<f32>, relative: Quaternion<f32>, torque: [f32; 3]) -> Matrix3<f32> {
    let r = rotation::quaternion_to_matrix_raw(relative.map(f64::from));
    let j = jacobian.map(|row| row.map(f64::from));
    let p = matrix3::multiply(matrix3::transpose(r), j);
    let trace = p[0][0] + p[1][1] + p[2][2];
    let mut a = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            a[row][column] = -0.5 * (p[row][column] + p[column][row]);
        }
        a[row][row] += trace;
    }
    let back = matrix3::apply(matrix3::transpose(r), torque.map(f64::from));
    let cofactors = [matrix3::cross(a[1], a[2]), matrix3::cross(a[2], a[0]), matrix3::cross(a[0], a[1])];
    let determinant = matrix3::dot(a[0], cofactors[0]);
    if determinant.abs() <= SINGULAR * (trace * trace * trace).abs() {
        return [[0.0; 3]; 3];
    }
    // a is symmetric, and its cofactors with it.
    let [x, y, z] = matrix3::apply(cofactors, back).map(|c| c / determinant);
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    matrix3::multiply(r, cross).map(|row| row.map(|c| c as f32))
}

/// Below this determinant, relative to the cube of the trace, two rotations are as near as each other.
const SINGULAR: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::random::SplitMix64;

    /// Against central differences in f64 of the rotation that the loss is read from.
    #[test]
    fn the_adjoint_is_that_of_the_nearest_rotation() {
        let mut random = SplitMix64::new(3);
        let mut number = || f64::from(2.0 * random.unit_f32() - 1.0);
        for _ in 0..200 {
            let j = [0; 3].map(|_| [0; 3].map(|_| number()));
            let j = [
                [j[0][0] + 1.5, j[0][1], j[0][2]],
                [j[1][0], j[1][1] + 1.5, j[1][2]],
                [j[2][0], j[2][1], j[2][2] + 1.5],
            ];
            let of_matrix: Matrix3<f64> = [0; 3].map(|_| [0; 3].map(|_| number()));
            let loss = |j: Matrix3<f64>| {
                let r = rotation::quaternion_to_matrix_raw(rotation::polar(j).unwrap());
                r.iter().zip(&of_matrix).map(|(r, g)| matrix3::dot(*r, *g)).sum::<f64>()
            };
            let r = rotation::quaternion_to_matrix_raw(rotation::polar(j).unwrap());
            // d loss for a turn of the world about axis k: Σ (e_k × r_column) · g_column.
            let (columns, upstream) = (matrix3::transpose(r), matrix3::transpose(of_matrix));
            let mut torque = [0.0; 3];
            for (column, own) in columns.iter().zip(&upstream) {
                torque = matrix3::add_scaled(torque, 1.0, matrix3::cross(*column, *own));
            }
            let relative = rotation::polar(j).unwrap().map(|c| c as f32);
            let found = adjoint(&j.map(|row| row.map(|c| c as f32)), relative, torque.map(|c| c as f32));
            for row in 0..3 {
                for column in 0..3 {
                    let moved = |step: f64| {
                        let mut j = j;
                        j[row][column] += step;
                        loss(j)
                    };
                    let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    let error = (f64::from(found[row][column]) - expected).abs();
                    assert!(error < 1e-4 * (1.0 + expected.abs()), "{expected} and {}", found[row][column]);
                }
            }
        }
    }
}
