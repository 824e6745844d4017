//! Many averages at once: `N` Gaussians side by side, one per SIMD lane, structure of arrays.
//!
//! Branch-free `f32` code that the compiler turns into vector instructions, always inlined so that it takes the vector
//! width of its caller.
//! A lane's result depends on that lane alone, bit for bit, not on its neighbours or on `N`.

use super::squaring;
use std::array::from_fn;

/// The averages of `N` problems.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes<const N: usize> {
    /// Components w, x, y, z of unit quaternions, the component of largest magnitude positive; the identity where the
    /// lane is not settled.
    pub quats: [[f32; N]; 4],
    /// The answer is good to `f32` rounding over the gap. A lane that is not settled (λ2/λ1 above about 0.93, a zero
    /// blend, NaN) is a case for [`super::average_rotation`], which decides in `f64`.
    pub settled: [bool; N],
}

/// 1 − tr A² (over (tr A)²) at which A² has rank one to rounding: the square of half of it is below half an ulp.
const RANK_ONE: f32 = 2.0e-4;

/// The averages from the linear blends B = Σ w R(q), row-major, and their total weights Σ w > 0: the blend that moves
/// the mean (Eq. 6) already holds A = Σ w q qᵀ of Eq. 7, as 4 A = K(B) + Σ w I with Davenport's K.
#[inline(always)]
pub fn from_blends<const N: usize>(blend: &[[f32; N]; 9], weight: &[f32; N]) -> Lanes<N> {
    let mut a = [[0.0; N]; 10];
    for i in 0..N {
        let [xx, xy, xz] = [blend[0][i], blend[1][i], blend[2][i]];
        let [yx, yy, yz] = [blend[3][i], blend[4][i], blend[5][i]];
        let [zx, zy, zz] = [blend[6][i], blend[7][i], blend[8][i]];
        a[0][i] = (weight[i] + xx) + (yy + zz);
        a[4][i] = (weight[i] + xx) - (yy + zz);
        a[7][i] = (weight[i] - xx) + (yy - zz);
        a[9][i] = (weight[i] - xx) - (yy - zz);
        a[1][i] = zy - yz;
        a[2][i] = xz - zx;
        a[3][i] = yx - xy;
        a[5][i] = xy + yx;
        a[6][i] = xz + zx;
        a[8][i] = yz + zy;
    }
    dominant(a)
}

/// The averages from A = Σ w q qᵀ, upper triangle: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33.
#[inline(always)]
pub fn from_outer_sums<const N: usize>(a: &[[f32; N]; 10]) -> Lanes<N> {
    dominant(*a)
}

/// Repeated squaring with a lane frozen once its matrix has rank one. One loop over lanes per step, with the arithmetic
/// of one problem as its body: the form that the loop vectoriser takes whole.
#[inline(always)]
fn dominant<const N: usize>(mut a: [[f32; N]; 10]) -> Lanes<N> {
    for i in 0..N {
        let m = lane(&a, i);
        set_lane(&mut a, i, squaring::scaled(&m, 1.0 / squaring::trace(&m)));
    }
    // Every bit set or none: lanes are chosen by their bits, since a branch in the loop would keep it from being vector code.
    let mut settled = [0_u32; N];
    for _ in 0..squaring::MAX_SQUARINGS {
        let mut open = 0;
        for i in 0..N {
            let m = lane(&a, i);
            let next = squaring::square(&m);
            let trace = squaring::trace(&next);
            let next = squaring::scaled(&next, 1.0 / trace);
            set_lane(&mut a, i, from_fn(|k| choose(settled[i], m[k], next[k])));
            settled[i] |= u32::from(squaring::is_square_rank_one(trace, RANK_ONE)).wrapping_neg();
            open |= !settled[i];
        }
        if open == 0 {
            break;
        }
    }
    let mut quats = [[0.0; N]; 4];
    for i in 0..N {
        let [w, x, y, z] = squaring::largest_column(&lane(&a, i));
        let inverse = 1.0 / ((w * w + x * x) + (y * y + z * z)).sqrt();
        quats[0][i] = choose(settled[i], w * inverse, 1.0);
        quats[1][i] = choose(settled[i], x * inverse, 0.0);
        quats[2][i] = choose(settled[i], y * inverse, 0.0);
        quats[3][i] = choose(settled[i], z * inverse, 0.0);
    }
    Lanes { quats, settled: settled.map(|mask| mask != 0) }
}

/// `a` where the bits of the mask are set, `b` where none is.
#[inline(always)]
fn choose(mask: u32, a: f32, b: f32) -> f32 {
    f32::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// Lane `i` of a structure of arrays.
#[inline(always)]
fn lane<const N: usize, const K: usize>(soa: &[[f32; N]; K], i: usize) -> [f32; K] {
    from_fn(|k| soa[k][i])
}

/// Writes lane `i` of a structure of arrays.
#[inline(always)]
fn set_lane<const N: usize, const K: usize>(soa: &mut [[f32; N]; K], i: usize, values: [f32; K]) {
    for k in 0..K {
        soa[k][i] = values[k];
    }
}
