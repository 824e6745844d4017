#![doc = include_str!("../README.md")]
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

mod adjoint;
mod bake;
mod blend;
mod body_adjoint;
mod bound;
mod colour;
mod covariance;
mod error;
pub mod face_frame;
mod frame;
mod frustum;
mod groups;
mod joints;
mod jumps;
mod lanes;
mod layout;
mod lift;
pub mod nearest;
pub mod needs;
mod options;
mod poser;
mod presets;
mod push_forward;
mod rest_faces;
mod rotate;
mod spec;
mod spread;
mod strategy;
mod surface;
mod surfel;

pub use bake::{Baked, bake};
pub use bound::BoundAvatar;
pub use error::PosingError;
pub use face_frame::FaceFrame;
pub use jumps::rotation_jumps;
pub use lift::JointLift;
pub use options::{Gradients, PoseOptions};
pub use poser::{Poser, pose};
pub use presets::{PRESETS, Preset};
pub use push_forward::Across;
pub use rotate::{LbsProjection, NamedRotation, RotationChoice};
pub use spec::{Variation, variations};
pub use spread::{BendingJoints, face_spreads};
pub use strategy::{ClampChoice, ColourChoice, CovarianceChoice, Strategy};

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 4;
