//! What the world is made of: cameras, images, bodies, poses, avatars. Types with their invariants, no formats.

pub mod avatar;
pub mod body;
mod body_adjoint;
pub mod camera;
pub mod gradient;
pub mod hands;
pub mod image;
pub mod pose;
pub mod posed;
pub mod posed_body;
pub mod rasterizer;
pub mod skeleton;
pub mod skin_weights;

pub use avatar::{Avatar, Binding, FaceBinding, Gaussians};
pub use body::{Body, RestBody, ShapeSpace, Uv};
pub use camera::Camera;
pub use gradient::{AvatarGradient, BodyGradient, PoseGradient, PosedGradient, RenderedGradient};
pub use hands::{HandSpace, HandSpaces};
pub use image::{Image, Mask};
pub use pose::Pose;
pub use posed::{ColourClamp, OwnedPosed, Posed, Rendered, Underlay};
pub use posed_body::{JointTransform, PosedBody, PosedMesh};
pub use skeleton::{LocalTransform, Skeleton};
pub use skin_weights::SkinWeights;

/// A scene value that breaks an invariant. `field` names the part, `expected` says what it should have been; the data
/// layer adds the file.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneError {
    /// Which field is wrong, with an index where there is one ("weights\[17\]").
    pub field: String,
    /// What is wrong with it.
    pub problem: String,
    /// What was expected instead.
    pub expected: String,
}

impl std::fmt::Display for SceneError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { field, problem, expected } = self;
        write!(f, "{field}: {problem}; expected {expected}")
    }
}

impl std::error::Error for SceneError {}

impl SceneError {
    /// Builds an error from its three parts.
    pub fn new(field: impl Into<String>, problem: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { field: field.into(), problem: problem.into(), expected: expected.into() }
    }
}
