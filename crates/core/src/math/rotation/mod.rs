//! Rotations of 3-space: quaternions, conversions, projections of a blended matrix onto the rotations.

pub mod adjoint;
mod convert;
mod projection;

pub use convert::{
    SignPolicy, matrix_to_quaternion, matrix_to_quaternion_raw, quaternion_to_matrix,
    quaternion_to_matrix_raw,
};
pub use projection::{
    gram_schmidt_columns, gram_schmidt_rows, nearest_rotation, polar, unique_nearest_rotation,
};
pub use projection::{proper_polar_factor, unique_polar_of_rounded};

use super::{Quaternion, Real, dot4};

/// The identity rotation.
pub fn identity<T: Real>() -> Quaternion<T> {
    [T::ONE, T::ZERO, T::ZERO, T::ZERO]
}

/// The Hamilton product `a ⊗ b`: first b, then a.
#[inline(always)]
pub fn multiply<T: Real>(a: Quaternion<T>, b: Quaternion<T>) -> Quaternion<T> {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The conjugate, which is the inverse of a unit quaternion.
#[inline(always)]
pub fn conjugate<T: Real>(q: Quaternion<T>) -> Quaternion<T> {
    [q[0], -q[1], -q[2], -q[3]]
}

/// `q / |q|`, or `None` if `q` is zero, infinite or NaN. Lengths that overflow or underflow when squared are no
/// obstacle.
#[inline]
pub fn normalize<T: Real>(q: Quaternion<T>) -> Option<Quaternion<T>> {
    let squared = dot4(q, q);
    // Within these bounds neither the squares that matter nor their sum have left the normal range.
    let (low, high) = (T::MIN_POSITIVE / (T::EPSILON * T::EPSILON), T::EPSILON / T::MIN_POSITIVE);
    if squared > low && squared < high {
        let inverse = T::ONE / squared.sqrt();
        return Some(q.map(|c| c * inverse));
    }
    let largest = q.iter().fold(T::ZERO, |m, c| m.max(c.abs()));
    if largest == T::ZERO || !q.iter().all(|c| c.is_finite()) {
        return None;
    }
    let scaled = q.map(|c| c / largest);
    let length = dot4(scaled, scaled).sqrt();
    Some(scaled.map(|c| c / length))
}

/// True if a unit quaternion is to be negated to lie in the hemisphere of a unit reference.
///
/// Where they are 180° apart as rotations (the inner product is within 16 ulp of 0) either sign is as good; the one is
/// taken that makes the largest component of the half turn between them positive. So the choice does not depend on the
/// sign that `q` came with, nor on rounding, and follows turns of the world.
#[inline(always)]
pub fn is_opposite<T: Real>(q: Quaternion<T>, reference: Quaternion<T>) -> bool {
    let cosine = dot4(q, reference);
    if cosine.abs() > T::from_f64(16.0) * T::EPSILON {
        return cosine < T::ZERO;
    }
    let [_, x, y, z] = multiply(conjugate(reference), q);
    [y, z].into_iter().fold(x, |largest, c| if c.abs() > largest.abs() { c } else { largest }) < T::ZERO
}

/// The angle of the rotation that takes `a` to `b`, radians in \[0, π\]; the quaternions need not have unit length and
/// their signs do not matter. Accurate for tiny angles and near 180°: `4 atan2(|a ∓ b|, |a ± b|)` over unit vectors
/// (Kahan) instead of an arc cosine. NaN if a quaternion is zero or not finite.
pub fn angle_between<T: Real>(a: Quaternion<T>, b: Quaternion<T>) -> T {
    let (Some(a), Some(b)) = (normalize(a), normalize(b)) else {
        return T::from_f64(f64::NAN);
    };
    let sum = [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]];
    let difference = [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]];
    let (sum, difference) = (dot4(sum, sum).sqrt(), dot4(difference, difference).sqrt());
    T::from_f64(4.0) * sum.min(difference).atan2(sum.max(difference))
}
