//! Conversions walked backwards: from derivatives of a loss with respect to what a conversion returned to those with
//! respect to what it was given (transposed Jacobians).

use super::super::{Matrix3, Quaternion, Real, dot4, matrix3};
use super::convert::{Leading, four_outer_product, leading};

/// Of [`quaternion_to_matrix_raw`](super::quaternion_to_matrix_raw) at `q`; each component of `q` by itself.
#[inline(always)]
pub fn quaternion_to_matrix_raw<T: Real>([w, x, y, z]: Quaternion<T>, g: &Matrix3<T>) -> Quaternion<T> {
    let two = T::from_f64(2.0);
    let (xy, xz, yz) = (g[0][1] + g[1][0], g[0][2] + g[2][0], g[1][2] + g[2][1]);
    let (wx, wy, wz) = (g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]);
    let (xx, yy, zz) = (two * (g[1][1] + g[2][2]), two * (g[0][0] + g[2][2]), two * (g[0][0] + g[1][1]));
    [
        two * (x * wx + y * wy + z * wz),
        two * (w * wx + y * xy + z * xz - x * xx),
        two * (w * wy + x * xy + z * yz - y * yy),
        two * (w * wz + x * xz + y * yz - z * zz),
    ]
}

/// Of [`matrix_to_quaternion_raw`](super::matrix_to_quaternion_raw) at `m`, on the branch that `m` takes; each entry of
/// `m` by itself. The four diagonal terms that choose the branch sum to 4, so the divisor's floor never acts.
#[inline(always)]
pub fn matrix_to_quaternion_raw<T: Real>(m: Matrix3<T>, g: Quaternion<T>) -> Matrix3<T> {
    let Leading { row: outer, own, best } = leading(&four_outer_product(m));
    let (half, squared) = (T::ONE / (T::from_f64(2.0) * own), own * own);
    let of_best = |row: [T; 4]| {
        let low = if best[1] { row[1] } else { row[0] };
        let high = if best[3] { row[3] } else { row[2] };
        if best[2] | best[3] { high } else { low }
    };
    // p_best = √s / 2 and p_j = o_j / (2 √s) with s on the diagonal and o_j beside it.
    let along = (dot4(g, outer) - of_best(g) * of_best(outer)) * half;
    let of_own = T::from_f64(0.5) * (of_best(g) * half - along / squared);
    let row = [0, 1, 2, 3].map(|k: usize| if best[k] { of_own } else { g[k] * half });
    // Row `best` of a symmetric matrix: whichever of a pair it is, it is the same entry of m.
    let at = |i: usize, j: usize| if best[i] { row[j] } else { T::ZERO };
    let of = |i: usize, j: usize| at(i, j) + at(j, i);
    let (wx, wy, wz) = (of(0, 1), of(0, 2), of(0, 3));
    let (xy, xz, yz) = (of(1, 2), of(1, 3), of(2, 3));
    let diagonal = |axis: usize| if best[0] | best[axis] { of_own } else { -of_own };
    [[diagonal(1), xy - wz, xz + wy], [xy + wz, diagonal(2), yz - wx], [xz - wy, yz + wx, diagonal(3)]]
}

/// Of q / |q|, given the unit quaternion and 1 / |q|.
#[inline(always)]
pub fn normalize<T: Real>(unit: Quaternion<T>, inverse_length: T, g: Quaternion<T>) -> Quaternion<T> {
    let along = dot4(unit, g);
    [0, 1, 2, 3].map(|k: usize| (g[k] - along * unit[k]) * inverse_length)
}

/// The derivative with respect to a further rotation by ω (axis times angle, at 0), `exp(ω/2) ⊗ q`, as one with respect
/// to the unit quaternion q that has no part along q.
#[inline]
pub fn from_torque<T: Real>(unit: Quaternion<T>, [x, y, z]: [T; 3]) -> Quaternion<T> {
    let two = T::from_f64(2.0);
    super::multiply([T::ZERO, two * x, two * y, two * z], unit)
}

/// How a loss changes if a unit quaternion is turned on by ω (axis times angle, at 0), `exp(ω/2) ⊗ q`, from the derivative
/// with respect to its components: the other way round from [`from_torque`].
#[inline]
pub fn to_torque<T: Real>(unit: Quaternion<T>, gradient: Quaternion<T>) -> [T; 3] {
    let half = T::from_f64(0.5);
    [0, 1, 2].map(|axis: usize| {
        let mut turn = [T::ZERO; 4];
        turn[axis + 1] = half;
        dot4(super::multiply(turn, unit), gradient)
    })
}

/// How a loss changes if a rotation matrix is turned on by ω, `exp(ω) R`, from the derivative with respect to its entries:
/// the sum over columns of r × g.
#[inline]
pub fn matrix_to_torque<T: Real>(r: &Matrix3<T>, gradient: &Matrix3<T>) -> [T; 3] {
    let (columns, own) = (matrix3::transpose(*r), matrix3::transpose(*gradient));
    let of_column = |k: usize| matrix3::cross(columns[k], own[k]);
    matrix3::add_scaled(matrix3::add_scaled(of_column(0), T::ONE, of_column(1)), T::ONE, of_column(2))
}

/// Below this determinant, relative to the cube of the trace, two rotations are as near as each other.
const SINGULAR: f64 = 1e-12;

/// Of [`polar`](super::polar) at `m`, whose nearest rotation is `r`: the derivative with respect to `m`, from that with respect
/// to a further rotation `exp(ω) R`. With m = R P and P symmetric, (tr P I − P) ω' = vee(Rᵀ dm − dmᵀ R) for ω' = Rᵀ ω. Zero
/// where that has no answer.
///
/// For a blend m = Σ w R(q) it is the derivative of the average of Eq. 7: the eigenvalues of tr P I − P are 2 (λ1 − λ_k) for
/// those of Σ w q qᵀ.
pub fn nearest_rotation(m: &Matrix3<f64>, r: Quaternion<f64>, torque: [f64; 3]) -> Matrix3<f64> {
    let r = super::quaternion_to_matrix_raw(r);
    let p = matrix3::multiply(matrix3::transpose(r), *m);
    let trace = p[0][0] + p[1][1] + p[2][2];
    let mut a = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            a[row][column] = -0.5 * (p[row][column] + p[column][row]);
        }
        a[row][row] += trace;
    }
    let back = matrix3::apply(matrix3::transpose(r), torque);
    let cofactors = [matrix3::cross(a[1], a[2]), matrix3::cross(a[2], a[0]), matrix3::cross(a[0], a[1])];
    let determinant = matrix3::dot(a[0], cofactors[0]);
    if determinant.abs() <= SINGULAR * (trace * trace * trace).abs() {
        return [[0.0; 3]; 3];
    }
    // a is symmetric, and its cofactors with it.
    let [x, y, z] = matrix3::apply(cofactors, back).map(|c| c / determinant);
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    matrix3::multiply(r, cross)
}

/// Of [`gram_schmidt_columns`](super::gram_schmidt_columns) at `m`, which made `r` of it, from the derivative with respect to a
/// further rotation `exp(ω) R`.
pub fn gram_schmidt_columns<T: Real>(m: &Matrix3<T>, r: &Matrix3<T>, torque: [T; 3]) -> Matrix3<T> {
    let ([a, b, _], [x, y, z]) = (matrix3::transpose(*m), matrix3::transpose(*r));
    let along = |axis| matrix3::dot(torque, axis);
    // da turns x about y and z, and takes y along; what of db is across x turns the pair about x.
    let length = matrix3::dot(a, x);
    let (share, height) = (matrix3::dot(b, x), matrix3::dot(b, y));
    let zero = T::ZERO;
    let scaled = |k: T, v: [T; 3]| matrix3::add_scaled([zero; 3], k, v);
    // δx·y = ω·z, δx·z = −ω·y, δy·z = ω·x.
    let of_a_along_y = along(z) / length;
    let of_a_along_z = -(along(y) / length) - along(x) * share / (height * length);
    let of_a = matrix3::add_scaled(scaled(of_a_along_y, y), of_a_along_z, z);
    let of_b = scaled(along(x) / height, z);
    matrix3::transpose([of_a, of_b, [zero; 3]])
}

/// Of [`gram_schmidt_rows`](super::gram_schmidt_rows), as [`gram_schmidt_columns`]: Rᵀ is that of mᵀ, and turns by −Rᵀ ω.
pub fn gram_schmidt_rows<T: Real>(m: &Matrix3<T>, r: &Matrix3<T>, torque: [T; 3]) -> Matrix3<T> {
    let transposed = matrix3::transpose(*r);
    let back = matrix3::apply(transposed, torque).map(|c| -c);
    matrix3::transpose(gram_schmidt_columns(&matrix3::transpose(*m), &transposed, back))
}

#[cfg(test)]
mod tests {
    use super::super::{self as rotation};
    use super::*;

    fn wave(seed: usize, k: usize) -> f64 {
        2.0 * (((seed * 37 + k) as f64 * 0.7316).sin() * 43758.5453).rem_euclid(1.0) - 1.0
    }

    /// Central difference of the loss `Σ weight × output`.
    fn assert_derivative<const I: usize, const O: usize>(
        at: [f64; I],
        weight: [f64; O],
        found: [f64; I],
        map: impl Fn([f64; I]) -> [f64; O],
    ) {
        let h = 1e-5;
        for k in 0..I {
            let loss = |step: f64| {
                let mut moved = at;
                moved[k] += step;
                map(moved).iter().zip(weight).map(|(a, b)| a * b).sum::<f64>()
            };
            let expected = (8.0 * (loss(h) - loss(-h)) - (loss(2.0 * h) - loss(-2.0 * h))) / (12.0 * h);
            assert!((found[k] - expected).abs() < 1e-9, "[{k}] at {at:?}: {} {expected}", found[k]);
        }
    }

    fn rows(entries: [f64; 9]) -> Matrix3<f64> {
        let [a, b, c, d, e, f, g, h, i] = entries;
        [[a, b, c], [d, e, f], [g, h, i]]
    }

    fn flat(m: Matrix3<f64>) -> [f64; 9] {
        let [[a, b, c], [d, e, f], [g, h, i]] = m;
        [a, b, c, d, e, f, g, h, i]
    }

    #[test]
    fn quaternions_to_matrices() {
        for seed in 0..100 {
            let (q, g) = ([0, 1, 2, 3].map(|k| wave(seed, k)), std::array::from_fn(|k| wave(seed, 9 + k)));
            let found = quaternion_to_matrix_raw(q, &rows(g));
            assert_derivative(q, g, found, |q| flat(rotation::quaternion_to_matrix_raw(q)));
        }
    }

    #[test]
    fn matrices_to_quaternions_on_every_branch() {
        let mut branches = [0; 4];
        for seed in 0..400 {
            let m: [f64; 9] = std::array::from_fn(|k| wave(seed, k));
            let outer = four_outer_product(rows(m));
            let Leading { own, best, .. } = leading(&outer);
            let next = (0..4).filter(|&i| !best[i]).map(|i| outer[i][i]).fold(0.0, f64::max);
            assert!(own >= 1.0);
            if own * own - next < 1e-3 {
                continue;
            }
            branches.iter_mut().zip(best).for_each(|(count, best)| *count += i32::from(best));
            let g = [0, 1, 2, 3].map(|k| wave(seed, 20 + k));
            let found = flat(matrix_to_quaternion_raw(rows(m), g));
            assert_derivative(m, g, found, |m| rotation::matrix_to_quaternion_raw(rows(m)));
        }
        assert!(branches.iter().all(|&count| count > 20), "{branches:?}");
    }

    #[test]
    fn lengths_and_turns() {
        for seed in 0..100 {
            let (q, g) = ([0, 1, 2, 3].map(|k| wave(seed, k)), [0, 1, 2, 3].map(|k| wave(seed, 9 + k)));
            let length = dot4(q, q).sqrt();
            let unit = rotation::normalize(q).unwrap();
            assert_derivative(q, g, normalize(unit, 1.0 / length, g), |q| rotation::normalize(q).unwrap());
            // Turned on by ω about its own frame, the loss changes by the torque.
            let torque = [0, 1, 2].map(|k| wave(seed, 30 + k));
            let back = from_torque(unit, torque);
            assert!(dot4(back, unit).abs() < 1e-14);
            for axis in 0..3 {
                let mut half = [0.0; 4];
                half[1 + axis] = 0.5;
                assert!((dot4(back, rotation::multiply(half, unit)) - torque[axis]).abs() < 1e-14);
            }
        }
    }

    /// A matrix near to a proper rotation, but sheared.
    fn sheared(seed: usize) -> Matrix3<f64> {
        let mut m = rows(std::array::from_fn(|k| wave(seed, k)));
        (0..3).for_each(|k| m[k][k] += 1.5);
        m
    }

    /// With respect to a further rotation, from the derivative with respect to the entries of the rotation.
    fn torque(q: Quaternion<f64>, g: [f64; 9]) -> [f64; 3] {
        matrix_to_torque(&rotation::quaternion_to_matrix_raw(q), &rows(g))
    }

    #[test]
    fn nearest_rotations() {
        for seed in 0..200 {
            let (m, g) = (sheared(seed), std::array::from_fn(|k| wave(seed, 40 + k)));
            let q = rotation::polar(m).unwrap();
            let found = nearest_rotation(&m, q, torque(q, g));
            assert_derivative(flat(m), g, flat(found), |m| {
                flat(rotation::quaternion_to_matrix_raw(rotation::polar(rows(m)).unwrap()))
            });
        }
    }

    #[test]
    fn gram_schmidt_over_columns_and_rows() {
        for seed in 0..200 {
            let (m, g) = (sheared(seed), std::array::from_fn(|k| wave(seed, 40 + k)));
            let check =
                |r: Matrix3<f64>, found: Matrix3<f64>, project: fn(Matrix3<f64>) -> Option<Matrix3<f64>>| {
                    assert_eq!(project(m), Some(r));
                    assert_derivative(flat(m), g, flat(found), |m| flat(project(rows(m)).unwrap()));
                };
            let r = rotation::gram_schmidt_columns(m).unwrap();
            let of_r = matrix_to_torque(&r, &rows(g));
            check(r, gram_schmidt_columns(&m, &r, of_r), rotation::gram_schmidt_columns);
            let r = rotation::gram_schmidt_rows(m).unwrap();
            let of_r = matrix_to_torque(&r, &rows(g));
            check(r, gram_schmidt_rows(&m, &r, of_r), rotation::gram_schmidt_rows);
        }
    }

    #[test]
    fn torques_there_and_back() {
        for seed in 0..50 {
            let unit = rotation::normalize([0, 1, 2, 3].map(|k| wave(seed, k))).unwrap();
            let own = [0, 1, 2].map(|k| wave(seed, 30 + k));
            let back = to_torque(unit, from_torque(unit, own));
            assert!(back.iter().zip(own).all(|(a, b)| (a - b).abs() < 1e-14));
        }
    }
}
