//! Front-to-back blending of one 4x4-pixel block, sixteen lanes at once.

use super::lanes::Lanes;
use super::preprocess::{Paint, Splat};
use super::wide::{Wide, each};

/// Alpha never exceeds this.
const MAX_ALPHA: f32 = 0.99;
/// A splat that would leave less transmittance than this is not blended, and the pixel is done.
const LEAST_TRANSMITTANCE: f32 = 1e-4;
/// x of a pixel that is done: no splat reaches it.
const DONE: f32 = 1e30;

/// Columns and rows of a block's pixels.
const COLUMN: [f32; 16] = [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0];
const ROW: [f32; 16] = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0];

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
            x: each(COLUMN, |column| left as f32 + column),
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
    pub(super) fn blend<L: Lanes>(&mut self, l: L, top: usize, list: &[u16], splats: &[Splat]) {
        let n = |value: f32| Wide::splat(l, value);
        let mut x = Wide::load(l, &self.x);
        let y = Wide::load(l, &ROW) + n(top as f32);
        let mut transmittance = Wide::load(l, &self.transmittance);
        let [mut red, mut green, mut blue] = each(self.colour, |c| Wide::load(l, &c));
        let mut depth = Wide::load(l, &self.depth);
        for &i in list {
            let paint = &splats[usize::from(i)].paint;
            let mut alpha = alpha(paint, x, y);
            let mut after = alpha.neg_mul_add(transmittance, transmittance);
            let done = after.less(n(LEAST_TRANSMITTANCE));
            let mut all_done = false;
            if done.any() {
                x = done.select(n(DONE), x);
                alpha = done.select(n(0.0), alpha);
                after = done.select(transmittance, after);
                all_done = !x.less(n(DONE)).any();
            }
            let weight = alpha * transmittance;
            red = weight.mul_add(n(paint.colour[0]), red);
            green = weight.mul_add(n(paint.colour[1]), green);
            blue = weight.mul_add(n(paint.colour[2]), blue);
            depth = weight.mul_add(n(paint.depth), depth);
            transmittance = after;
            if all_done {
                break;
            }
        }
        self.x = x.store();
        self.transmittance = transmittance.store();
        self.colour = [red.store(), green.store(), blue.store()];
        self.depth = depth.store();
    }
}

/// `min(0.99, opacity 2^-q)` where 0 <= q <= reach, else 0; so a q that rounding made negative is skipped, as is NaN.
#[inline(always)]
fn alpha<L: Lanes>(paint: &Paint, x: Wide<L>, y: Wide<L>) -> Wide<L> {
    let n = |value: f32| x.constant(value);
    let [a, b, c] = each(paint.conic, n);
    let (dx, dy) = (x - n(paint.mean[0]), y - n(paint.mean[1]));
    let q = dx.mul_add(a.mul_add(dx, b * dy), c * dy * dy);
    let value = (n(paint.opacity) * q.exp2_negated()).min(n(MAX_ALPHA));
    q.in_range(n(paint.reach)).keep(value)
}

/// The alpha of a splat at one pixel.
#[cfg(test)]
pub(super) fn alpha_at(paint: &Paint, x: f32, y: f32) -> f32 {
    let l = super::lanes::Arrays;
    alpha(paint, Wide::splat(l, x), Wide::splat(l, y)).store()[0]
}
