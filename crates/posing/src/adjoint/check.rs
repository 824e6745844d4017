//! Gradients have the shapes of what they are gradients of.

use super::super::BoundAvatar;
use super::super::bound::Moves;
use super::super::error::expect_count;
use super::super::frame::Frame;
use skinsplat_core::scene::{AvatarGradient, BodyGradient, Gaussians, PosedGradient, SceneError};

/// The gradient of a posed avatar has the shape of the avatar.
pub(super) fn upstream(bound: &BoundAvatar, gradient: &PosedGradient) -> Result<(), SceneError> {
    let n = bound.len();
    expect_count("gradient of the posed means", gradient.means.len(), n)?;
    expect_count("gradient of the factors", gradient.factors.len(), n)?;
    expect_count("gradient of the opacities", gradient.opacities.len(), n)?;
    expect_count("gradient of the posed SH", gradient.sh.len(), bound.sh.len())?;
    match gradient.view_frames.len() {
        0 => Ok(()),
        found => expect_count("gradient of the view frames", found, n),
    }
}

/// The avatar and its gradient have the shape of what is bound.
pub(super) fn avatar(
    bound: &BoundAvatar,
    gaussians: &Gaussians,
    gradient: &AvatarGradient,
) -> Result<(), SceneError> {
    bound.check_counts(gaussians)?;
    let n = bound.len();
    expect_count("f_dc/f_rest", gaussians.sh.len(), bound.sh.len())?;
    expect_count("gradient of x, y, z", gradient.means.len(), n)?;
    expect_count("gradient of rot", gradient.rotations.len(), n)?;
    expect_count("gradient of scale", gradient.log_scales.len(), n)?;
    expect_count("gradient of opacity", gradient.opacity_logits.len(), n)?;
    expect_count("gradient of f_dc/f_rest", gradient.sh.len(), bound.sh.len())?;
    let embedded = if bound.moves == Moves::WithFaces { n } else { 0 };
    expect_count("gradient of barycentric", gradient.barycentric.len(), embedded)?;
    expect_count("gradient of offset", gradient.offsets.len(), embedded)
}

/// The gradient of a body has its joints.
pub(super) fn body(frame: &Frame<'_>, gradient: &BodyGradient) -> Result<(), SceneError> {
    let joints = frame.body.joints.len();
    expect_count("gradient of the joints", gradient.linear.len(), joints)?;
    expect_count("gradient of the joints' translations", gradient.translations.len(), joints)?;
    expect_count("gradient of the joints' rotations", gradient.torques.len(), joints)
}
