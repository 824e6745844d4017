//! The textured mesh of a hybrid, and the stages in which both of its parts are fitted.

use crate::Error;
use crate::options::{Moments, POSITIVE, within};
use crate::texture::MAX_SIZE;
use serde::{Deserialize, Serialize};

/// A textured mesh that is drawn with the Gaussians (HAHA): the body, its vertices moved onto the outlines in the masks,
/// under a texture that is gathered from the training frames and then fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshLayer {
    /// Side of the texture, texels.
    pub texture: u32,
    /// Learning rate of the texels' colours; 0 leaves them as gathered.
    pub rate: f32,
    /// See [`TextureInit::prior_weight`](crate::texture::TextureInit).
    #[serde(default = "prior_weight")]
    pub prior_weight: f32,
    /// See [`TextureInit::gutter`](crate::texture::TextureInit).
    #[serde(default = "gutter")]
    pub gutter: usize,
    /// Of Adam's steps on the texels.
    #[serde(default = "texel_moments")]
    pub moments: Moments,
    /// Share of the iterations in which Gaussians are fitted without the mesh: HAHA's first stage.
    #[serde(default)]
    pub gaussians_first: f32,
    /// Share of the iterations after that in which the texture is fitted without Gaussians, in poses that stay as they are:
    /// its second stage. In the rest both are drawn and fitted together.
    #[serde(default)]
    pub texture_next: f32,
}

/// What is drawn and fitted in an iteration of a hybrid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Gaussians alone, as in every fit without a mesh.
    Gaussians,
    /// The textured mesh alone.
    Texture,
    /// Both.
    Together,
}

fn prior_weight() -> f32 {
    0.02
}

fn gutter() -> usize {
    8
}

fn texel_moments() -> Moments {
    Moments::with_epsilon(1e-8)
}

impl MeshLayer {
    /// What is drawn and fitted at an iteration out of a number.
    pub(super) fn stage_at(&self, iteration: u32, iterations: u32) -> Stage {
        let before = |share: f32| iteration < (f64::from(share) * f64::from(iterations)).round() as u32;
        match () {
            () if before(self.gaussians_first) => Stage::Gaussians,
            () if before(self.gaussians_first + self.texture_next) => Stage::Texture,
            () => Stage::Together,
        }
    }

    /// Checks every number, as those of the recipe of this id.
    pub(super) fn check(&self, id: &str) -> Result<(), Error> {
        let refuse = |key: &str, value: String, expected: &str| {
            Err(Error::invalid(format!("recipe {id}: mesh.{key}"), value, expected))
        };
        if !(1..=MAX_SIZE).contains(&self.texture) {
            return refuse("texture", self.texture.to_string(), &format!("1 to {MAX_SIZE} texels"));
        }
        within(
            "mesh",
            &[
                ("prior_weight", f64::from(self.prior_weight), POSITIVE),
                ("gutter", self.gutter as f64, 0.0..=1024.0),
            ],
        )?;
        if !(self.rate.is_finite() && self.rate >= 0.0) {
            return refuse("rate", self.rate.to_string(), "a finite number, at least 0");
        }
        let shares = [self.gaussians_first, self.texture_next];
        if shares.iter().any(|share| !(0.0..=1.0).contains(share)) || shares.iter().sum::<f32>() > 1.0 {
            let value = format!("{} and {}", shares[0], shares[1]);
            let expected = "each 0 to 1, and no more than 1 together";
            return refuse("gaussians_first, mesh.texture_next", value, expected);
        }
        self.moments.check("mesh.moments")
    }
}
