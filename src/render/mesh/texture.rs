//! Textures.

use super::Fragment;
use crate::scene::{Image, Uv};

/// An image that is looked up by texture coordinates in OBJ convention: u to the right, v **up**, (0, 0) at the bottom
/// left corner of the bottom left texel. Outside of \[0, 1\] the border is repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    texels: Image,
}

impl Texture {
    /// A texture from its image, first row at the top (v = 1).
    pub fn new(texels: Image) -> Self {
        Self { texels }
    }

    /// The image, first row at the top (v = 1).
    pub fn image(&self) -> &Image {
        &self.texels
    }

    /// The bilinearly interpolated texel at (u, v). Coordinates that are not finite read the bottom left texel.
    pub fn sample(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let (left, right, fx) = neighbours(u, self.texels.width());
        let (top, bottom, fy) = neighbours(1.0 - v, self.texels.height());
        let at = |x, y| self.texels.at(x, y);
        let (a, b, c, d) = (at(left, top), at(right, top), at(left, bottom), at(right, bottom));
        std::array::from_fn(|k| {
            let (upper, lower) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
            upper + (lower - upper) * fy
        })
    }

    /// A shading closure for [`super::draw`]: this texture on a mesh with texture coordinates per face corner. Faces
    /// must be those that `uv` was made for.
    pub fn shader<'a>(&'a self, uv: &'a Uv) -> impl Fn(&Fragment) -> [f32; 3] + Sync + 'a {
        move |fragment| self.sample(coordinates(uv, fragment))
    }
}

/// Texture coordinates of a fragment.
fn coordinates(uv: &Uv, fragment: &Fragment) -> [f32; 2] {
    let corners = uv.faces[fragment.face as usize].map(|i| uv.coordinates[i as usize]);
    std::array::from_fn(|axis| (0..3).map(|k| corners[k][axis] * fragment.barycentric[k]).sum())
}

/// The two texels around a coordinate in \[0, 1\], and how far it is from the first to the second.
fn neighbours(coordinate: f32, size: usize) -> (usize, usize, f32) {
    let last = (size - 1) as f32;
    let position = (coordinate * size as f32 - 0.5).clamp(0.0, last);
    // `as` turns a NaN into 0
    let first = position as usize;
    let fraction = position - first as f32;
    (first, (first + 1).min(size - 1), if fraction.is_finite() { fraction } else { 0.0 })
}
