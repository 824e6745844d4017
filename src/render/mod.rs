//! From geometry and a camera to an image: [`splat`] draws Gaussians, [`mesh`] draws triangles. [`definition`] is the oracle.

pub mod definition;
pub mod mesh;
pub mod splat;
