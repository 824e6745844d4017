//! Many averages at once: `N` Gaussians side by side, one per SIMD lane, structure of arrays.
//!
//! Branch-free `f32` code that the compiler turns into vector instructions of whatever width the caller is compiled
//! for: the functions are always inlined, so that a caller inside `pulp::Arch::dispatch` gets AVX2 or AVX-512.
//! A lane's result depends on that lane alone, bit for bit, not on its neighbours or on `N`.

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

/// The upper triangle of a symmetric 4x4 matrix per lane: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33.
type Symmetric<const N: usize> = [[f32; N]; 10];

/// Place of (row, column) in [`Symmetric`].
const AT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

/// Squarings before a lane is given up: A^256 has rank one if λ2/λ1 < 0.93.
const SQUARINGS: usize = 8;

/// 1 − tr A² (over (tr A)²) at which A² has rank one to rounding: the square of half of it is below half an ulp.
const RANK_ONE: f32 = 2.0e-4;

/// The averages from the linear blends B = Σ w R(q), row-major, and their total weights Σ w > 0: the blend that moves
/// the mean (Eq. 6) already holds A = Σ w q qᵀ of Eq. 7, as 4 A = K(B) + Σ w I with Davenport's K.
#[inline(always)]
pub fn from_blends<const N: usize>(blend: &[[f32; N]; 9], weight: &[f32; N]) -> Lanes<N> {
    let mut a = [[0.0; N]; 10];
    for i in 0..N {
        let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|k: usize| blend[k][i]);
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

/// Repeated squaring with a lane frozen once its matrix has rank one.
#[inline(always)]
fn dominant<const N: usize>(mut a: Symmetric<N>) -> Lanes<N> {
    let mut inverse_trace = [0.0; N];
    for i in 0..N {
        inverse_trace[i] = 1.0 / ((a[0][i] + a[4][i]) + (a[7][i] + a[9][i]));
    }
    for entry in &mut a {
        for i in 0..N {
            entry[i] *= inverse_trace[i];
        }
    }
    let mut squared = square(&a);
    let mut rest = rest_of_trace(&squared);
    for _ in 1..SQUARINGS {
        if rest.iter().all(|&r| r.abs() <= RANK_ONE) {
            break;
        }
        for i in 0..N {
            inverse_trace[i] = 1.0 / (1.0 - rest[i]);
        }
        for (entry, next) in a.iter_mut().zip(&squared) {
            for i in 0..N {
                entry[i] = if rest[i].abs() <= RANK_ONE { entry[i] } else { next[i] * inverse_trace[i] };
            }
        }
        squared = square(&a);
        rest = rest_of_trace(&squared);
    }
    leading_vector(&squared, &rest)
}

/// A².
#[inline(always)]
fn square<const N: usize>(a: &Symmetric<N>) -> Symmetric<N> {
    let mut s = [[0.0; N]; 10];
    for row in 0..4 {
        for column in row..4 {
            let out = &mut s[AT[row][column]];
            for i in 0..N {
                let [p, q, r, t] =
                    [0, 1, 2, 3].map(|k: usize| (a[AT[row][k]][i], a[AT[k][column]][i])).map(|(x, y)| x * y);
                out[i] = (p + q) + (r + t);
            }
        }
    }
    s
}

/// 1 − tr S.
#[inline(always)]
fn rest_of_trace<const N: usize>(s: &Symmetric<N>) -> [f32; N] {
    let mut rest = [0.0; N];
    for i in 0..N {
        rest[i] = 1.0 - ((s[0][i] + s[4][i]) + (s[7][i] + s[9][i]));
    }
    rest
}

/// The column with the largest diagonal entry, normalised: of a matrix q qᵀ, this is ±q with its largest component
/// positive.
#[inline(always)]
fn leading_vector<const N: usize>(s: &Symmetric<N>, rest: &[f32; N]) -> Lanes<N> {
    let mut quats = [s[0], s[1], s[2], s[3]];
    let mut best = s[0];
    for column in 1..4 {
        let diagonal = s[AT[column][column]];
        for (k, component) in quats.iter_mut().enumerate() {
            for i in 0..N {
                component[i] = if diagonal[i] > best[i] { s[AT[k][column]][i] } else { component[i] };
            }
        }
        for i in 0..N {
            best[i] = if diagonal[i] > best[i] { diagonal[i] } else { best[i] };
        }
    }
    let mut settled = [false; N];
    for i in 0..N {
        let [w, x, y, z] = [0, 1, 2, 3].map(|k: usize| quats[k][i]);
        let inverse = 1.0 / ((w * w + x * x) + (y * y + z * z)).sqrt();
        settled[i] = rest[i].abs() <= RANK_ONE;
        quats[0][i] = if settled[i] { w * inverse } else { 1.0 };
        quats[1][i] = if settled[i] { x * inverse } else { 0.0 };
        quats[2][i] = if settled[i] { y * inverse } else { 0.0 };
        quats[3][i] = if settled[i] { z * inverse } else { 0.0 };
    }
    Lanes { quats, settled }
}
