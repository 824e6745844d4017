//! The waist of the program: what a strategy produces and the renderer draws.

use super::{Gaussians, Image};
use glam::{Mat3, Vec3};
use std::borrow::Cow;

/// How a colour leaves the SH evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourClamp {
    /// Clamped at 0 from below only, as in 3DGS.
    #[default]
    NonNegative,
    /// Clamped to \[0, 1\], as in Animatable 3D Gaussians.
    Unit,
}

/// Gaussians in world space, ready to draw. After `strategy`, nobody asks which strategy it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Posed<'a> {
    /// World positions, metres.
    pub means: Vec<Vec3>,
    /// M per Gaussian, with Σ = M Mᵀ: a rotated (`R diag(s)`) and an affine (`B R_c diag(s)`) covariance are the same
    /// thing to the renderer.
    pub factors: Vec<Mat3>,
    /// In \[0, 1\], after the sigmoid.
    pub opacities: Cow<'a, [f32]>,
    /// SH degree of `sh`, 0 to 3.
    pub sh_degree: usize,
    /// `(sh_degree + 1)^2` RGB coefficients per Gaussian, 3DGS basis and order.
    pub sh: Cow<'a, [[f32; 3]]>,
    /// F per Gaussian: SH are read along `normalize(F d)` for the direction d from the camera to the Gaussian. `None`
    /// reads them along d itself.
    pub view_frames: Option<Vec<Mat3>>,
    /// How colours are clamped.
    pub colour_clamp: ColourClamp,
    /// The posed unit quaternion (w, x, y, z) of each Gaussian where the strategy has one (`factors` are then
    /// `R(q) diag(s)`); `None` for affine or improper covariances. For export only: renderers read `factors`.
    pub rotations: Option<Vec<[f32; 4]>>,
}

impl Posed<'_> {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }
}

impl<'a> Posed<'a> {
    /// The Gaussians as they stand, without a body: what any splat viewer draws.
    pub fn from_static(gaussians: &'a Gaussians) -> Self {
        let rotations = gaussians.unit_rotations();
        let factors = rotations
            .iter()
            .zip(&gaussians.log_scales)
            .map(|(&[w, x, y, z], log_scale)| {
                Mat3::from_quat(glam::Quat::from_xyzw(x, y, z, w))
                    * Mat3::from_diagonal(log_scale.map(f32::exp))
            })
            .collect();
        Self {
            means: gaussians.means.clone(),
            factors,
            opacities: Cow::Owned(gaussians.opacities()),
            sh_degree: gaussians.sh_degree,
            sh: Cow::Borrowed(&gaussians.sh),
            view_frames: None,
            colour_clamp: ColourClamp::NonNegative,
            rotations: Some(rotations),
        }
    }
}

/// What a renderer returns.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Colour over the background, not clamped above 1.
    pub image: Image,
    /// 1 − final transmittance.
    pub alpha: super::Mask,
    /// Σ z α T, the alpha-weighted camera depth in metres (no background term); divide by `alpha` for the mean depth.
    pub depth: super::Mask,
}

/// An opaque layer among the Gaussians: per pixel a colour, how much of the pixel it covers, and how far away it is.
/// What the triangle rasterizer draws of a mesh, for the splat renderer to draw with. All three have one size.
#[derive(Clone, Copy, Debug)]
pub struct Underlay<'a> {
    /// Straight (un-premultiplied) colour.
    pub colour: &'a Image,
    /// The covered fraction of each pixel, 0 to 1.
    pub coverage: &'a super::Mask,
    /// Camera depth, metres, where anything is covered. A NaN lies behind all Gaussians.
    pub depth: &'a super::Mask,
}
