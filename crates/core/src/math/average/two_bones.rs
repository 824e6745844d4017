//! The average of two rotations in closed form.

use super::super::is_distinct;
use super::super::rotation::normalize;
use super::super::{Quaternion, Real, dot4};

/// `(κ, c, ρ, sign)` of two unit quaternions p, q: κ = (u − v) / (u + v), c = |p·q|, ρ = gap of the eigenvalues of
/// A = u p pᵀ + v q qᵀ over u + v, and the sign that brings q to p's side. λ1 = (u + v)(1 + ρ)/2, λ2 = (u + v)(1 − ρ)/2.
#[inline(always)]
fn invariants<T: Real>(p: Quaternion<T>, u: T, q: Quaternion<T>, v: T) -> (T, T, T, T) {
    let cosine = dot4(p, q);
    let sign = T::ONE.copysign(cosine);
    let c = cosine.abs().min(T::ONE);
    let kappa = (u - v) / (u + v);
    let rho = (c * c + kappa * kappa * ((T::ONE - c) * (T::ONE + c))).sqrt();
    (kappa, c, rho, sign)
}

/// The average of two unit quaternions with weights u, v ≥ 0, u + v > 0; either sign of the result. `None` if it is not
/// unique (equal weights, 180° apart).
///
/// With q on p's side, in the orthonormal basis along p + q and p − q, A is
/// (u + v)/2 · \[\[1 + c, κ s\], \[κ s, 1 − c\]\] with c = p·q, s = √(1 − c²), κ = (u − v)/(u + v), so its leading
/// eigenvector is at the angle φ with tan 2φ = κ s / c. Written without angles or divisions by |p − q|:
/// `(ρ + c)(p + q) + κ (1 + c)(p − q)`, ρ = √(c² + κ² s²). Nothing cancels: exact at p = ±q, and near 180° as accurate
/// as c is.
#[inline(always)]
pub fn two_bones<T: Real>(p: Quaternion<T>, u: T, q: Quaternion<T>, v: T) -> Option<Quaternion<T>> {
    let (kappa, c, rho, sign) = invariants(p, u, q, v);
    if !is_distinct(rho + rho, T::ONE + rho) {
        return None;
    }
    let (even, odd) = (rho + c, kappa * (T::ONE + c));
    let (of_p, of_q) = (even + odd, (even - odd) * sign);
    normalize([
        of_p * p[0] + of_q * q[0],
        of_p * p[1] + of_q * q[1],
        of_p * p[2] + of_q * q[2],
        of_p * p[3] + of_q * q[3],
    ])
}

/// (λ1 − λ2) / λ1 of A = u p pᵀ + v q qᵀ.
pub(super) fn relative_gap<T: Real>(p: Quaternion<T>, u: T, q: Quaternion<T>, v: T) -> T {
    let (_, _, rho, _) = invariants(p, u, q, v);
    (rho + rho) / (T::ONE + rho)
}
