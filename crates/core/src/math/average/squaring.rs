//! Repeated squaring of a symmetric 4x4 matrix: the power iteration that doubles its step count with each step, one
//! problem at a time in either precision; [`super::lanes`] runs the same arithmetic side by side.

use super::super::rotation::normalize;
use super::super::{Quaternion, Real};

/// The upper triangle of a symmetric 4x4 matrix: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33.
pub(super) type Symmetric<T> = [T; 10];

/// Place of (row, column) in [`Symmetric`].
pub(super) const AT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

/// Squarings before a problem is given up: A^256 has rank one if λ2/λ1 is below about 0.93 (0.89 in `f64`).
pub(super) const MAX_SQUARINGS: usize = 8;

/// All sixteen entries.
pub(super) fn rows<T: Real>(a: &Symmetric<T>) -> [[T; 4]; 4] {
    AT.map(|row| row.map(|k| a[k]))
}

/// The sum of the diagonal.
#[inline(always)]
pub(super) fn trace<T: Real>(a: &Symmetric<T>) -> T {
    (a[0] + a[4]) + (a[7] + a[9])
}

/// `factor × a`.
#[inline(always)]
pub(super) fn scaled<T: Real>(a: &Symmetric<T>, factor: T) -> Symmetric<T> {
    a.map(|entry| entry * factor)
}

/// A².
#[inline(always)]
pub(super) fn square<T: Real>(a: &Symmetric<T>) -> Symmetric<T> {
    let [a00, a01, a02, a03, a11, a12, a13, a22, a23, a33] = *a;
    let (s01, s02, s03) = (a01 * a01, a02 * a02, a03 * a03);
    let (s12, s13, s23) = (a12 * a12, a13 * a13, a23 * a23);
    [
        (a00 * a00 + s01) + (s02 + s03),
        a01 * (a00 + a11) + (a02 * a12 + a03 * a13),
        a02 * (a00 + a22) + (a01 * a12 + a03 * a23),
        a03 * (a00 + a33) + (a01 * a13 + a02 * a23),
        (a11 * a11 + s01) + (s12 + s13),
        a12 * (a11 + a22) + (a01 * a02 + a13 * a23),
        a13 * (a11 + a33) + (a01 * a03 + a12 * a23),
        (a22 * a22 + s02) + (s12 + s23),
        a23 * (a22 + a33) + (a02 * a03 + a12 * a13),
        (a33 * a33 + s03) + (s13 + s23),
    ]
}

/// True if a matrix of unit trace, whose square has the trace given, has a square of rank one to rounding.
///
/// tr A² = Σ λ² is 1 − 2 λ2 to first order where the others have died out, so the square is contaminated by (rest/2)².
#[inline(always)]
pub(super) fn is_square_rank_one<T: Real>(trace_of_square: T, tolerance: T) -> bool {
    (T::ONE - trace_of_square).abs() <= tolerance
}

/// The column with the largest diagonal entry (the first of equals). Of a matrix q qᵀ this is a multiple of q with its largest
/// component positive; of any blend it is the un-normalised power step that PyTorch3D's matrix-to-quaternion takes.
#[inline(always)]
pub(super) fn largest_column<T: Real>(a: &Symmetric<T>) -> Quaternion<T> {
    let mut column = [a[0], a[1], a[2], a[3]];
    let mut best = a[0];
    for i in 1..4 {
        let diagonal = a[AT[i][i]];
        let larger = diagonal > best;
        for k in 0..4 {
            column[k] = if larger { a[AT[k][i]] } else { column[k] };
        }
        best = if larger { diagonal } else { best };
    }
    column
}

/// The largest column of A^(2^doublings), normalised; as good as 2^doublings power steps. A is positive semidefinite
/// and not zero.
pub(super) fn square_times<T: Real>(a: &Symmetric<T>, doublings: u32) -> Quaternion<T> {
    let mut a = scaled(a, T::ONE / trace(a));
    for _ in 0..doublings {
        let next = square(&a);
        a = scaled(&next, T::ONE / trace(&next));
    }
    let column = largest_column(&a);
    normalize(column).unwrap_or(column)
}

/// The leading eigenvector by repeated squaring until A^(2^k) has rank one to rounding; `None` if that takes more than
/// [`MAX_SQUARINGS`], where the caller turns to Jacobi.
///
/// What the rounding of a squaring turns the eigenvector by, relative to the gap, halves with each squaring: the error
/// is that of A itself, about ε λ1 / (λ1 − λ2).
#[inline]
pub(super) fn dominant_eigenvector<T: Real>(a: &Symmetric<T>) -> Option<Quaternion<T>> {
    let tolerance = T::EPSILON.sqrt() * T::from_f64(0.125);
    let mut a = scaled(a, T::ONE / trace(a));
    for _ in 0..MAX_SQUARINGS {
        let next = square(&a);
        let trace = trace(&next);
        if is_square_rank_one(trace, tolerance) {
            return normalize(largest_column(&next));
        }
        a = scaled(&next, T::ONE / trace);
    }
    None
}
