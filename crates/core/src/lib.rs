//! What everything else stands on: [`math`] of rotations and spherical harmonics, and the types of a [`scene`].

pub mod math;
pub mod scene;
