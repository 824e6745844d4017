//! The splatting rasterizer: Gaussians to an image with the semantics of the original 3DGS CUDA rasterizer (Kerbl et
//! al. 2023), so that an avatar fitted elsewhere scores the same here.
//!
//! Two parallel phases. First, chunks of Gaussians are projected and coloured and entered into the strips of the image
//! that they reach (`project`, `colour`, `preprocess`, `bin`). Then each strip sorts its splats by depth, finds the 4x4
//! pixel blocks that each can change (`reach`) and blends them block by block with the pixels in registers (`blend`).
//! A pixel is visited only for splats whose ellipse of alpha = 1/255 comes within 4x4 pixels of it, and the result is the
//! same as visiting them all.
//!
//! The image has the same bits for any number of threads and any vector width. So have the derivatives that
//! [`Renderer::backward`] takes back from the pixels to the Gaussians (`backward` and the modules named after it).
//!
//! # Where it departs from the original, on purpose
//! - Principal points may be anywhere; the Jacobian's limit stays `1.3 size / (2 focal)` on both sides of the axis.
//! - Gaussians with a number that is not finite (also after projection), or whose screen covariance has a determinant
//!   below 0 by rounding, are not drawn. (The original drops a determinant of exactly 0 only.)
//! - The screen covariance is the Gram matrix of J W M, which equals J W Σ Wᵀ Jᵀ and rounds better.
//! - Antialiasing follows the original's later version: opacity times `sqrt(max(0.000025, det / det_low_passed))`.

mod backward;
mod backward_blend;
mod backward_colour;
mod backward_gaussian;
mod backward_project;
mod backward_strip;
mod bin;
mod blend;
mod colour;
#[cfg(test)]
mod gaussians_fixture;
mod lanes;
#[cfg(target_arch = "x86_64")]
mod lanes_x86;
mod over;
mod pane;
mod preprocess;
mod profile;
mod project;
mod reach;
mod strip;
mod wide;

pub use backward::Derivatives;
pub use lanes::SimdLevel;
pub use profile::{Phase, PhaseTimes};

use bin::{Bins, Grid, STRIP_WIDTH};
use lanes::Simd;
use pane::{Layer, Nothing};
use preprocess::{Preprocess, Splat};
use project::{TILE, View};
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, Image, Mask, Posed, Rendered};
use std::sync::{Mutex, PoisonError};
use strip::{DrawStrip, Rows, Scratch};

/// How a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Linear order R, G, B; finite.
    pub background: [f32; 3],
    /// Compensates opacity for the low-pass on small splats (the original's `antialiasing` switch).
    pub antialiased: bool,
}

impl Default for RenderSettings {
    /// A black background, no antialiasing: what 3DGS trains with.
    fn default() -> Self {
        Self { background: [0.0; 3], antialiased: false }
    }
}

/// Draws one frame with a fresh [`Renderer`].
///
/// # Panics
/// As [`Renderer::render`].
pub fn render(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Rendered {
    Renderer::new().render(posed, camera, settings)
}

/// A renderer that keeps its memory from frame to frame. Work is done on the current rayon thread pool.
#[derive(Debug)]
pub struct Renderer {
    simd: Simd,
    splats: Vec<Splat>,
    bins: Vec<Bins>,
    scratch: Vec<Mutex<Scratch>>,
    backward: backward::Memory,
}

impl Default for Renderer {
    fn default() -> Self {
        Self::new()
    }
}

impl Renderer {
    /// A renderer for this processor's widest vectors.
    pub fn new() -> Self {
        Self::with_simd(Simd::detect())
    }

    /// A renderer for chosen vector instructions, `None` if this processor lacks them. The image is the same.
    pub fn with_simd_level(level: SimdLevel) -> Option<Self> {
        Simd::of_level(level).map(Self::with_simd)
    }

    fn with_simd(simd: Simd) -> Self {
        Self { simd, splats: Vec::new(), bins: Vec::new(), scratch: Vec::new(), backward: Default::default() }
    }

    /// Number of Gaussians that reached the image of the last frame drawn.
    pub fn visible(&self) -> usize {
        self.bins.iter().map(Bins::splats).sum()
    }

    /// Draws one frame.
    ///
    /// # Panics
    /// If the camera fails [`Camera::validate`] or the arrays of `posed` differ in length: both are checked where they
    /// are read.
    pub fn render(&mut self, posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Rendered {
        let mut rendered = blank(camera);
        self.render_into(posed, camera, settings, &mut rendered);
        rendered
    }

    /// Draws one frame into existing memory, which is replaced if its size is not the camera's.
    ///
    /// # Panics
    /// As [`Renderer::render`].
    pub fn render_into(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        rendered: &mut Rendered,
    ) {
        self.draw(posed, camera, settings, (Nothing, None), rendered, false);
    }

    /// [`Renderer::render_into`], and where the time went.
    ///
    /// # Panics
    /// As [`Renderer::render`].
    pub fn render_profiled(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        rendered: &mut Rendered,
    ) -> PhaseTimes {
        self.draw(posed, camera, settings, (Nothing, None), rendered, true)
    }

    /// Draws with a layer among the splats, and notes what is shown of it.
    fn draw(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        layer: (impl Layer, Option<&mut Mask>),
        rendered: &mut Rendered,
        profiled: bool,
    ) -> PhaseTimes {
        check(posed, camera);
        let size = [rendered.image.width(), rendered.image.height()];
        if size != [camera.width as usize, camera.height as usize] {
            *rendered = blank(camera);
        }
        self.scratch.resize_with(rayon::current_num_threads(), Mutex::default);
        for scratch in &mut self.scratch {
            scratch.get_mut().unwrap_or_else(PoisonError::into_inner).clock.reset(profiled);
        }
        let view = View::new(camera, settings.antialiased);
        let grid = Grid::new(view.tiles);
        self.preprocess(posed, &view, grid);
        self.draw_strips(grid, settings.background, layer, rendered);
        let mut times = PhaseTimes::default();
        for scratch in &mut self.scratch {
            times.add(&scratch.get_mut().unwrap_or_else(PoisonError::into_inner).clock.times);
        }
        times
    }

    fn preprocess(&mut self, posed: &Posed, view: &View, grid: Grid) {
        let chunk = chunk_length(posed.len());
        self.splats.resize(posed.len(), Splat::default());
        self.bins.resize_with(posed.len().div_ceil(chunk), Bins::default);
        let (simd, scratch) = (self.simd, &self.scratch);
        self.splats.par_chunks_mut(chunk).zip(&mut self.bins).enumerate().for_each(|(i, (splats, bins))| {
            with_scratch(scratch, |scratch| {
                scratch.clock.start();
                simd.run(Preprocess { posed, view, grid, first: i * chunk, splats, bins });
                scratch.clock.lap(Phase::Preprocess);
            });
        });
    }

    fn draw_strips(
        &self,
        grid: Grid,
        background: [f32; 3],
        (layer, shown): (impl Layer, Option<&mut Mask>),
        rendered: &mut Rendered,
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
                with_scratch(&self.scratch, |scratch| {
                    self.simd.run(DrawStrip {
                        strip: row * grid.across + column,
                        column,
                        row,
                        bins: &self.bins,
                        splats: &self.splats,
                        background,
                        layer,
                        rows,
                        scratch,
                    });
                });
            });
        });
    }
}

/// Gaussians per chunk: enough chunks to share out, few enough to gather from. Does not change the image.
fn chunk_length(count: usize) -> usize {
    (count / 64).clamp(256, 16384).next_multiple_of(16)
}

/// Runs `work` with this thread's scratch.
fn with_scratch<S>(scratch: &[Mutex<S>], work: impl FnOnce(&mut S)) {
    let thread = rayon::current_thread_index().unwrap_or(0) % scratch.len();
    work(&mut scratch[thread].lock().unwrap_or_else(PoisonError::into_inner));
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

fn blank(camera: &Camera) -> Rendered {
    let (width, height) = (camera.width as usize, camera.height as usize);
    Rendered {
        image: Image::filled(width, height, [0.0; 3]),
        alpha: Mask::filled(width, height, 0.0),
        depth: Mask::filled(width, height, 0.0),
    }
}

fn check(posed: &Posed, camera: &Camera) {
    if let Err(error) = camera.validate() {
        panic!("camera: {error}");
    }
    let n = posed.len();
    assert!(posed.sh_degree <= 3, "sh_degree is at most 3");
    assert_eq!(posed.factors.len(), n, "one factor per mean");
    assert_eq!(posed.opacities.len(), n, "one opacity per mean");
    assert_eq!(posed.sh.len(), n * (posed.sh_degree + 1).pow(2), "SH coefficients per mean");
    assert!(posed.view_frames.as_ref().is_none_or(|f| f.len() == n), "one view frame per mean");
    assert!(u32::try_from(n).is_ok(), "at most 2^32 - 1 Gaussians");
}
