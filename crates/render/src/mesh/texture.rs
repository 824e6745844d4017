//! Textures.

use super::Fragment;
use skinsplat_core::scene::{Image, Uv};

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
    #[inline]
    pub fn image(&self) -> &Image {
        &self.texels
    }

    /// The image, mutable.
    pub fn image_mut(&mut self) -> &mut Image {
        &mut self.texels
    }

    /// The bilinearly interpolated texel at (u, v). A NaN reads the left or the top border.
    #[inline]
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 3] {
        let mix = Bilinear::at(uv, [self.texels.width(), self.texels.height()]);
        let Bilinear { columns: [left, right], rows: [top, bottom], fraction: [fx, fy] } = mix;
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

/// The texels that a look-up mixes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bilinear {
    columns: [usize; 2],
    rows: [usize; 2],
    /// From the first column and row to the second.
    fraction: [f32; 2],
}

impl Bilinear {
    /// At (u, v), in a texture of so many columns and rows.
    pub(super) fn at([u, v]: [f32; 2], [width, height]: [usize; 2]) -> Self {
        let (left, right, fx) = neighbours(u, width);
        let (top, bottom, fy) = neighbours(1.0 - v, height);
        Self { columns: [left, right], rows: [top, bottom], fraction: [fx, fy] }
    }

    /// Column and row of each texel, and its share.
    pub(super) fn corners(&self) -> [([usize; 2], f32); 4] {
        let Self { columns: [left, right], rows: [top, bottom], fraction: [fx, fy] } = *self;
        [
            ([left, top], (1.0 - fx) * (1.0 - fy)),
            ([right, top], fx * (1.0 - fy)),
            ([left, bottom], (1.0 - fx) * fy),
            ([right, bottom], fx * fy),
        ]
    }
}

/// Texture coordinates of a fragment.
pub(super) fn coordinates(uv: &Uv, fragment: &Fragment) -> [f32; 2] {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns and two rows; v points up, so the first row is the one at v = 1.
    fn checker() -> Texture {
        let pixels = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]];
        Texture::new(Image::new(2, 2, pixels).unwrap())
    }

    #[test]
    fn texel_centres_read_texels_and_v_points_up() {
        let texture = checker();
        assert_eq!(texture.sample([0.25, 0.75]), [0.0, 0.0, 0.0]);
        assert_eq!(texture.sample([0.75, 0.75]), [1.0, 0.0, 0.0]);
        assert_eq!(texture.sample([0.25, 0.25]), [0.0, 1.0, 0.0]);
        assert_eq!(texture.sample([0.75, 0.25]), [1.0, 1.0, 1.0]);
    }

    #[test]
    fn between_texels_it_is_bilinear_and_outside_the_border_is_repeated() {
        let texture = checker();
        assert_eq!(texture.sample([0.5, 0.5]), [0.5, 0.5, 0.25]);
        assert_eq!(texture.sample([0.375, 0.75]), [0.25, 0.0, 0.0]);
        assert_eq!(texture.sample([-3.0, 7.0]), texture.sample([0.25, 0.75]));
        assert_eq!(texture.sample([f32::NAN, f32::NAN]), [0.0, 0.0, 0.0]);
        assert!(texture.sample([f32::INFINITY, f32::NEG_INFINITY]).iter().all(|c| c.is_finite()));
    }
}
