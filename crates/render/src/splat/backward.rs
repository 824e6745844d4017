//! The way back through the rasterizer: from derivatives by pixel to derivatives by Gaussian.
//!
//! Two parallel phases, the forward ones in reverse. Each strip sorts its splats again, walks its blocks back to front
//! (`backward_blend`, `backward_strip`) and sums what they ask of every splat into a place of its own; then each chunk of
//! Gaussians adds up the strips' sums in their order and takes them back through projection and colour
//! (`backward_gaussian`, `backward_project`, `backward_colour`). Like the image, the gradient has the same bits for any
//! number of threads and any vector width.

use super::backward_blend::SplatSums;
use super::backward_gaussian::{BackwardGaussians, Output};
use super::backward_strip::{self, BackwardStrip};
use super::bin::Bins;
use super::colour::sh_count;
use super::derivatives::Derivatives;
use super::forward::Forward;
use super::grid::Grid;
use super::lanes;
use super::layer::Layer;
use super::parallel::{PerThread, chunk_length};
use super::project::Projection;
use glam::{Mat3, Vec3};
use pulp::Arch;
use rayon::prelude::*;
use skinsplat_core::scene::{Posed, PosedGradient, RenderedGradient, SceneError};

/// A frame that was drawn, on its way back.
pub(super) struct Frame<'a> {
    pub(super) arch: Arch,
    pub(super) posed: &'a Posed<'a>,
    pub(super) projection: &'a Projection,
    pub(super) grid: Grid,
    pub(super) forward: &'a Forward,
    pub(super) derivatives: Derivatives,
}

/// What the way back keeps from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Backward {
    /// By strip, and there in the order in which the chunks list the strip's splats.
    sums: Vec<SplatSums>,
    /// Where the sums of each chunk and strip begin, chunk by chunk.
    starts: Vec<u32>,
    strips: PerThread<backward_strip::Scratch>,
    gaussians: PerThread<Vec<SplatSums>>,
}

impl Backward {
    /// From derivatives by pixel to `gradient`, for a frame over a background with a layer among the splats.
    ///
    /// # Errors
    /// More splats in all strips than an `u32` counts.
    pub(super) fn run(
        &mut self,
        frame: &Frame<'_>,
        behind: ([f32; 3], impl Layer),
        upstream: &RenderedGradient,
        gradient: &mut PosedGradient,
    ) -> Result<(), SceneError> {
        let lengths = self.lay_out(&frame.forward.bins, frame.grid.count())?;
        self.through_strips(frame, behind, upstream, &lengths);
        self.through_gaussians(frame, gradient);
        Ok(())
    }

    /// Gives every splat of every strip a place; the number of places of each strip.
    fn lay_out(&mut self, bins: &[Bins], strips: usize) -> Result<Vec<usize>, SceneError> {
        self.starts.clear();
        self.starts.resize(bins.len() * strips, 0);
        let mut total = 0;
        let lengths = (0..strips).map(|strip| {
            let before = total;
            for (chunk, bins) in bins.iter().enumerate() {
                self.starts[chunk * strips + strip] = total as u32;
                total += bins.strip(strip).len();
            }
            total - before
        });
        let lengths = lengths.collect();
        if u32::try_from(total).is_err() {
            return Err(SceneError::new("splats", format!("{total} in all strips"), "at most 4294967295"));
        }
        self.sums.resize(total, SplatSums::default());
        Ok(lengths)
    }

    fn through_strips(
        &mut self,
        frame: &Frame<'_>,
        (background, layer): ([f32; 3], impl Layer),
        upstream: &RenderedGradient,
        lengths: &[usize],
    ) {
        self.strips.fit_pool();
        let (scratch, mut sums) = (&self.strips, &mut self.sums[..]);
        let mut strips = Vec::with_capacity(lengths.len());
        for (strip, &length) in lengths.iter().enumerate() {
            let (of_strip, others) = sums.split_at_mut(length);
            sums = others;
            if length > 0 {
                strips.push((frame.grid.strip(strip), of_strip));
            }
        }
        let Frame { arch, forward, derivatives, .. } = *frame;
        strips.into_par_iter().with_max_len(1).for_each(|(strip, sums)| {
            scratch.with(|scratch| {
                let kernel = BackwardStrip {
                    strip,
                    bins: &forward.bins,
                    splats: &forward.splats,
                    upstream,
                    background,
                    layer,
                    greatest_alpha: derivatives.greatest_alpha(),
                    sums,
                    scratch,
                };
                lanes::run(arch, kernel);
            });
        });
    }

    fn through_gaussians(&mut self, frame: &Frame<'_>, gradient: &mut PosedGradient) {
        let Frame { arch, posed, projection, forward, derivatives, .. } = *frame;
        fit(gradient, posed);
        self.gaussians.fit_pool();
        let Self { sums, starts, gaussians: scratch, .. } = self;
        let chunk = chunk_length(posed.len());
        let strips = starts.len() / forward.bins.len().max(1);
        let chunks = Output::chunks(gradient, chunk, sh_count(posed))
            .zip(&forward.bins)
            .zip(starts.par_chunks(strips.max(1)));
        chunks.enumerate().for_each(|(i, ((out, bins), starts))| {
            scratch.with(|scratch| {
                let first = i * chunk;
                let kernel = BackwardGaussians {
                    posed,
                    projection,
                    derivatives,
                    first,
                    bins,
                    sums,
                    starts,
                    out,
                    scratch,
                };
                lanes::run(arch, kernel);
            });
        });
    }
}

/// Makes every array fit. Every entry is written later.
fn fit(gradient: &mut PosedGradient, posed: &Posed) {
    let n = posed.len();
    gradient.means.resize(n, Vec3::ZERO);
    gradient.factors.resize(n, Mat3::ZERO);
    gradient.opacities.resize(n, 0.0);
    gradient.sh.resize(posed.sh.len(), [0.0; 3]);
    gradient.view_frames.resize(posed.view_frames.map_or(0, <[_]>::len), Mat3::ZERO);
    gradient.screen.resize(n, [0.0; 2]);
    gradient.radii.resize(n, 0.0);
}
