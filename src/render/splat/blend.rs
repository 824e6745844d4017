//! Front-to-back blending of one 4x4-pixel block, sixteen lanes at once.

use super::lanes::Lanes;
use super::preprocess::Paint;
use super::reach::BLOCK;

/// Alpha never exceeds this.
const MAX_ALPHA: f32 = 0.99;
/// A splat that would leave less transmittance than this is not blended, and the pixel is done.
const LEAST_TRANSMITTANCE: f32 = 1e-4;
/// x of a pixel that is done: no splat reaches it.
const DONE: f32 = 1e30;

/// Sixteen pixels while they are blended, row by row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    x: [f32; 16],
    transmittance: [f32; 16],
    colour: [[f32; 16]; 3],
    depth: [f32; 16],
}

/// A finished pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    pub(super) colour: [f32; 3],
    pub(super) alpha: f32,
    pub(super) depth: f32,
}

impl Block {
    /// An untouched block whose first pixel column is `left`.
    #[inline(always)]
    pub(super) fn new(left: usize) -> Self {
        Self {
            x: std::array::from_fn(|i| (left + i % BLOCK) as f32),
            transmittance: [1.0; 16],
            colour: [[0.0; 16]; 3],
            depth: [0.0; 16],
        }
    }

    /// True when no further splat can change it.
    #[inline(always)]
    pub(super) fn is_done(&self) -> bool {
        self.x.iter().all(|&x| x == DONE)
    }

    /// One pixel over the background.
    #[inline(always)]
    pub(super) fn pixel(&self, i: usize, background: [f32; 3]) -> Pixel {
        let t = self.transmittance[i];
        Pixel {
            colour: std::array::from_fn(|c| t.mul_add(background[c], self.colour[c][i])),
            alpha: 1.0 - t,
            depth: self.depth[i],
        }
    }

    /// Blends the listed splats, in order, into the block whose first pixel row is `top`.
    #[inline(always)]
    pub(super) fn blend<L: Lanes>(&mut self, l: L, top: usize, list: &[u16], paints: &[Paint]) {
        let mut x = l.load(&self.x);
        let y = l.load(&std::array::from_fn(|i| (top + i / BLOCK) as f32));
        let mut transmittance = l.load(&self.transmittance);
        let [mut red, mut green, mut blue] = self.colour.map(|c| l.load(&c));
        let mut depth = l.load(&self.depth);
        for &i in list {
            let paint = &paints[usize::from(i)];
            let mut alpha = alpha(l, paint, x, y);
            let mut after = l.neg_mul_add(alpha, transmittance, transmittance);
            let done = l.less(after, l.splat(LEAST_TRANSMITTANCE));
            let mut all_done = false;
            if l.any(done) {
                x = l.select(done, l.splat(DONE), x);
                alpha = l.select(done, l.splat(0.0), alpha);
                after = l.select(done, transmittance, after);
                all_done = !l.any(l.less(x, l.splat(DONE)));
            }
            let weight = l.mul(alpha, transmittance);
            red = l.mul_add(weight, l.splat(paint.colour[0]), red);
            green = l.mul_add(weight, l.splat(paint.colour[1]), green);
            blue = l.mul_add(weight, l.splat(paint.colour[2]), blue);
            depth = l.mul_add(weight, l.splat(paint.depth), depth);
            transmittance = after;
            if all_done {
                break;
            }
        }
        self.x = l.store(x);
        self.transmittance = l.store(transmittance);
        self.colour = [l.store(red), l.store(green), l.store(blue)];
        self.depth = l.store(depth);
    }
}

/// `min(0.99, opacity 2^-q)` where 0 <= q <= reach, else 0; so a q that rounding made negative is skipped, as is NaN.
#[inline(always)]
fn alpha<L: Lanes>(l: L, paint: &Paint, x: L::F, y: L::F) -> L::F {
    let [a, b, c] = paint.conic.map(|v| l.splat(v));
    let dx = l.sub(x, l.splat(paint.mean[0]));
    let dy = l.sub(y, l.splat(paint.mean[1]));
    let across = l.mul_add(a, dx, l.mul(b, dy));
    let q = l.mul_add(dx, across, l.mul(l.mul(c, dy), dy));
    let value = l.min(l.splat(MAX_ALPHA), l.mul(l.splat(paint.opacity), exp2_negated(l, q)));
    l.keep(l.in_range(q, l.splat(paint.reach)), value)
}

/// `2^-q` to 1.6e-7, for q in 0..=120.
#[inline(always)]
fn exp2_negated<L: Lanes>(l: L, q: L::F) -> L::F {
    // Minimax in relative error for 2^f, |f| <= 1/2, with 2^0 = 1 exactly.
    const POLYNOMIAL: [f32; 5] =
        [0.001_326_472_7, 0.009_671_512_7, 0.055_507_337_4, 0.240_222_420_8, 0.693_146_977_6];
    let n = l.round(q);
    let f = l.sub(n, q);
    let mut p = l.splat(POLYNOMIAL[0]);
    for coefficient in &POLYNOMIAL[1..] {
        p = l.mul_add(p, f, l.splat(*coefficient));
    }
    p = l.mul_add(p, f, l.splat(1.0));
    l.divide_by_power_of_two(p, n)
}

/// The alpha of a splat at one pixel.
#[cfg(test)]
pub(super) fn alpha_at(paint: &Paint, x: f32, y: f32) -> f32 {
    alpha(super::lanes::Arrays, paint, [x; 16], [y; 16])[0]
}
