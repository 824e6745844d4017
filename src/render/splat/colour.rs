//! View-dependent colour: real spherical harmonics to degree 3 in the 3DGS basis and order.

use crate::scene::ColourClamp;

const C0: f32 = 0.282_094_791_773_878_14;
const C1: f32 = 0.488_602_511_902_919_9;
const C2: [f32; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
const C3: [f32; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// The sixteen basis functions along a unit direction.
#[inline(always)]
pub(super) fn basis([x, y, z]: [f32; 3]) -> [f32; 16] {
    let (xx, yy, zz, xy, yz, xz) = (x * x, y * y, z * z, x * y, y * z, x * z);
    [
        C0,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * xy,
        C2[1] * yz,
        C2[2] * (2.0 * zz - xx - yy),
        C2[3] * xz,
        C2[4] * (xx - yy),
        C3[0] * y * (3.0 * xx - yy),
        C3[1] * xy * z,
        C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        C3[4] * x * (4.0 * zz - xx - yy),
        C3[5] * z * (xx - yy),
        C3[6] * x * (xx - 3.0 * yy),
    ]
}

/// The direction in which the SH of a Gaussian are read: `normalize(F (mean - camera))`, 0 where that vanishes.
#[inline(always)]
pub(super) fn direction(mean: [f32; 3], camera: [f32; 3], frame: [[f32; 3]; 3]) -> [f32; 3] {
    let d: [f32; 3] = std::array::from_fn(|i| mean[i] - camera[i]);
    let turned: [f32; 3] =
        std::array::from_fn(|i| frame[2][i].mul_add(d[2], frame[1][i].mul_add(d[1], frame[0][i] * d[0])));
    let square = turned[2].mul_add(turned[2], turned[1].mul_add(turned[1], turned[0] * turned[0]));
    let scale = if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 };
    turned.map(|v| v * scale)
}

/// `Σ b_k c_k + 1/2`, before clamping. `coefficients` are RGB triples, as many as the degree has.
#[inline(always)]
pub(super) fn evaluate(coefficients: &[[f32; 3]], basis: &[f32; 16]) -> [f32; 3] {
    let mut colour = [0.5; 3];
    for (c, &b) in coefficients.iter().zip(basis) {
        for (sum, &c) in colour.iter_mut().zip(c) {
            *sum = b.mul_add(c, *sum);
        }
    }
    colour
}

/// The clamp that follows; NaN becomes 0.
#[inline(always)]
pub(super) fn clamped(colour: [f32; 3], clamp: ColourClamp) -> [f32; 3] {
    match clamp {
        ColourClamp::NonNegative => colour.map(|c| c.max(0.0)),
        ColourClamp::Unit => colour.map(|c| c.max(0.0).min(1.0)),
    }
}
