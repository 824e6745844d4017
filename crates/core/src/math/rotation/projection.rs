//! Matrices made rotations: Gram-Schmidt and the polar projection with the determinant corrected.

use super::super::average::eigen::{self, SymmetricEigen};
use super::super::{Matrix3, Quaternion, Real, matrix3};
use super::{SignPolicy, identity, matrix_to_quaternion};
use glam::{DMat3, DQuat};

/// Gram-Schmidt on columns: the first column keeps its direction, the second its half-plane, the third is their
/// vector product, so the result is proper whatever the sign of the determinant. Commutes with rotations applied from
/// the left only.
///
/// `None` if ill-posed: an entry is not finite, or what is left of the first or second column is shorter than the
/// largest entry of `m` times 5e-10 (`f64`; 1e-5 in `f32`), so that its direction is mostly rounding error.
pub fn gram_schmidt_columns<T: Real>(m: Matrix3<T>) -> Option<Matrix3<T>> {
    gram_schmidt_rows(matrix3::transpose(m)).map(matrix3::transpose)
}

/// Gram-Schmidt on rows: [`gram_schmidt_columns`] of the transpose. Commutes with rotations applied from the right
/// only.
pub fn gram_schmidt_rows<T: Real>(m: Matrix3<T>) -> Option<Matrix3<T>> {
    let scale = matrix3::max_abs(m);
    if !matrix3::is_finite(m) || scale == T::ZERO {
        return None;
    }
    let floor = if T::EPSILON.to_f64() < 1e-10 { T::from_f64(5e-10) } else { T::from_f64(1e-5) };
    let unit = |v: [T; 3]| {
        let length = matrix3::dot(v, v).sqrt();
        (length > floor).then(|| v.map(|c| c / length))
    };
    let [a, b, _] = m.map(|row| row.map(|c| c / scale));
    let first = unit(a)?;
    // Twice is enough (Kahan, Parlett): the second pass removes what cancellation left along the first row.
    let once = matrix3::add_scaled(b, -matrix3::dot(first, b), first);
    let twice = matrix3::add_scaled(once, -matrix3::dot(first, once), first);
    let second = unit(twice)?;
    Some([first, second, matrix3::cross(first, second)])
}

/// Davenport's matrix K of a blend B of rotations of total weight W: K = 4 A − W I with A = Σ w q qᵀ. Its largest
/// eigenvector is the rotation nearest to B.
fn davenport<T: Real>(m: Matrix3<T>) -> [[T; 4]; 4] {
    let (wx, wy, wz) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[1][0] + m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    let (xx, yy, zz) = (m[0][0], m[1][1], m[2][2]);
    [
        [xx + yy + zz, wx, wy, wz],
        [wx, xx - yy - zz, xy, xz],
        [wy, xy, yy - xx - zz, yz],
        [wz, xz, yz, zz - xx - yy],
    ]
}

/// The proper rotation nearest to `m` in the Frobenius norm, w ≥ 0: `U diag(1, 1, det(U Vᵀ)) Vᵀ` of the singular value
/// decomposition `m = U S Vᵀ` (one-sided Jacobi), for any determinant and rank.
///
/// With d the sign of det m, the answer is unique if and only if `s2 + d s3 > 0`. Otherwise (within 16 ulp of s1) it is
/// the element nearest to the identity of the nearest rotations; if the identity is at right angles (180°) to them
/// all, that nearest to the half turn about x, then y, then z. `None` if an entry is not finite.
pub fn polar<T: Real>(m: Matrix3<T>) -> Option<Quaternion<T>> {
    if let Some(unique) = unique_polar(m) {
        return Some(unique);
    }
    let scale = matrix3::max_abs(m);
    if !matrix3::is_finite(m) {
        return None;
    }
    if scale == T::ZERO {
        return Some(identity());
    }
    let m = m.map(|row| row.map(|c| c / scale));
    let axes = SymmetricEigen::<T>::AXES;
    let eigen = SymmetricEigen::new(davenport(m));
    let shift = T::from_f64(4.0) * (eigen.values[0].abs().max(eigen.values[3].abs()));
    let quat = eigen::nearest_in_top_space(&eigen, shift, axes.iter().map(|&axis| (axis, T::ONE)));
    Some(SignPolicy::NonNegativeW.apply(quat, quat))
}

/// [`polar`] where it is unique; `None` elsewhere.
fn unique_polar<T: Real>(m: Matrix3<T>) -> Option<Quaternion<T>> {
    let scale = matrix3::max_abs(m);
    if !matrix3::is_finite(m) || scale == T::ZERO {
        return None;
    }
    proper_polar_factor(m.map(|row| row.map(|c| c / scale))).map(matrix_to_quaternion)
}

/// The rotation nearest to a matrix that was rounded to `f32`, computed in `f64`; `None` where that rounding leaves it open.
pub fn unique_polar_of_rounded(m: Matrix3<f32>) -> Option<Quaternion<f64>> {
    let scale = matrix3::max_abs(m);
    if !matrix3::is_finite(m) || scale == 0.0 {
        return None;
    }
    let m = m.map(|row| row.map(|c| f64::from(c) / f64::from(scale)));
    polar_factor(m, f64::from(f32::EPSILON)).map(matrix_to_quaternion)
}

/// `U diag(1, 1, det(U Vᵀ)) Vᵀ`, or `None` where it is not unique. The entries of `m` are of moderate size and not all zero.
pub fn proper_polar_factor<T: Real>(m: Matrix3<T>) -> Option<Matrix3<T>> {
    polar_factor(m, T::EPSILON)
}

/// [`proper_polar_factor`] of a matrix whose entries are off by about `rounding` of the largest.
fn polar_factor<T: Real>(m: Matrix3<T>, rounding: T) -> Option<Matrix3<T>> {
    let (mut us, mut v) = one_sided_jacobi(matrix3::transpose(m));
    let squared = us.map(|u| matrix3::dot(u, u));
    let mut order = [0, 1, 2];
    // A stable sort of three: equal singular values keep the order of the columns.
    order.sort_by(|&i, &j| squared[j].partial_cmp(&squared[i]).unwrap_or(std::cmp::Ordering::Equal));
    us = order.map(|i| us[i]);
    v = order.map(|i| v[i]);
    let [s1, s2] = [0, 1].map(|i| squared[order[i]].sqrt());
    // With two pairs of singular vectors known, the vector products complete both bases, and the determinant is
    // corrected without dividing by s3 or asking for its sign.
    let [u1, u2] = [us[0].map(|c| c / s1), us[1].map(|c| c / s2)];
    let (u3, v3) = (matrix3::cross(u1, u2), matrix3::cross(v[0], v[1]));
    let signed_s3 = matrix3::dot(u3, matrix3::apply(m, v3));
    (s2 + signed_s3 > T::from_f64(16.0) * rounding * s1)
        .then(|| matrix3::multiply(matrix3::transpose([u1, u2, u3]), [v[0], v[1], v3]))
}

/// Hestenes' one-sided Jacobi: right rotations make the columns of `m` orthogonal, `m V = U S`. Takes and returns
/// columns: (columns of `U S`, columns of V).
fn one_sided_jacobi<T: Real>(mut columns: [[T; 3]; 3]) -> ([[T; 3]; 3], [[T; 3]; 3]) {
    let mut v = matrix3::identity();
    // Six sweeps suffice in practice; the bound only guards against a cycle of rounding errors.
    for _ in 0..30 {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (columns[p], columns[q]);
            let (alpha, beta, gamma) = (matrix3::dot(a, a), matrix3::dot(b, b), matrix3::dot(a, b));
            if gamma.abs() <= T::EPSILON * (alpha * beta).sqrt() {
                continue;
            }
            rotated = true;
            let (c, s) = eigen::jacobi_rotation(alpha, beta, gamma);
            for pair in [&mut columns, &mut v] {
                let (x, y) = (pair[p], pair[q]);
                for i in 0..3 {
                    pair[p][i] = c * x[i] - s * y[i];
                    pair[q][i] = s * x[i] + c * y[i];
                }
            }
        }
        if !rotated {
            break;
        }
    }
    (columns, v)
}

/// [`polar`] in glam's types. A matrix that is not finite gives the identity.
pub fn nearest_rotation(m: DMat3) -> DQuat {
    let [w, x, y, z] = polar(m.transpose().to_cols_array_2d()).unwrap_or_else(identity);
    DQuat::from_xyzw(x, y, z, w)
}

/// [`nearest_rotation`] where it is unique: not for a matrix that vanishes or mirrors evenly.
pub fn unique_nearest_rotation(m: DMat3) -> Option<DQuat> {
    let [w, x, y, z] = unique_polar(m.transpose().to_cols_array_2d())?;
    Some(DQuat::from_xyzw(x, y, z, w))
}
