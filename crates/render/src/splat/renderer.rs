//! The rasterizer as others see it.

use super::backward::{Backward, Frame};
use super::derivatives::Derivatives;
use super::forward::{Forward, Target};
use super::grid::Grid;
use super::layer::NoLayer;
use super::profile::PhaseTimes;
use super::project::Projection;
use crate::View;
use pulp::Arch;
use skinsplat_core::scene::{Image, Mask, Posed, PosedGradient, Rendered, RenderedGradient, SceneError};
use skinsplat_simd::Level;

/// Draws one frame with a fresh [`Renderer`].
///
/// # Errors
/// As [`Renderer::render`].
pub fn render(posed: &Posed, view: &View) -> Result<Rendered, SceneError> {
    let mut renderer = Renderer::new();
    renderer.render(posed, view)?;
    Ok(renderer.rendered)
}

/// A renderer that keeps its memory from frame to frame. Work is done on the current rayon thread pool.
#[derive(Debug)]
pub struct Renderer {
    arch: Arch,
    forward: Forward,
    backward: Backward,
    rendered: Rendered,
    shown: Option<Mask>,
    profiled: bool,
}

impl Default for Renderer {
    fn default() -> Self {
        Self::new()
    }
}

impl Renderer {
    /// A renderer for the vector instructions of this process ([`skinsplat_simd::arch`]).
    pub fn new() -> Self {
        Self::with_arch(skinsplat_simd::arch())
    }

    /// A renderer for chosen vector instructions, `None` if this processor lacks them. The image is the same.
    pub fn with_simd_level(level: Level) -> Option<Self> {
        level.arch().map(Self::with_arch)
    }

    fn with_arch(arch: Arch) -> Self {
        Self {
            arch,
            forward: Forward::default(),
            backward: Backward::default(),
            rendered: blank([0, 0]),
            shown: None,
            profiled: false,
        }
    }

    /// Draws one frame into this renderer's memory. With an underlay among the Gaussians, a pixel in which it covers
    /// nothing has the same bits as without one.
    ///
    /// # Errors
    /// A camera that breaks an invariant, arrays of `posed` that differ in length, an underlay that is not of the
    /// camera's size.
    pub fn render(&mut self, posed: &Posed, view: &View) -> Result<&Rendered, SceneError> {
        view.check(posed)?;
        let size = view.size();
        if [self.rendered.image.width(), self.rendered.image.height()] != size {
            self.rendered = blank(size);
        }
        let projection = Projection::new(view.camera, view.antialiased);
        let gaussians = (posed, &projection);
        match view.underlay {
            None => {
                self.shown = None;
                let target = Target { rendered: &mut self.rendered, shown: None };
                self.forward.draw(self.arch, gaussians, (view.background, NoLayer), target, self.profiled);
            }
            Some(underlay) => {
                let same_size = |mask: &Mask| [mask.width(), mask.height()] == size;
                let shown = self.shown.take().filter(same_size);
                let shown = self.shown.insert(shown.unwrap_or_else(|| Mask::filled(size[0], size[1], 0.0)));
                let target = Target { rendered: &mut self.rendered, shown: Some(shown) };
                self.forward.draw(self.arch, gaussians, (view.background, underlay), target, self.profiled);
            }
        }
        Ok(&self.rendered)
    }

    /// The derivatives of a loss with respect to the Gaussians drawn last, from those with respect to the pixels. Must
    /// follow [`Renderer::render`] of the same `posed` and `view`. `gradient` is overwritten; it keeps its memory.
    ///
    /// Those with respect to an underlay's colour are `upstream.image` times [`Renderer::underlay_weight`]; which of a
    /// pixel's Gaussians lie in front of it has none.
    ///
    /// # Errors
    /// As [`Renderer::render`]; `upstream` that is not of the camera's size; a renderer that did not draw as many
    /// Gaussians or as large an image last.
    pub fn backward(
        &mut self,
        posed: &Posed,
        view: &View,
        upstream: &RenderedGradient,
        gradient: &mut PosedGradient,
        derivatives: Derivatives,
    ) -> Result<(), SceneError> {
        view.check(posed)?;
        view.check_size("gradient of the image", [upstream.image.width(), upstream.image.height()])?;
        if let Some(alpha) = &upstream.alpha {
            view.check_size("gradient of alpha", [alpha.width(), alpha.height()])?;
        }
        let projection = Projection::new(view.camera, view.antialiased);
        let grid = Grid::new(projection.tiles);
        self.forward.check(posed.len(), grid)?;
        let Self { arch, forward, .. } = self;
        let frame = Frame { arch: *arch, posed, projection: &projection, grid, forward, derivatives };
        match view.underlay {
            None => self.backward.run(&frame, (view.background, NoLayer), upstream, gradient),
            Some(underlay) => self.backward.run(&frame, (view.background, underlay), upstream, gradient),
        }
    }

    /// The frame drawn last; 0x0 pixels before the first.
    pub fn rendered(&self) -> &Rendered {
        &self.rendered
    }

    /// The weight with which the underlay's colour entered each pixel of the frame drawn last: its coverage times the
    /// transmittance in front of it. `None` without an underlay.
    pub fn underlay_weight(&self) -> Option<&Mask> {
        self.shown.as_ref()
    }

    /// Number of Gaussians that reached the image of the last frame drawn.
    pub fn visible(&self) -> usize {
        self.forward.visible()
    }

    /// Whether frames drawn from now on note where their time goes.
    pub fn profile(&mut self, on: bool) {
        self.profiled = on;
    }

    /// Where the time of the last frame drawn went, summed over threads; zeros without [`Renderer::profile`].
    pub fn phase_times(&self) -> PhaseTimes {
        self.forward.phase_times()
    }
}

fn blank([width, height]: [usize; 2]) -> Rendered {
    Rendered {
        image: Image::filled(width, height, [0.0; 3]),
        alpha: Mask::filled(width, height, 0.0),
        depth: Mask::filled(width, height, 0.0),
    }
}
