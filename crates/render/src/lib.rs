//! From geometry and a camera to an image: [`splat`] draws Gaussians, [`mesh`] draws triangles. [`definition`] is the oracle.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod definition;
pub mod mesh;
pub mod splat;

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 2;
