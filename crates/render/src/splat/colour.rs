//! View-dependent colour: real spherical harmonics to degree 3 in the 3DGS basis and order.

use super::lanes::Lanes;
use super::wide::{Wide, each};
use skinsplat_core::scene::{ColourClamp, Posed};

/// SH coefficients per Gaussian.
pub(super) fn sh_count(posed: &Posed) -> usize {
    (posed.sh_degree + 1).pow(2)
}

const C0: f32 = 0.282_094_791_773_878_14;
pub(super) const C1: f32 = 0.488_602_511_902_919_9;
pub(super) const C2: [f32; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
pub(super) const C3: [f32; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// The sixteen basis functions along unit directions.
#[inline(always)]
pub(super) fn basis<L: Lanes>([x, y, z]: [Wide<L>; 3]) -> [Wide<L>; 16] {
    let n = |value: f32| x.constant(value);
    let (xx, yy, zz, xy, yz, xz) = (x * x, y * y, z * z, x * y, y * z, x * z);
    let (difference, sum) = (xx - yy, xx + yy);
    let four_zz = n(4.0).mul_add(zz, -sum);
    [
        n(C0),
        n(-C1) * y,
        n(C1) * z,
        n(-C1) * x,
        n(C2[0]) * xy,
        n(C2[1]) * yz,
        n(C2[2]) * n(2.0).mul_add(zz, -sum),
        n(C2[3]) * xz,
        n(C2[4]) * difference,
        n(C3[0]) * y * n(3.0).mul_add(xx, -yy),
        n(C3[1]) * xy * z,
        n(C3[2]) * y * four_zz,
        n(C3[3]) * z * n(2.0).mul_add(zz, n(-3.0) * sum),
        n(C3[4]) * x * four_zz,
        n(C3[5]) * z * difference,
        n(C3[6]) * x * n(-3.0).mul_add(yy, xx),
    ]
}

/// The direction in which the SH of a Gaussian are read.
#[derive(Clone, Copy)]
pub(super) struct Direction<L: Lanes> {
    /// `normalize(F (mean - camera))`, 0 where that vanishes.
    pub(super) unit: [Wide<L>; 3],
    /// `1 / |F (mean - camera)|`, 0 where that vanishes.
    pub(super) inverse_length: Wide<L>,
}

/// The direction in which SH are read. F by columns.
#[inline(always)]
pub(super) fn direction<L: Lanes>(
    mean: [Wide<L>; 3],
    camera: [f32; 3],
    frame: Option<[[Wide<L>; 3]; 3]>,
) -> Direction<L> {
    let n = |value: f32| mean[0].constant(value);
    let d = each([0, 1, 2], |i| mean[i] - n(camera[i]));
    let turned = match frame {
        Some(f) => each([0, 1, 2], |i| f[2][i].mul_add(d[2], f[1][i].mul_add(d[1], f[0][i] * d[0]))),
        None => d,
    };
    let square = turned[2].mul_add(turned[2], turned[1].mul_add(turned[1], turned[0] * turned[0]));
    let inverse_length = n(0.0).less(square).keep(n(1.0) / square.sqrt());
    Direction { unit: each(turned, |v| v * inverse_length), inverse_length }
}

/// `Σ b_k c_k + 1/2`, before clamping, of one Gaussian. `coefficients` are RGB triples, as many as the degree has;
/// `basis(k)` is b_k.
#[inline(always)]
pub(super) fn evaluate<L: Lanes>(l: L, coefficients: &[[f32; 3]], basis: impl Fn(usize) -> f32) -> [f32; 3] {
    match coefficients.len() {
        1 => sum::<1, L>(l, coefficients, basis),
        4 => sum::<4, L>(l, coefficients, basis),
        9 => sum::<9, L>(l, coefficients, basis),
        _ => sum::<16, L>(l, coefficients, basis),
    }
}

#[inline(always)]
fn sum<const K: usize, L: Lanes>(l: L, coefficients: &[[f32; 3]], basis: impl Fn(usize) -> f32) -> [f32; 3] {
    let coefficients = &coefficients[..K];
    let flat = coefficients.as_flattened();
    // Two sums, since one would wait for itself.
    let mut sums = [[0.5; 4], [0.0; 4]];
    // Four floats at a time, of which the last is the next triple's: one vector load.
    for k in 0..K - 1 {
        if let Some(four) = flat[3 * k..].first_chunk() {
            sums[k % 2] = l.mul_add_four(basis(k), four, sums[k % 2]);
        }
    }
    // In the place that it has among more coefficients, so that those of higher degrees that are 0 change nothing.
    let [r, g, b] = coefficients[K - 1];
    sums[(K - 1) % 2] = l.mul_add_four(basis(K - 1), &[r, g, b, 0.0], sums[(K - 1) % 2]);
    [sums[0][0] + sums[1][0], sums[0][1] + sums[1][1], sums[0][2] + sums[1][2]]
}

/// The clamp that follows.
#[inline(always)]
pub(super) fn clamped(colour: [f32; 3], clamp: ColourClamp) -> [f32; 3] {
    match clamp {
        ColourClamp::NonNegative => each(colour, |c| c.max(0.0)),
        ColourClamp::Unit => each(colour, |c| c.clamp(0.0, 1.0)),
    }
}
