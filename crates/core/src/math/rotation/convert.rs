//! Quaternion ↔ matrix.

use super::super::{Matrix3, Quaternion, Real, dot4};
use super::normalize;

/// Which of the two quaternions of a rotation is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum SignPolicy {
    /// w ≥ 0 (PyTorch3D since 0.7.6). Where w is 0 the first non-zero component is positive.
    #[default]
    NonNegativeW,
    /// The component of largest magnitude is positive; the first of equals (PyTorch3D before 0.7.6 for proper
    /// rotations).
    LargestPositive,
    /// Non-negative inner product with a given first quaternion.
    AlignToFirst,
}

impl SignPolicy {
    /// `q` or `−q`. `first` is read by [`SignPolicy::AlignToFirst`] only.
    pub fn apply<T: Real>(self, q: Quaternion<T>, first: Quaternion<T>) -> Quaternion<T> {
        let negative = match self {
            Self::NonNegativeW => q.iter().find(|&&c| c != T::ZERO).is_some_and(|&leading| leading < T::ZERO),
            Self::LargestPositive => {
                let largest = q.iter().fold(q[0], |m, &c| if c.abs() > m.abs() { c } else { m });
                largest < T::ZERO
            }
            Self::AlignToFirst => dot4(q, first) < T::ZERO,
        };
        if negative { q.map(|c| -c) } else { q }
    }
}

/// For each component of the quaternion of `m` in turn: 4 × (component)² on the diagonal, 4 × the products off it.
/// Row i is 4 q_i q for a rotation, and 4 A_i (+ W − 1 on the diagonal) for a blend of rotations of total weight W,
/// where A = Σ w q qᵀ.
#[inline(always)]
pub(super) fn four_outer_product<T: Real>(m: Matrix3<T>) -> [[T; 4]; 4] {
    let (xx, yy, zz) = (m[0][0], m[1][1], m[2][2]);
    let (wx, wy, wz) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[1][0] + m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    [
        [T::ONE + xx + yy + zz, wx, wy, wz],
        [wx, T::ONE + xx - yy - zz, xy, xz],
        [wy, xy, T::ONE - xx + yy - zz, yz],
        [wz, xz, yz, T::ONE - xx - yy + zz],
    ]
}

/// PyTorch3D's `matrix_to_quaternion` (before 0.7.6; HUGS carries a copy) on any matrix, rotation or not: of four
/// candidates the one whose own component is largest (the first of equals), with a floor of 0.1 under the divisor.
/// Not normalised and without a rule for the sign: the component that chose the candidate is non-negative.
///
/// On a blend B = Σ w R of rotations (Σ w = 1) this is A e_i / √A_ii with A = Σ w q qᵀ: one un-normalised power step.
#[inline(always)]
pub fn matrix_to_quaternion_raw<T: Real>(m: Matrix3<T>) -> Quaternion<T> {
    let Leading { mut row, own, best } = leading(&four_outer_product(m));
    for k in 0..4 {
        row[k] = if best[k] { own * own } else { row[k] };
    }
    let divisor = T::from_f64(2.0) * own.max(T::from_f64(0.1));
    [row[0] / divisor, row[1] / divisor, row[2] / divisor, row[3] / divisor]
}

/// The candidate with the largest component of its own (the first of equals).
pub(super) struct Leading<T> {
    /// Its row of [`four_outer_product`].
    pub(super) row: [T; 4],
    /// Twice its own component.
    pub(super) own: T,
    /// True for its own component alone.
    pub(super) best: [bool; 4],
}

/// Chosen without branches or indices that depend on the data, so that a loop over matrices is vector code.
#[inline(always)]
pub(super) fn leading<T: Real>(outer: &[[T; 4]; 4]) -> Leading<T> {
    let component = |i: usize| outer[i][i].max(T::ZERO).sqrt();
    let mut leading = Leading { row: outer[0], own: component(0), best: [true, false, false, false] };
    for i in 1..4 {
        let own = component(i);
        let larger = own > leading.own;
        for k in 0..4 {
            leading.row[k] = if larger { outer[i][k] } else { leading.row[k] };
            leading.best[k] = if larger { i == k } else { leading.best[k] };
        }
        leading.own = if larger { own } else { leading.own };
    }
    leading
}

/// The unit quaternion of a rotation matrix, w ≥ 0 ([`SignPolicy::NonNegativeW`]). Accurate for every angle. A matrix
/// that is nearly a rotation gives a nearby rotation (project it first, [`super::polar`], to get the nearest one); one
/// from which no quaternion can be read (NaN) gives the identity.
pub fn matrix_to_quaternion<T: Real>(m: Matrix3<T>) -> Quaternion<T> {
    let raw = matrix_to_quaternion_raw(m);
    normalize(raw).map_or_else(super::identity, |q| SignPolicy::NonNegativeW.apply(q, q))
}

/// The rotation matrix of `q / |q|`; the identity if `q` is zero or not finite.
#[inline]
pub fn quaternion_to_matrix<T: Real>(q: Quaternion<T>) -> Matrix3<T> {
    quaternion_to_matrix_raw(normalize(q).unwrap_or_else(super::identity))
}

/// The matrix that the 3DGS kernels make of (w, x, y, z) without normalising: `I + 2 w [v]× + 2 [v]×²`. A rotation only
/// if |q| = 1.
#[inline(always)]
pub fn quaternion_to_matrix_raw<T: Real>([w, x, y, z]: Quaternion<T>) -> Matrix3<T> {
    let two = T::from_f64(2.0);
    let entry = |a: T, b: T| two * (a + b);
    let diagonal = |a: T, b: T| T::ONE - two * (a + b);
    [
        [diagonal(y * y, z * z), entry(x * y, -(w * z)), entry(x * z, w * y)],
        [entry(x * y, w * z), diagonal(x * x, z * z), entry(y * z, -(w * x))],
        [entry(x * z, -(w * y)), entry(y * z, w * x), diagonal(x * x, y * y)],
    ]
}
