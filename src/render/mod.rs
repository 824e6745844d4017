//! From a posed scene to an image: the triangle rasterizer.

pub mod mesh;
