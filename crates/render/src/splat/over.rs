//! Gaussians together with a mesh: drawing over, among and behind an [`Underlay`], and the way back.

use super::{Derivatives, RenderSettings, Renderer};
use skinsplat_core::scene::{Camera, Mask, Posed, PosedGradient, Rendered, RenderedGradient, Underlay};

impl Renderer {
    /// Draws one frame with an underlay among the Gaussians. In every pixel, Gaussians whose depth is less than the
    /// underlay's lie in front of it, then comes the underlay with its coverage for an alpha, then the other Gaussians,
    /// then the background. Alpha and depth include the underlay. Where an underlay covers nothing, the pixel has the
    /// same bits as without one.
    ///
    /// `shown` is replaced by the weight with which the underlay's colour enters each pixel: its coverage times the
    /// transmittance in front of it. That is the derivative of the pixel with respect to the underlay's colour.
    ///
    /// # Panics
    /// As [`Renderer::render`]; if the underlay's parts are not of the camera's size.
    pub fn render_over(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        underlay: &Underlay,
        rendered: &mut Rendered,
        shown: &mut Mask,
    ) {
        check_size(underlay, camera);
        let (width, height) = (camera.width as usize, camera.height as usize);
        if [shown.width(), shown.height()] != [width, height] {
            *shown = Mask::filled(width, height, 0.0);
        }
        self.draw(posed, camera, settings, (*underlay, Some(shown)), rendered, false);
    }

    /// [`Renderer::backward`] for a frame that [`Renderer::render_over`] drew: the derivatives with respect to the
    /// Gaussians. Those with respect to the underlay's colour are `upstream.image` times what is shown of it; which of a
    /// pixel's Gaussians lie in front has none.
    ///
    /// # Panics
    /// As [`Renderer::backward`]; if the underlay's parts are not of the camera's size.
    pub fn backward_over(
        &mut self,
        posed: &Posed,
        camera: &Camera,
        settings: &RenderSettings,
        underlay: &Underlay,
        rendered: &Rendered,
        upstream: &RenderedGradient,
        derivatives: Derivatives,
        gradient: &mut PosedGradient,
    ) {
        check_size(underlay, camera);
        self.take_back(posed, camera, settings, *underlay, rendered, upstream, derivatives, gradient);
    }
}

fn check_size(underlay: &Underlay, camera: &Camera) {
    let size = [camera.width as usize, camera.height as usize];
    let Underlay { colour, coverage, depth } = underlay;
    assert_eq!([colour.width(), colour.height()], size, "the underlay's colour must have the camera's size");
    for (part, mask) in [("coverage", coverage), ("depth", depth)] {
        assert_eq!([mask.width(), mask.height()], size, "the underlay's {part} must have the camera's size");
    }
}
