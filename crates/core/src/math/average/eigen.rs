//! Eigenvalues and eigenvectors of a symmetric 4x4 matrix, and the rule for ties.

use super::super::{Quaternion, Real, dot4, is_distinct, rotation};

/// A symmetric 4x4 matrix, decomposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricEigen<T> {
    /// Eigenvalues, in descending order.
    pub values: [T; 4],
    /// `vectors[i]` belongs to `values[i]`; orthonormal.
    pub vectors: [Quaternion<T>; 4],
}

/// (cos, sin) of the rotation that diagonalises `[[alpha, gamma], [gamma, beta]]`; |angle| ≤ 45°. The rotated pair is
/// `(c x − s y, s x + c y)`.
#[inline]
pub fn jacobi_rotation<T: Real>(alpha: T, beta: T, gamma: T) -> (T, T) {
    let zeta = (beta - alpha) / (gamma + gamma);
    // For |zeta| so large that its square overflows, the tangent is 0 as it should be.
    let tangent = T::ONE.copysign(zeta) / (zeta.abs() + (T::ONE + zeta * zeta).sqrt());
    let cosine = T::ONE / (T::ONE + tangent * tangent).sqrt();
    (cosine, cosine * tangent)
}

impl<T: Real> SymmetricEigen<T> {
    /// The coordinate axes 1, i, j, k.
    pub const AXES: [Quaternion<T>; 4] = [
        [T::ONE, T::ZERO, T::ZERO, T::ZERO],
        [T::ZERO, T::ONE, T::ZERO, T::ZERO],
        [T::ZERO, T::ZERO, T::ONE, T::ZERO],
        [T::ZERO, T::ZERO, T::ZERO, T::ONE],
    ];

    /// Cyclic Jacobi. The upper triangle of `a` is read; its entries must be finite and should not be near the limits
    /// of the number range.
    pub fn new(mut a: [[T; 4]; 4]) -> Self {
        let mut vectors = Self::AXES;
        // Five sweeps suffice in practice; the bound only guards against a cycle of rounding errors.
        for _ in 0..30 {
            let mut rotated = false;
            for (p, q) in [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)] {
                let gamma = a[p][q];
                // Below this an off-diagonal entry cannot change the diagonal, nor a vector by more than rounding.
                let negligible = T::EPSILON * T::EPSILON * (a[p][p].abs() + a[q][q].abs());
                if gamma.abs() <= negligible {
                    continue;
                }
                rotated = true;
                rotate(&mut a, &mut vectors, p, q);
            }
            if !rotated {
                break;
            }
        }
        let mut order = [0, 1, 2, 3];
        order.sort_by(|&i, &j| a[j][j].partial_cmp(&a[i][i]).unwrap_or(std::cmp::Ordering::Equal));
        Self { values: order.map(|i| a[i][i]), vectors: order.map(|i| vectors[i]) }
    }
}

/// One Jacobi rotation in the plane (p, q), p < q, on the upper triangle of `a`.
#[inline(always)]
fn rotate<T: Real>(a: &mut [[T; 4]; 4], vectors: &mut [Quaternion<T>; 4], p: usize, q: usize) {
    let gamma = a[p][q];
    let (c, s) = jacobi_rotation(a[p][p], a[q][q], gamma);
    let shift = (s / c) * gamma;
    a[p][p] -= shift;
    a[q][q] += shift;
    a[p][q] = T::ZERO;
    for k in 0..4 {
        if k != p && k != q {
            let at_p = (k.min(p), k.max(p));
            let at_q = (k.min(q), k.max(q));
            let (x, y) = (a[at_p.0][at_p.1], a[at_q.0][at_q.1]);
            a[at_p.0][at_p.1] = c * x - s * y;
            a[at_q.0][at_q.1] = s * x + c * y;
        }
    }
    let (x, y) = (vectors[p], vectors[q]);
    for k in 0..4 {
        vectors[p][k] = c * x[k] - s * y[k];
        vectors[q][k] = s * x[k] + c * y[k];
    }
}

/// The unit vector of the top eigenspace (all eigenvalues within a tie of the largest, measured against `scale`) that
/// is nearest to one of the references: to the heaviest reference whose projection on the space has a squared length
/// of at least 1/4 (that is, within 60° of it as a line; 120° as a rotation), the first of equals. Reference
/// quaternions are of unit length. Where none qualifies, the leading eigenvector.
pub fn nearest_in_top_space<T: Real>(
    eigen: &SymmetricEigen<T>,
    scale: T,
    references: impl Iterator<Item = (Quaternion<T>, T)>,
) -> Quaternion<T> {
    let dimension = (1..4).find(|&i| is_distinct(eigen.values[0] - eigen.values[i], scale)).unwrap_or(4);
    let mut best = None;
    let mut best_weight = T::ZERO;
    for (reference, weight) in references {
        let projection = project(&eigen.vectors[..dimension], reference);
        if weight > best_weight && dot4(projection, projection) >= T::from_f64(0.25) {
            best = rotation::normalize(projection);
            best_weight = weight;
        }
    }
    best.unwrap_or(eigen.vectors[0])
}

/// The orthogonal projection of `v` on the span of orthonormal vectors.
fn project<T: Real>(basis: &[Quaternion<T>], v: Quaternion<T>) -> Quaternion<T> {
    let mut sum = [T::ZERO; 4];
    for &axis in basis {
        let along = dot4(axis, v);
        for k in 0..4 {
            sum[k] += along * axis[k];
        }
    }
    sum
}
