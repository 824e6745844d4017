//! The adjoint of view-dependent colour: from a splat's colour to SH coefficients and the direction they are read in.

use super::colour::{C1, C2, C3, Direction};
use super::lanes::Lanes;
use super::preprocess::LANES;
use super::project::dot;
use super::wide::{Wide, each};
use skinsplat_core::scene::ColourClamp;

/// Of up to sixteen Gaussians, those that any pixel asks something of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touched(pub(super) u16);

impl Touched {
    pub(super) fn has(self, lane: usize) -> bool {
        self.0 >> lane & 1 == 1
    }
}

/// Derivatives with respect to the SH coefficients of sixteen Gaussians, which are written to `out` (zeros for those that
/// were not touched), and (returned) with respect to the values of the basis functions (anything for those). `rgb` are
/// the derivatives with respect to the clamped colour.
#[inline(always)]
pub(super) fn coefficients<const K: usize, L: Lanes>(
    l: L,
    sh: &[[f32; 3]],
    basis: &[Wide<L>; 16],
    rgb: [Wide<L>; 3],
    clamp: ColourClamp,
    touched: Touched,
    out: &mut [[f32; 3]],
) -> [Wide<L>; 16] {
    let sh = by_coefficient::<K, L>(l, sh);
    let colour = unclamped::<K, L>(&sh, basis);
    let n = |value: f32| Wide::splat(l, value);
    let mut free = rgb;
    for c in 0..3 {
        free[c] = colour[c].at_least(n(0.0)).keep(rgb[c]);
        if clamp == ColourClamp::Unit {
            free[c] = n(1.0).at_least(colour[c]).keep(free[c]);
        }
    }
    let mut by_basis = [n(0.0); 16];
    let mut gradient = [n(0.0); 48];
    for k in 0..K {
        by_basis[k] = sh[3 * k + 2].mul_add(free[2], sh[3 * k + 1].mul_add(free[1], sh[3 * k] * free[0]));
        for c in 0..3 {
            gradient[3 * k + c] = basis[k] * free[c];
        }
    }
    store_coefficients::<K, L>(&gradient, touched, out);
    by_basis
}

/// The colour before clamping, with the bits that the forward pass finds.
#[inline(always)]
fn unclamped<const K: usize, L: Lanes>(sh: &[Wide<L>; 48], basis: &[Wide<L>; 16]) -> [Wide<L>; 3] {
    let mut colour = [sh[0]; 3];
    for c in 0..3 {
        let mut sums = [sh[0].constant(0.5), sh[0].constant(0.0)];
        for k in 0..K {
            let sum = if k == K - 1 { 1 } else { k % 2 };
            sums[sum] = basis[k].mul_add(sh[3 * k + c], sums[sum]);
        }
        colour[c] = sums[0] + sums[1];
    }
    colour
}

/// The Gaussians' coefficients, one per vector; zeros beyond the degree.
#[inline(always)]
fn by_coefficient<const K: usize, L: Lanes>(l: L, sh: &[[f32; 3]]) -> [Wide<L>; 48] {
    // In the order of memory, and also of Gaussians that were not touched: whatever else makes the processor wait.
    let mut rows = [[Wide::splat(l, 0.0); LANES]; 3];
    for (lane, sh) in sh.chunks_exact(K).enumerate() {
        for part in 0..(3 * K).div_ceil(LANES) {
            rows[part][lane] = load_part(l, &sh.as_flattened()[part * LANES..]);
        }
    }
    let mut out = [rows[0][0]; 48];
    for part in 0..(3 * K).div_ceil(LANES) {
        out[part * LANES..][..LANES].copy_from_slice(&Wide::transpose(&rows[part]));
    }
    out
}

/// The first sixteen values, or as many as there are and then zeros.
#[inline(always)]
fn load_part<L: Lanes>(l: L, values: &[f32]) -> Wide<L> {
    if let Some(sixteen) = values.first_chunk() {
        return Wide::load(l, sixteen);
    }
    let mut padded = [0.0; LANES];
    padded[..values.len()].copy_from_slice(values);
    Wide::load(l, &padded)
}

/// Writes the first sixteen values, or as many as there are.
#[inline(always)]
fn store_part<L: Lanes>(row: Wide<L>, values: &mut [f32]) {
    if let Some(sixteen) = values.first_chunk_mut() {
        *sixteen = row.store();
    } else {
        values.copy_from_slice(&row.store()[..values.len()]);
    }
}

/// Zeros for Gaussians that were not touched.
#[inline(always)]
fn store_coefficients<const K: usize, L: Lanes>(
    gradient: &[Wide<L>; 48],
    touched: Touched,
    out: &mut [[f32; 3]],
) {
    let zero = gradient[0].constant(0.0);
    let mut rows = [[zero; LANES]; 3];
    for part in 0..(3 * K).div_ceil(LANES) {
        let mut columns = [zero; LANES];
        columns.copy_from_slice(&gradient[part * LANES..][..LANES]);
        rows[part] = Wide::transpose(&columns);
    }
    for (lane, out) in out.chunks_exact_mut(K).enumerate() {
        for part in 0..(3 * K).div_ceil(LANES) {
            let row = if touched.has(lane) { rows[part][lane] } else { zero };
            store_part(row, &mut out.as_flattened_mut()[part * LANES..]);
        }
    }
}

/// Derivatives with respect to the way F d in which SH are read, from those with respect to the basis functions.
#[inline(always)]
pub(super) fn turned<L: Lanes>(direction: &Direction<L>, by_basis: &[Wide<L>; 16]) -> [Wide<L>; 3] {
    let d = direction.unit;
    let along = along_basis(d, by_basis);
    let radial = dot(d, along);
    each([0, 1, 2], |i| d[i].neg_mul_add(radial, along[i]) * direction.inverse_length)
}

/// Derivatives with respect to the mean, from those of [`turned`]. The frame by columns.
#[inline(always)]
pub(super) fn mean<L: Lanes>(frame: Option<[[Wide<L>; 3]; 3]>, turned: [Wide<L>; 3]) -> [Wide<L>; 3] {
    match frame {
        Some([x, y, z]) => [dot(x, turned), dot(y, turned), dot(z, turned)],
        None => turned,
    }
}

/// Σ e_k ∇b_k of the basis functions as polynomials.
#[inline(always)]
fn along_basis<L: Lanes>([x, y, z]: [Wide<L>; 3], e: &[Wide<L>; 16]) -> [Wide<L>; 3] {
    let n = |value: f32| x.constant(value);
    let two = n(2.0);
    let (xx, yy, zz, xy, yz, xz) = (x * x, y * y, z * z, x * y, y * z, x * z);
    let [e1, e2, e3] = [e[1] * n(C1), e[2] * n(C1), e[3] * n(C1)];
    let (e4, e5, e6) = (e[4] * n(C2[0]), e[5] * n(C2[1]), e[6] * n(2.0 * C2[2]));
    let (e7, e8) = (e[7] * n(C2[3]), e[8] * n(2.0 * C2[4]));
    let (e9, e10, e11, e12) = (e[9] * n(C3[0]), e[10] * n(C3[1]), e[11] * n(C3[2]), e[12] * n(C3[3]));
    let (e13, e14, e15) = (e[13] * n(C3[4]), e[14] * n(C3[5]), e[15] * n(C3[6]));
    // 3 (x² - y²), 4z² - x² - y², and the latter's derivatives along x, y (both over -2) and z (over 8).
    let difference = n(3.0) * (xx - yy);
    let four_zz = n(4.0).mul_add(zz, -(xx + yy));
    let six_xy = n(6.0) * xy;
    [
        sum([
            e4 * y - e3,
            (e8 - e6) * x,
            e7 * z,
            e9 * six_xy + e10 * yz,
            e11 * (-two * xy),
            e12 * (n(-6.0) * xz),
            e13 * (four_zz - two * xx) + e14 * (two * xz),
            e15 * difference,
        ]),
        sum([
            e4 * x - e1,
            -((e8 + e6) * y),
            e5 * z,
            e9 * difference + e10 * xz,
            e11 * (four_zz - two * yy),
            e12 * (n(-6.0) * yz),
            e13 * (-two * xy) - e14 * (two * yz),
            -(e15 * six_xy),
        ]),
        sum([
            e2 + e5 * y,
            e6 * (two * z),
            e7 * x,
            e10 * xy,
            e11 * (n(8.0) * yz),
            e12 * n(6.0).mul_add(zz, n(-3.0) * (xx + yy)),
            e13 * (n(8.0) * xz),
            e14 * (xx - yy),
        ]),
    ]
}

#[inline(always)]
fn sum<L: Lanes>(terms: [Wide<L>; 8]) -> Wide<L> {
    ((terms[0] + terms[1]) + (terms[2] + terms[3])) + ((terms[4] + terms[5]) + (terms[6] + terms[7]))
}
