//! The two phases of drawing: chunks of Gaussians become splats in strips, strips become pixels.

use super::bin::Bins;
use super::grid::{Grid, STRIP_WIDTH, TILE};
use super::lanes;
use super::layer::Layer;
use super::parallel::{PerThread, chunk_length};
use super::preprocess::{Preprocess, Splat};
use super::profile::{Phase, PhaseTimes};
use super::project::Projection;
use super::strip::{DrawStrip, Rows, Scratch};
use pulp::Arch;
use rayon::prelude::*;
use skinsplat_core::scene::{Mask, Posed, Rendered, SceneError};

/// What drawing finds out about a frame's Gaussians, which the way back reads again.
#[derive(Debug, Default)]
pub(super) struct Forward {
    /// By chunk, the visible ones first.
    pub(super) splats: Vec<Splat>,
    pub(super) bins: Vec<Bins>,
    scratch: PerThread<Scratch>,
}

/// Where a frame is drawn to. All parts have the camera's size.
pub(super) struct Target<'a> {
    pub(super) rendered: &'a mut Rendered,
    /// The weight with which the layer's colour enters each pixel.
    pub(super) shown: Option<&'a mut Mask>,
}

impl Forward {
    /// Draws a frame over a background, with a layer among the splats. `profiled`: notes where the time goes.
    pub(super) fn draw(
        &mut self,
        arch: Arch,
        (posed, projection): (&Posed, &Projection),
        (background, layer): ([f32; 3], impl Layer),
        target: Target<'_>,
        profiled: bool,
    ) {
        self.scratch.fit_pool();
        self.scratch.for_each(|scratch| scratch.clock.reset(profiled));
        let grid = Grid::new(projection.tiles);
        self.preprocess(arch, posed, projection, grid);
        self.draw_strips(arch, grid, (background, layer), target);
    }

    /// Whether a frame of so many Gaussians and strips was drawn last.
    ///
    /// # Errors
    /// If not.
    pub(super) fn check(&self, gaussians: usize, grid: Grid) -> Result<(), SceneError> {
        if self.splats.len() == gaussians && self.bins.iter().all(|bins| bins.strips() == grid.count()) {
            return Ok(());
        }
        let found = format!("{} Gaussians drawn last, or another size", self.splats.len());
        Err(SceneError::new("frame", found, "the frame that the same renderer drew last"))
    }

    /// Number of Gaussians that reached the image.
    pub(super) fn visible(&self) -> usize {
        self.bins.iter().map(Bins::splats).sum()
    }

    /// Where the time went, if it was noted.
    pub(super) fn phase_times(&self) -> PhaseTimes {
        let mut times = PhaseTimes::default();
        self.scratch.for_each(|scratch| times.add(&scratch.clock.times));
        times
    }

    fn preprocess(&mut self, arch: Arch, posed: &Posed, projection: &Projection, grid: Grid) {
        let chunk = chunk_length(posed.len());
        self.splats.resize(posed.len(), Splat::default());
        self.bins.resize_with(posed.len().div_ceil(chunk), Bins::default);
        let scratch = &self.scratch;
        self.splats.par_chunks_mut(chunk).zip(&mut self.bins).enumerate().for_each(|(i, (splats, bins))| {
            scratch.with(|scratch| {
                scratch.clock.start();
                lanes::run(arch, Preprocess { posed, projection, grid, first: i * chunk, splats, bins });
                scratch.clock.lap(Phase::Preprocess);
            });
        });
    }

    fn draw_strips(
        &self,
        arch: Arch,
        grid: Grid,
        (background, layer): ([f32; 3], impl Layer),
        Target { rendered, shown }: Target<'_>,
    ) {
        let width = rendered.image.width();
        let slab = width * TILE;
        let mut shown: Vec<&mut [f32]> =
            shown.map(|mask| mask.values_mut().chunks_mut(slab).collect()).unwrap_or_default();
        shown.resize_with(rendered.image.height().div_ceil(TILE), Default::default);
        let Rendered { image, alpha, depth } = rendered;
        let slabs = image
            .pixels_mut()
            .par_chunks_mut(slab)
            .zip(alpha.values_mut().par_chunks_mut(slab))
            .zip(depth.values_mut().par_chunks_mut(slab))
            .zip(shown);
        slabs.enumerate().for_each(|(row, (((colour, alpha), depth), shown))| {
            let strips = split_slab(width, colour, alpha, depth, shown);
            strips.into_par_iter().enumerate().for_each(|(column, rows)| {
                self.scratch.with(|scratch| {
                    let strip = grid.strip(row * grid.across + column);
                    let (bins, splats) = (&self.bins[..], &self.splats[..]);
                    lanes::run(arch, DrawStrip { strip, bins, splats, background, layer, rows, scratch });
                });
            });
        });
    }
}

/// The strips of up to sixteen rows of the output.
fn split_slab<'a>(
    width: usize,
    colour: &'a mut [[f32; 3]],
    alpha: &'a mut [f32],
    depth: &'a mut [f32],
    shown: &'a mut [f32],
) -> Vec<Rows<'a>> {
    let mut strips: Vec<Rows> = Vec::new();
    strips.resize_with(width.div_ceil(STRIP_WIDTH), Rows::default);
    let rows = colour.chunks_mut(width).zip(alpha.chunks_mut(width)).zip(depth.chunks_mut(width));
    for (y, ((colour, alpha), depth)) in rows.enumerate() {
        let parts = colour
            .chunks_mut(STRIP_WIDTH)
            .zip(alpha.chunks_mut(STRIP_WIDTH))
            .zip(depth.chunks_mut(STRIP_WIDTH));
        for (strip, ((colour, alpha), depth)) in strips.iter_mut().zip(parts) {
            (strip.colour[y], strip.alpha[y], strip.depth[y]) = (colour, alpha, depth);
        }
    }
    for (y, row) in shown.chunks_mut(width).enumerate() {
        for (strip, part) in strips.iter_mut().zip(row.chunks_mut(STRIP_WIDTH)) {
            strip.shown[y] = part;
        }
    }
    strips
}
