//! Front-to-back blending of one 4x4-pixel block, sixteen lanes at once.

use super::accumulator::{Accumulator, LEAST_TRANSMITTANCE, MAX_ALPHA};
use super::lanes::Lanes;
use super::layer::LayerBlock;
use super::preprocess::{ScreenGaussian, Splat};
use super::wide::{Wide, each};

/// Splats between two looks at whether all pixels of the block are done.
pub(super) const BETWEEN_CHECKS: usize = 8;

/// Columns and rows of a block's pixels.
pub(super) const COLUMN: [f32; 16] =
    [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0];
pub(super) const ROW: [f32; 16] =
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0];

/// Sixteen pixels while they are blended, row by row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    transmittance: [f32; 16],
    /// The transmittance of pixels that are not done, 0 of those that are.
    open: [f32; 16],
    colour: [[f32; 16]; 3],
    depth: [f32; 16],
}

/// A finished block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixels {
    pub(super) red: [f32; 16],
    pub(super) green: [f32; 16],
    pub(super) blue: [f32; 16],
    pub(super) alpha: [f32; 16],
    pub(super) depth: [f32; 16],
}

impl Block {
    /// Before the first splat.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { transmittance: [1.0; 16], open: [1.0; 16], colour: [[0.0; 16]; 3], depth: [0.0; 16] }
    }

    /// The block over the background.
    #[inline(always)]
    pub(super) fn pixels<L: Lanes>(&self, l: L, background: [f32; 3]) -> Pixels {
        let transmittance = Wide::load(l, &self.transmittance);
        let over = |c: usize| {
            transmittance.mul_add(Wide::splat(l, background[c]), Wide::load(l, &self.colour[c])).store()
        };
        Pixels {
            red: over(0),
            green: over(1),
            blue: over(2),
            alpha: (Wide::splat(l, 1.0) - transmittance).store(),
            depth: self.depth,
        }
    }

    #[inline(always)]
    fn load<L: Lanes>(&self, l: L) -> Accumulator<L> {
        Accumulator {
            transmittance: Wide::load(l, &self.transmittance),
            open: Wide::load(l, &self.open),
            colour: each(self.colour, |c| Wide::load(l, &c)),
            depth: Wide::load(l, &self.depth),
        }
    }

    #[inline(always)]
    fn keep<L: Lanes>(&mut self, sums: &Accumulator<L>) {
        self.transmittance = sums.transmittance.store();
        self.open = sums.open.store();
        self.colour = each(sums.colour, Wide::store);
        self.depth = sums.depth.store();
    }

    /// Blends what is left of a layer behind all splats.
    #[inline(always)]
    pub(super) fn finish<L: Lanes>(&mut self, l: L, layer: &mut impl LayerBlock) {
        let mut sums = self.load(l);
        layer.cross(l, f32::INFINITY, &mut sums);
        self.keep(&sums);
    }

    /// Blends the listed splats, in order, and the layer among them, into the block whose first pixel is (`left`, `top`).
    #[inline(always)]
    pub(super) fn blend<L: Lanes>(
        &mut self,
        l: L,
        [left, top]: [usize; 2],
        list: &[u16],
        splats: &[Splat],
        layer: &mut impl LayerBlock,
    ) {
        let n = |value: f32| Wide::splat(l, value);
        let x = Wide::load(l, &COLUMN) + n(left as f32);
        let y = Wide::load(l, &ROW) + n(top as f32);
        let mut sums = self.load(l);
        for run in list.chunks(BETWEEN_CHECKS) {
            if !n(0.0).less(sums.open).any() {
                break;
            }
            for &i in run {
                let screen = &splats[usize::from(i)].screen;
                layer.cross(l, screen.depth, &mut sums);
                let alpha = uncapped_alpha(screen, x, y).min(n(MAX_ALPHA));
                // Without a branch: pixels finish at different splats, which no processor predicts.
                let after = alpha.neg_mul_add(sums.open, sums.open);
                let enough = after.at_least(n(LEAST_TRANSMITTANCE));
                let weight = enough.keep(alpha * sums.open);
                sums.open = enough.keep(after);
                sums.transmittance = enough.select(after, sums.transmittance);
                let [red, green, blue] = &mut sums.colour;
                *red = weight.mul_add(n(screen.colour[0]), *red);
                *green = weight.mul_add(n(screen.colour[1]), *green);
                *blue = weight.mul_add(n(screen.colour[2]), *blue);
                sums.depth = weight.mul_add(n(screen.depth), sums.depth);
            }
        }
        self.keep(&sums);
    }
}

/// `opacity 2^-q` where 0 <= q <= reach, else 0; so a q that rounding made negative is skipped, as is NaN.
#[inline(always)]
pub(super) fn uncapped_alpha<L: Lanes>(screen: &ScreenGaussian, x: Wide<L>, y: Wide<L>) -> Wide<L> {
    let n = |value: f32| x.constant(value);
    let [a, b, c] = each(screen.conic, n);
    let (dx, dy) = (x - n(screen.mean[0]), y - n(screen.mean[1]));
    let q = dx.mul_add(a.mul_add(dx, b * dy), c * dy * dy);
    q.in_range(n(screen.reach)).keep(n(screen.opacity) * q.exp2_negated())
}

/// The alpha of a splat at one pixel.
#[cfg(test)]
pub(super) fn alpha_at(screen: &ScreenGaussian, x: f32, y: f32) -> f32 {
    let l = super::lanes::Arrays;
    uncapped_alpha(screen, Wide::splat(l, x), Wide::splat(l, y)).store()[0].min(MAX_ALPHA)
}
