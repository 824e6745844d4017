//! From geometry and a camera to an image: [`splat`] draws Gaussians, [`mesh`] draws triangles.

pub mod mesh;
pub mod splat;
