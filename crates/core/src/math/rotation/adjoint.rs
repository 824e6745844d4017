//! Conversions walked backwards: from derivatives of a loss with respect to what a conversion returned to those with
//! respect to what it was given (transposed Jacobians).

use super::super::{Matrix3, Quaternion, Real, dot4};
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
}
