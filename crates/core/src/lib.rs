//! What everything else stands on: [`math`] of rotations and spherical harmonics, and the types of a [`scene`].
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod math;
pub mod scene;
