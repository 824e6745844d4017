//! What lies among the splats of a pixel besides splats: nothing, or an [`Underlay`].
//!
//! Splats are blended in depth order. Before the first splat of a pixel that does not lie in front of the underlay, the
//! underlay is blended with its coverage for an alpha; where no such splat comes, it is blended at the end. It is blended
//! like a background: also where the splats in front left too little light for another splat. Where it leaves too little
//! itself, the pixel is done. Drawing without an underlay is a compilation of its own, in which nothing of this is left.

use super::accumulator::{Accumulator, LEAST_TRANSMITTANCE};
use super::grid::pixels_of_block;
use super::lanes::Lanes;
use super::wide::{Wide, each};
use skinsplat_core::scene::Underlay;

/// What lies among the splats of an image.
pub(super) trait Layer: Copy + Sync {
    /// Its part in one block.
    type Block: LayerBlock;

    /// In the block whose first pixel is `corner`.
    fn block(self, corner: [usize; 2]) -> Self::Block;
}

/// What lies among the splats of a 4x4-pixel block. Every pixel is crossed once on a way through its splats.
pub(super) trait LayerBlock: Copy {
    /// Whether there is anything.
    const PRESENT: bool;

    /// Blends the pixels that a splat at `depth` does not lie in front of.
    fn cross<L: Lanes>(&mut self, l: L, depth: f32, sums: &mut Accumulator<L>);

    /// [`LayerBlock::cross`] of what is left of the light alone (0 where a pixel is done).
    fn dim<L: Lanes>(&mut self, l: L, depth: f32, open: &mut Wide<L>);

    /// On the way from back to front, before a splat at `depth` that lies in front of some pixels: the derivative along
    /// the colour that is seen `behind` the splat, from the derivative by colour `upstream`.
    fn cross_back<L: Lanes>(&mut self, l: L, depth: f32, upstream: &[Wide<L>; 3], behind: &mut Wide<L>);

    /// By pixel: the weight with which the layer's colour entered the image.
    fn shown(&self) -> &[f32; 16];
}

/// No layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoLayer;

impl Layer for NoLayer {
    type Block = Self;

    #[inline(always)]
    fn block(self, _: [usize; 2]) -> Self {
        self
    }
}

impl LayerBlock for NoLayer {
    const PRESENT: bool = false;

    #[inline(always)]
    fn cross<L: Lanes>(&mut self, _: L, _: f32, _: &mut Accumulator<L>) {}

    #[inline(always)]
    fn dim<L: Lanes>(&mut self, _: L, _: f32, _: &mut Wide<L>) {}

    #[inline(always)]
    fn cross_back<L: Lanes>(&mut self, _: L, _: f32, _: &[Wide<L>; 3], _: &mut Wide<L>) {}

    #[inline(always)]
    fn shown(&self) -> &[f32; 16] {
        &[0.0; 16]
    }
}

/// Sixteen pixels of an underlay, row by row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct UnderlayBlock {
    colour: [[f32; 16]; 3],
    coverage: [f32; 16],
    /// NaN where nothing is covered, and where the pixel was crossed: no comparison finds it.
    depth: [f32; 16],
    shown: [f32; 16],
}

impl Layer for Underlay<'_> {
    type Block = UnderlayBlock;

    #[inline(always)]
    fn block(self, corner: [usize; 2]) -> UnderlayBlock {
        let nothing = [0.0; 16];
        let mut block =
            UnderlayBlock { colour: [nothing; 3], coverage: nothing, depth: [f32::NAN; 16], shown: nothing };
        pixels_of_block(corner, [self.colour.width(), self.colour.height()], |pixel, lane| {
            let coverage = self.coverage.values()[pixel];
            if coverage > 0.0 {
                block.coverage[lane] = coverage;
                // The lesser of a NaN and a number is the number.
                block.depth[lane] = self.depth.values()[pixel].min(f32::MAX);
                for (row, value) in block.colour.iter_mut().zip(self.colour.pixels()[pixel]) {
                    row[lane] = value;
                }
            }
        });
        block
    }
}

impl LayerBlock for UnderlayBlock {
    const PRESENT: bool = true;

    #[inline(always)]
    fn cross<L: Lanes>(&mut self, l: L, depth: f32, sums: &mut Accumulator<L>) {
        let own = Wide::load(l, &self.depth);
        let met = Wide::splat(l, depth).at_least(own);
        if !met.any() {
            return;
        }
        let coverage = Wide::load(l, &self.coverage);
        let weight = met.keep(coverage * sums.transmittance);
        for (sum, colour) in sums.colour.iter_mut().zip(&self.colour) {
            *sum = weight.mul_add(Wide::load(l, colour), *sum);
        }
        // The product of a weight of 0 with the NaN of an empty pixel would stay.
        sums.depth = met.select(weight.mul_add(own, sums.depth), sums.depth);
        let left = coverage.neg_mul_add(sums.transmittance, sums.transmittance);
        sums.transmittance = met.select(left, sums.transmittance);
        self.shown = met.select(weight, Wide::load(l, &self.shown)).store();
        self.dim(l, depth, &mut sums.open);
    }

    #[inline(always)]
    fn dim<L: Lanes>(&mut self, l: L, depth: f32, open: &mut Wide<L>) {
        let own = Wide::load(l, &self.depth);
        let met = Wide::splat(l, depth).at_least(own);
        if !met.any() {
            return;
        }
        let left = Wide::load(l, &self.coverage).neg_mul_add(*open, *open);
        let enough = left.at_least(Wide::splat(l, LEAST_TRANSMITTANCE));
        *open = met.select(enough.keep(left), *open);
        self.depth = met.select(Wide::splat(l, f32::NAN), own).store();
    }

    #[inline(always)]
    fn cross_back<L: Lanes>(&mut self, l: L, depth: f32, upstream: &[Wide<L>; 3], behind: &mut Wide<L>) {
        let own = Wide::load(l, &self.depth);
        let met = Wide::splat(l, depth).less(own);
        if !met.any() {
            return;
        }
        let [r, g, b] = each(self.colour, |c| Wide::load(l, &c));
        let along = upstream[2].mul_add(b, upstream[1].mul_add(g, upstream[0] * r));
        let through = Wide::load(l, &self.coverage).mul_add(along - *behind, *behind);
        *behind = met.select(through, *behind);
        self.depth = met.select(Wide::splat(l, f32::NAN), own).store();
    }

    #[inline(always)]
    fn shown(&self) -> &[f32; 16] {
        &self.shown
    }
}
