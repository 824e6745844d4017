//! What a pose may be told besides the strategy, and what its adjoint may be asked for.

use super::JointLift;
use skinsplat_core::math::Quaternion;
use skinsplat_core::scene::{AvatarGradient, BodyGradient, Camera};

/// What a pose may be told besides the strategy.
#[derive(Clone, Copy, Debug, Default)]
pub struct PoseOptions<'a> {
    /// The only camera that will look: Gaussians that it surely does not see are moved, but neither rotated nor coloured.
    /// The image has the same bits. For Gaussians with weights of their own and covariances that are rotated; others are
    /// posed in full.
    pub seen_by: Option<&'a Camera>,
    /// The signs of a sequence, which [`RotationChoice::LiftedSum`](super::RotationChoice::LiftedSum) reads; `None` takes
    /// those from rest. Other strategies have no use for it.
    pub lift: Option<&'a JointLift>,
    /// A rotation of one's own for every Gaussian, in place of what [`Strategy::rotation`](crate::Strategy::rotation) makes: R, relative to the
    /// canonical orientation, as unit quaternions (w, x, y, z). Means follow Eq. 6, or the mesh for face-bound Gaussians;
    /// covariances, SH and view frames follow R. In the adjoint R is a constant.
    pub rotations: Option<&'a [Quaternion<f32>]>,
}

/// Where the adjoint of a pose adds what it finds. What is not asked for costs nothing.
#[derive(Debug, Default)]
pub struct Gradients<'g> {
    /// With respect to the stored parameters of the avatar: one that [`AvatarGradient::reset`] made for it.
    pub avatar: Option<&'g mut AvatarGradient>,
    /// With respect to what was read of the posed body: one that [`BodyGradient::reset`] made for its joints.
    pub body: Option<&'g mut BodyGradient>,
}

impl<'g> From<&'g mut AvatarGradient> for Gradients<'g> {
    /// The avatar alone.
    fn from(gradient: &'g mut AvatarGradient) -> Self {
        Self { avatar: Some(gradient), body: None }
    }
}
