//! From a posed scene to an image: the splatting rasterizer and the triangle rasterizer.

pub mod mesh;
pub mod splat;
