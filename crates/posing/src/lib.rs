//! How Gaussians turn with a body: a strategy is three choices, and every strategy answers in [`Posed`].
//!
//! For a Gaussian with canonical rotation R_c, scales S, SH s and skinning weights w_j, joints with rotations R_j
//! relative to the rest pose and their blend B = Σ w_j R_j:
//!
//! | axis | choices |
//! |---|---|
//! | rotation | [`LbsProjection`] of B, [`FaceFrame`], average of quaternions (per Gaussian or per vertex), sum of quaternions with signs ([`JointLift`]), dual quaternions |
//! | covariance | R R_c S² R_cᵀ Rᵀ, or affine: B R_c S² R_cᵀ Bᵀ |
//! | colour | SH left alone; rotated (Eq. 9); view direction read with Bᵀ or Rᵀ |
//!
//! The paper's four strategies and the stock methods are [`PRESETS`] over these axes; text like
//! `quaternion-average+rotation=power-15+colour=none` varies one. A fifth of anything is one enum arm, one row in the
//! table of ids and one function: `rotate` for rotations, `covariance`, `colour`. The compiler lists the places.
//!
//! [`BoundAvatar`] holds what does not depend on the pose; [`pose()`] is the hot path.
//!
//! [`Posed`]: skinsplat_core::scene::Posed
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

mod adjoint;
mod bake;
mod blend;
mod bound;
mod colour;
mod covariance;
mod error;
pub mod face_frame;
mod frame;
mod frustum;
mod groups;
mod joints;
mod lanes;
mod layout;
mod lift;
pub mod nearest;
pub mod needs;
mod options;
mod poser;
mod presets;
mod rest_faces;
mod rotate;
mod spec;
mod strategy;
mod surface;
mod surfel;

pub use bake::{Baked, bake};
pub use bound::BoundAvatar;
pub use error::PosingError;
pub use face_frame::FaceFrame;
pub use lift::JointLift;
pub use options::PoseOptions;
pub use poser::{Poser, pose};
pub use presets::{PRESETS, Preset};
pub use rotate::{LbsProjection, NamedRotation, RotationChoice};
pub use spec::{Variation, variations};
pub use strategy::{ClampChoice, ColourChoice, CovarianceChoice, Strategy};

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 3;
