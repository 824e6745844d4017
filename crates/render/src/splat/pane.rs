//! What lies among the splats of a pixel besides splats: nothing, or an [`Underlay`].
//!
//! Splats are blended in depth order. Before the first splat of a pixel that does not lie in front of the underlay, the
//! underlay is blended with its coverage for an alpha; where no such splat comes, it is blended at the end. It is blended
//! like a background: also where the splats in front left too little light for another splat. Where it leaves too little
//! itself, the pixel is done. Drawing without an underlay is a compilation of its own, in which nothing of this is left.

use super::blend::{LEAST_TRANSMITTANCE, Light};
use super::lanes::Lanes;
use super::reach::BLOCK;
use super::wide::{Wide, each};
use skinsplat_core::scene::Underlay;

/// What lies among the splats of an image.
pub(super) trait Layer: Copy + Sync {
    /// Its part in one block.
    type Pane: Pane;

    /// In the block whose first pixel is (`left`, `top`).
    fn pane(self, corner: [usize; 2]) -> Self::Pane;
}

/// What lies among the splats of a 4x4-pixel block. Every pixel is crossed once on a way through its splats.
pub(super) trait Pane: Copy {
    /// Whether there is anything.
    const PRESENT: bool;

    /// Blends the pixels that a splat at `depth` does not lie in front of.
    fn cross<L: Lanes>(&mut self, l: L, depth: f32, light: &mut Light<L>);

    /// [`Pane::cross`] of what is left of the light alone (0 where a pixel is done).
    fn dim<L: Lanes>(&mut self, l: L, depth: f32, open: &mut Wide<L>);

    /// On the way from back to front, before a splat at `depth` that lies in front of some pixels: the derivative along
    /// the colour that is seen `behind` the splat, from the derivative by colour `upstream`.
    fn cross_back<L: Lanes>(&mut self, l: L, depth: f32, upstream: &[Wide<L>; 3], behind: &mut Wide<L>);

    /// By pixel: the weight with which the layer's colour entered the image.
    fn shown(&self) -> &[f32; 16];
}

/// No layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nothing;

impl Layer for Nothing {
    type Pane = Self;

    #[inline(always)]
    fn pane(self, _: [usize; 2]) -> Self {
        self
    }
}

impl Pane for Nothing {
    const PRESENT: bool = false;

    #[inline(always)]
    fn cross<L: Lanes>(&mut self, _: L, _: f32, _: &mut Light<L>) {}

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
pub(super) struct UnderlayPane {
    colour: [[f32; 16]; 3],
    coverage: [f32; 16],
    /// NaN where nothing is covered, and where the pixel was crossed: no comparison finds it.
    depth: [f32; 16],
    shown: [f32; 16],
}

impl Layer for Underlay<'_> {
    type Pane = UnderlayPane;

    #[inline(always)]
    fn pane(self, [left, top]: [usize; 2]) -> UnderlayPane {
        let (width, height) = (self.colour.width(), self.colour.height());
        let nothing = [0.0; 16];
        let (colour, depth) = ([nothing; 3], [f32::NAN; 16]);
        let mut pane = UnderlayPane { colour, coverage: nothing, depth, shown: nothing };
        for y in top..height.min(top + BLOCK) {
            for x in left..width.min(left + BLOCK) {
                let (pixel, lane) = (y * width + x, (y - top) * BLOCK + x - left);
                let coverage = self.coverage.values()[pixel];
                if coverage > 0.0 {
                    pane.coverage[lane] = coverage;
                    // The lesser of a NaN and a number is the number.
                    pane.depth[lane] = self.depth.values()[pixel].min(f32::MAX);
                    for (row, value) in pane.colour.iter_mut().zip(self.colour.pixels()[pixel]) {
                        row[lane] = value;
                    }
                }
            }
        }
        pane
    }
}

impl Pane for UnderlayPane {
    const PRESENT: bool = true;

    #[inline(always)]
    fn cross<L: Lanes>(&mut self, l: L, depth: f32, light: &mut Light<L>) {
        let own = Wide::load(l, &self.depth);
        let met = Wide::splat(l, depth).at_least(own);
        if !met.any() {
            return;
        }
        let coverage = Wide::load(l, &self.coverage);
        let weight = met.keep(coverage * light.transmittance);
        for (sum, colour) in light.colour.iter_mut().zip(&self.colour) {
            *sum = weight.mul_add(Wide::load(l, colour), *sum);
        }
        // The product of a weight of 0 with the NaN of an empty pixel would stay.
        light.depth = met.select(weight.mul_add(own, light.depth), light.depth);
        let left = coverage.neg_mul_add(light.transmittance, light.transmittance);
        light.transmittance = met.select(left, light.transmittance);
        self.shown = met.select(weight, Wide::load(l, &self.shown)).store();
        self.dim(l, depth, &mut light.open);
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
