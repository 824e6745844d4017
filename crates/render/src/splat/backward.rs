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
use super::bin::{Bins, Grid};
use super::blend::MAX_ALPHA;
use super::pane::{Layer, Nothing};
use super::project::View;
use super::{RenderSettings, Renderer, check, chunk_length, with_scratch};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, Posed, PosedGradient, Rendered, RenderedGradient};
use std::sync::Mutex;

/// Which derivatives [`Renderer::backward`] computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Derivatives {
    /// Those of the image as it is drawn. Whether a splat is drawn at a pixel at all (culling, alpha of 1/255, the least
    /// transmittance) and the order of splats have none.
    #[default]
    Exact,
    /// Those that the original 3DGS CUDA kernels computed (Kerbl et al. 2023), with their deviations:
    /// - the cap of alpha at 0.99 passes derivatives as if it were not there;
    /// - the squared determinant of the screen covariance is enlarged by 1e-7;
    /// - beyond the Jacobian's limit, its change with depth is taken for what it is within;
    /// - the derivative of the antialiasing factor is evaluated at the low-passed covariance.
    OriginalKernels,
}

/// What the way back keeps from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// By strip, and there in the order in which the chunks list the strip's splats.
    sums: Vec<SplatSums>,
    /// Where the sums of each chunk and strip begin, chunk by chunk.
    starts: Vec<u32>,
    strips: Vec<Mutex<backward_strip::Scratch>>,
    gaussians: Vec<Mutex<Vec<SplatSums>>>,
}

impl Renderer {
    /// The derivatives of a loss with respect to what was drawn last, from those with respect to the pixels. Must follow
    /// [`Renderer::render_into`] (or `render`) of the same `posed`, `camera` and `settings` into `rendered`. `gradient` is
    /// overwritten; it keeps its memory.
    ///
    /// # Panics
    /// If `rendered` or `upstream` are not of the camera's size, or this renderer did not draw as many Gaussians or as
    /// large an image last.
    pub fn backward(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        rendered: &Rendered,
        upstream: &RenderedGradient,
        derivatives: Derivatives,
        gradient: &mut PosedGradient,
    ) {
        self.take_back(posed, camera, settings, Nothing, rendered, upstream, derivatives, gradient);
    }

    /// [`Renderer::backward`] with a layer among the splats.
    pub(super) fn take_back(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        layer: impl Layer,
        rendered: &Rendered,
        upstream: &RenderedGradient,
        derivatives: Derivatives,
        gradient: &mut PosedGradient,
    ) {
        check(posed, camera);
        check_sizes(camera, rendered, upstream);
        let view = View::new(camera, settings.antialiased);
        let grid = Grid::new(view.tiles);
        assert!(
            self.splats.len() == posed.len() && self.bins.iter().all(|bins| bins.strips() == grid.count()),
            "backward must follow the drawing of the same frame by the same renderer"
        );
        let mut memory = std::mem::take(&mut self.backward);
        let lengths = memory.lay_out(&self.bins, grid.count());
        let behind = (settings.background, layer);
        self.backward_strips(grid, behind, upstream, derivatives, &lengths, &mut memory);
        self.backward_gaussians(posed, &view, derivatives, &mut memory, gradient);
        self.backward = memory;
    }

    fn backward_strips(
        &self,
        grid: Grid,
        (background, layer): ([f32; 3], impl Layer),
        upstream: &RenderedGradient,
        derivatives: Derivatives,
        lengths: &[usize],
        memory: &mut Memory,
    ) {
        let greatest_alpha = match derivatives {
            Derivatives::Exact => MAX_ALPHA,
            Derivatives::OriginalKernels => f32::INFINITY,
        };
        memory.strips.resize_with(rayon::current_num_threads(), Mutex::default);
        let (scratch, mut sums) = (&memory.strips, &mut memory.sums[..]);
        let mut strips = Vec::with_capacity(lengths.len());
        for (strip, &length) in lengths.iter().enumerate() {
            let (of_strip, others) = sums.split_at_mut(length);
            sums = others;
            if length > 0 {
                strips.push((strip, of_strip));
            }
        }
        strips.into_par_iter().with_max_len(1).for_each(|(strip, sums)| {
            with_scratch(scratch, |scratch| {
                self.simd.run(BackwardStrip {
                    strip,
                    column: strip % grid.across,
                    row: strip / grid.across,
                    bins: &self.bins,
                    splats: &self.splats,
                    upstream,
                    background,
                    layer,
                    greatest_alpha,
                    sums,
                    scratch,
                });
            });
        });
    }

    fn backward_gaussians(
        &self,
        posed: &Posed,
        view: &View,
        derivatives: Derivatives,
        memory: &mut Memory,
        gradient: &mut PosedGradient,
    ) {
        fit(gradient, posed);
        memory.gaussians.resize_with(rayon::current_num_threads(), Mutex::default);
        let Memory { sums, starts, gaussians: scratch, .. } = memory;
        let chunk = chunk_length(posed.len());
        let strips = starts.len() / self.bins.len().max(1);
        let coefficients = (posed.sh_degree + 1).pow(2);
        Output::chunks(gradient, chunk, coefficients)
            .zip(&self.bins)
            .zip(starts.par_chunks(strips.max(1)))
            .enumerate()
            .for_each(|(i, ((out, bins), starts))| {
                with_scratch(scratch, |scratch| {
                    self.simd.run(BackwardGaussians {
                        posed,
                        view,
                        derivatives,
                        first: i * chunk,
                        bins,
                        sums,
                        starts,
                        out,
                        scratch,
                    });
                });
            });
    }
}

impl Memory {
    /// Gives every splat of every strip a place; the number of places of each strip.
    fn lay_out(&mut self, bins: &[Bins], strips: usize) -> Vec<usize> {
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
        assert!(u32::try_from(total).is_ok(), "at most 2^32 - 1 splats in all strips");
        self.sums.resize(total, SplatSums::default());
        lengths
    }
}

/// Makes every array fit. Every entry is written later.
fn fit(gradient: &mut PosedGradient, posed: &Posed) {
    let n = posed.len();
    gradient.means.resize(n, Vec3::ZERO);
    gradient.factors.resize(n, Mat3::ZERO);
    gradient.opacities.resize(n, 0.0);
    gradient.sh.resize(posed.sh.len(), [0.0; 3]);
    gradient.screen.resize(n, [0.0; 2]);
    gradient.radii.resize(n, 0.0);
}

fn check_sizes(camera: &Camera, rendered: &Rendered, upstream: &RenderedGradient) {
    let size = [camera.width as usize, camera.height as usize];
    let image = |image: &skinsplat_core::scene::Image| [image.width(), image.height()];
    assert_eq!(image(&rendered.image), size, "the image drawn must have the camera's size");
    assert_eq!(image(&upstream.image), size, "the image's derivatives must have the camera's size");
    if let Some(alpha) = &upstream.alpha {
        assert_eq!([alpha.width(), alpha.height()], size, "alpha's derivatives must have the camera's size");
    }
}
