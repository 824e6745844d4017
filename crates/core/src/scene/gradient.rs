//! Derivatives of a scalar loss, one type per station of the road that an optimiser walks backwards: what was rendered,
//! [`Posed`], and the parameters of an [`Avatar`](super::Avatar).

use super::{Gaussians, Image, Mask, Posed};
use glam::{Mat3, Vec3};

/// Derivatives with respect to what a renderer returned.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedGradient {
    /// With respect to the colour over the background.
    pub image: Image,
    /// With respect to alpha, `1 − final transmittance`, which does not know the background; `None` for zero.
    pub alpha: Option<Mask>,
}

/// Derivatives with respect to the fields of a [`Posed`]. All arrays have one entry per Gaussian (`sh`: one per
/// coefficient); Gaussians that did not reach the image have zeros. Rotations of the view frame are not differentiated:
/// no fitted parameter moves them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedGradient {
    /// World positions.
    pub means: Vec<Vec3>,
    /// Every entry of M (Σ = M Mᵀ) by itself, columns as in `Posed::factors`.
    pub factors: Vec<Mat3>,
    /// Opacities after the sigmoid.
    pub opacities: Vec<f32>,
    /// SH coefficients, in the order of `Posed::sh`.
    pub sh: Vec<[f32; 3]>,
    /// The position on screen, per half image width and half image height (the NDC units of the original kernels, which
    /// the thresholds of densification are stated in).
    pub screen: Vec<[f32; 2]>,
    /// Radius on screen by the rule of the original kernels, pixels; 0 for Gaussians that did not reach the image.
    pub radii: Vec<f32>,
}

impl PosedGradient {
    /// Makes every array fit `posed` and fills it with zeros; keeps its memory.
    pub fn reset(&mut self, posed: &Posed) {
        let n = posed.len();
        refill(&mut self.means, n, Vec3::ZERO);
        refill(&mut self.factors, n, Mat3::ZERO);
        refill(&mut self.opacities, n, 0.0);
        refill(&mut self.sh, posed.sh.len(), [0.0; 3]);
        refill(&mut self.screen, n, [0.0; 2]);
        refill(&mut self.radii, n, 0.0);
    }
}

/// Derivatives with respect to the stored (not activated) parameters of an avatar, in the order of its [`Gaussians`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AvatarGradient {
    /// Canonical positions; zeros for face-bound Gaussians, whose means are not read.
    pub means: Vec<Vec3>,
    /// Quaternions (w, x, y, z) as stored: includes the normalisation.
    pub rotations: Vec<[f32; 4]>,
    /// Logarithms of the standard deviations.
    pub log_scales: Vec<Vec3>,
    /// Opacities before the sigmoid.
    pub opacity_logits: Vec<f32>,
    /// SH coefficients.
    pub sh: Vec<[f32; 3]>,
    /// Barycentric coordinates of face-bound Gaussians, each by itself; empty for other bindings.
    pub barycentric: Vec<[f32; 3]>,
    /// Offsets of face-bound Gaussians along the interpolated unit vertex normal; empty for other bindings.
    pub offsets: Vec<f32>,
}

impl AvatarGradient {
    /// Makes every array fit and fills it with zeros; keeps its memory.
    pub fn reset(&mut self, gaussians: &Gaussians, face_bound: bool) {
        let n = gaussians.len();
        refill(&mut self.means, n, Vec3::ZERO);
        refill(&mut self.rotations, n, [0.0; 4]);
        refill(&mut self.log_scales, n, Vec3::ZERO);
        refill(&mut self.opacity_logits, n, 0.0);
        refill(&mut self.sh, gaussians.sh.len(), [0.0; 3]);
        let bound = if face_bound { n } else { 0 };
        refill(&mut self.barycentric, bound, [0.0; 3]);
        refill(&mut self.offsets, bound, 0.0);
    }
}

fn refill<T: Clone>(values: &mut Vec<T>, count: usize, zero: T) {
    values.clear();
    values.resize(count, zero);
}
