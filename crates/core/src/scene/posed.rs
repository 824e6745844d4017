//! The waist of the program: what a strategy produces and the renderer draws.

use super::{Gaussians, Image};
use crate::math::portable;
use glam::{Mat3, Vec3};

/// How a colour leaves the SH evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourClamp {
    /// Clamped at 0 from below only, as in 3DGS.
    #[default]
    NonNegative,
    /// Clamped to \[0, 1\], as in Animatable 3D Gaussians.
    Unit,
}

/// Gaussians in world space, ready to draw: a view of arrays that anybody may own. After posing, nobody asks which strategy
/// it was. Every slice has one entry per Gaussian, unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posed<'a> {
    /// World positions, metres.
    pub means: &'a [Vec3],
    /// M per Gaussian, with Σ = M Mᵀ: a rotated (`R diag(s)`) and an affine (`B R_c diag(s)`) covariance are the same
    /// thing to the renderer.
    pub factors: &'a [Mat3],
    /// In \[0, 1\], after the sigmoid.
    pub opacities: &'a [f32],
    /// SH degree of `sh`, 0 to 3.
    pub sh_degree: usize,
    /// `(sh_degree + 1)^2` RGB coefficients per Gaussian, 3DGS basis and order.
    pub sh: &'a [[f32; 3]],
    /// F per Gaussian: SH are read along `normalize(F d)` for the direction d from the camera to the Gaussian. `None`
    /// reads them along d itself.
    pub view_frames: Option<&'a [Mat3]>,
    /// How colours are clamped.
    pub colour_clamp: ColourClamp,
    /// The posed unit quaternion (w, x, y, z) of each Gaussian where the strategy has one (`factors` are then
    /// `R(q) diag(s)`); `None` for affine or improper covariances. For export only: renderers read `factors`.
    pub rotations: Option<&'a [[f32; 4]]>,
}

impl Posed<'_> {
    /// No Gaussians.
    pub const NOTHING: Posed<'static> = Posed {
        means: &[],
        factors: &[],
        opacities: &[],
        sh_degree: 0,
        sh: &[],
        view_frames: None,
        colour_clamp: ColourClamp::NonNegative,
        rotations: None,
    };

    /// Number of Gaussians.
    #[inline]
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// A copy that owns its arrays.
    pub fn into_owned(self) -> OwnedPosed {
        OwnedPosed {
            means: self.means.to_vec(),
            factors: self.factors.to_vec(),
            opacities: self.opacities.to_vec(),
            sh_degree: self.sh_degree,
            sh: self.sh.to_vec(),
            view_frames: self.view_frames.map(<[_]>::to_vec),
            colour_clamp: self.colour_clamp,
            rotations: self.rotations.map(<[_]>::to_vec),
        }
    }
}

/// A [`Posed`] that is kept, or changed: the same fields, owned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedPosed {
    /// See [`Posed::means`].
    pub means: Vec<Vec3>,
    /// See [`Posed::factors`].
    pub factors: Vec<Mat3>,
    /// See [`Posed::opacities`].
    pub opacities: Vec<f32>,
    /// See [`Posed::sh_degree`].
    pub sh_degree: usize,
    /// See [`Posed::sh`].
    pub sh: Vec<[f32; 3]>,
    /// See [`Posed::view_frames`].
    pub view_frames: Option<Vec<Mat3>>,
    /// See [`Posed::colour_clamp`].
    pub colour_clamp: ColourClamp,
    /// See [`Posed::rotations`].
    pub rotations: Option<Vec<[f32; 4]>>,
}

impl OwnedPosed {
    /// The Gaussians as they stand, without a body: what any splat viewer draws.
    pub fn from_static(gaussians: &Gaussians) -> Self {
        let rotations = gaussians.unit_rotations();
        let factors = rotations
            .iter()
            .zip(&gaussians.log_scales)
            .map(|(&[w, x, y, z], log_scale)| {
                Mat3::from_quat(glam::Quat::from_xyzw(x, y, z, w))
                    * Mat3::from_diagonal(log_scale.map(portable::exp))
            })
            .collect();
        Self {
            means: gaussians.means.clone(),
            factors,
            opacities: gaussians.opacities(),
            sh_degree: gaussians.sh_degree,
            sh: gaussians.sh.clone(),
            view_frames: None,
            colour_clamp: ColourClamp::NonNegative,
            rotations: Some(rotations),
        }
    }

    /// What a renderer draws.
    #[inline]
    pub fn as_posed(&self) -> Posed<'_> {
        Posed {
            means: &self.means,
            factors: &self.factors,
            opacities: &self.opacities,
            sh_degree: self.sh_degree,
            sh: &self.sh,
            view_frames: self.view_frames.as_deref(),
            colour_clamp: self.colour_clamp,
            rotations: self.rotations.as_deref(),
        }
    }

    /// Number of Gaussians.
    #[inline]
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
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
