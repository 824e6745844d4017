//! Iterations that reach the leading eigenvector by multiplying.

use super::super::rotation::normalize;
use super::super::{Quaternion, Real, dot4};

/// `A v`.
#[inline(always)]
fn apply<T: Real>(a: &[[T; 4]; 4], v: Quaternion<T>) -> Quaternion<T> {
    [dot4(a[0], v), dot4(a[1], v), dot4(a[2], v), dot4(a[3], v)]
}

/// Power iteration: `steps` times v ← A v / |A v|. The error shrinks by λ2/λ1 a step, if `start` is not orthogonal to
/// the answer. With no step, `start` normalised. Where A v vanishes, v stays.
pub fn power_iterate<T: Real>(a: [[T; 4]; 4], start: Quaternion<T>, steps: u32) -> Quaternion<T> {
    let mut v = normalize(start).unwrap_or(start);
    for _ in 0..steps {
        match normalize(apply(&a, v)) {
            Some(next) => v = next,
            None => break,
        }
    }
    v
}

/// The column of A with the largest diagonal entry (the first of equals): the un-normalised power step that
/// PyTorch3D's matrix-to-quaternion takes, up to a factor.
pub(super) fn largest_column<T: Real>(a: &[[T; 4]; 4]) -> Quaternion<T> {
    let mut best = 0;
    for i in 1..4 {
        if a[i][i] > a[best][best] {
            best = i;
        }
    }
    a[best]
}

/// (A², its trace) for a symmetric A.
#[inline(always)]
fn square<T: Real>(a: &[[T; 4]; 4]) -> ([[T; 4]; 4], T) {
    let mut s = [[T::ZERO; 4]; 4];
    for i in 0..4 {
        for j in i..4 {
            s[i][j] = dot4(a[i], a[j]);
            s[j][i] = s[i][j];
        }
    }
    let trace = (s[0][0] + s[1][1]) + (s[2][2] + s[3][3]);
    (s, trace)
}

#[inline(always)]
fn scaled<T: Real>(a: [[T; 4]; 4], factor: T) -> [[T; 4]; 4] {
    a.map(|row| row.map(|entry| entry * factor))
}

#[inline(always)]
fn unit_trace<T: Real>(a: [[T; 4]; 4]) -> [[T; 4]; 4] {
    let trace = (a[0][0] + a[1][1]) + (a[2][2] + a[3][3]);
    scaled(a, T::ONE / trace)
}

/// Repeated squaring: the largest column of A^(2^doublings), normalised; as good as 2^doublings power steps. A is
/// positive semidefinite and not zero.
pub fn square_to_dominant<T: Real>(a: [[T; 4]; 4], doublings: u32) -> Quaternion<T> {
    let mut a = unit_trace(a);
    for _ in 0..doublings {
        let (next, trace) = square(&a);
        a = scaled(next, T::ONE / trace);
    }
    let column = largest_column(&a);
    normalize(column).unwrap_or(column)
}

/// The leading eigenvector by repeated squaring until A^(2^k) has rank one to rounding; `None` if that takes more than
/// eight squarings (λ2/λ1 above about 0.9), where the caller turns to Jacobi.
///
/// With unit trace, tr A² = Σ λ² is 1 − 2 λ2 to first order where the others have died out: the trace that scales the
/// square also tells when to stop. Each squaring halves the angle that rounding has turned the eigenvector by relative
/// to the gap, so the error is that of A itself, about ε λ1 / (λ1 − λ2).
#[inline]
pub(super) fn dominant_eigenvector<T: Real>(a: [[T; 4]; 4]) -> Option<Quaternion<T>> {
    let rank_one = T::EPSILON.sqrt() * T::from_f64(0.125);
    let mut a = unit_trace(a);
    for _ in 0..8 {
        let (next, trace) = square(&a);
        if T::ONE - trace <= rank_one {
            return normalize(largest_column(&next));
        }
        a = scaled(next, T::ONE / trace);
    }
    None
}
