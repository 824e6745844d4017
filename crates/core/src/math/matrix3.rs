//! 3x3 matrices, row-major, acting on column vectors.

use super::{Matrix3, Real};

/// Inner product.
#[inline(always)]
pub fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline(always)]
pub fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a + k b`.
#[inline(always)]
pub fn add_scaled<T: Real>(a: [T; 3], k: T, b: [T; 3]) -> [T; 3] {
    [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]
}

/// The identity.
#[inline(always)]
pub fn identity<T: Real>() -> Matrix3<T> {
    let (o, i) = (T::ZERO, T::ONE);
    [[i, o, o], [o, i, o], [o, o, i]]
}

/// `mᵀ`.
#[inline(always)]
pub fn transpose<T: Real>(m: Matrix3<T>) -> Matrix3<T> {
    [[m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]]
}

/// `m v`.
#[inline(always)]
pub fn apply<T: Real>(m: Matrix3<T>, v: [T; 3]) -> [T; 3] {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// `a b`.
#[inline(always)]
pub fn multiply<T: Real>(a: Matrix3<T>, b: Matrix3<T>) -> Matrix3<T> {
    let b = transpose(b);
    a.map(|row| b.map(|column| dot(row, column)))
}

/// The determinant.
#[inline(always)]
pub fn determinant<T: Real>(m: Matrix3<T>) -> T {
    dot(m[0], cross(m[1], m[2]))
}

/// The length of the longest edge of the box that holds all entries; NaN-propagating only where every entry is NaN,
/// so test finiteness separately.
pub fn max_abs<T: Real>(m: Matrix3<T>) -> T {
    m.iter().flatten().fold(T::ZERO, |largest, entry| largest.max(entry.abs()))
}

/// Every entry is finite.
pub fn is_finite<T: Real>(m: Matrix3<T>) -> bool {
    m.iter().flatten().all(|entry| entry.is_finite())
}
