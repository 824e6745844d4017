//! Lens distortion undone, as OpenCV's `undistort` does it.
//!
//! Where pixel (u, v) of the undistorted picture comes from: with x = (u - cx) / fx, y = (v - cy) / fy, r2 = x x + y y,
//!
//! ```text
//! x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x x)
//! y' = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y y) + 2 p2 x y
//! ```
//!
//! and u' = fx x' + cx, v' = fy y' + cy, pixel centres at whole numbers. It is read there with bilinear weights of a 32nd pixel,
//! 0 outside, and rounded to the levels that the picture has: what the preparation scripts of PeopleSnapshot write.
//! Formula: <https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html>.

use skinsplat_core::scene::{Image, Mask, SceneError};

/// A pinhole and the five coefficients k1 k2 p1 p2 k3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Distortion {
    /// fx, fy.
    pub(super) focal: [f64; 2],
    /// cx, cy.
    pub(super) centre: [f64; 2],
    /// k1 k2 p1 p2 k3.
    pub(super) coefficients: [f64; 5],
}

/// The levels of an 8-bit picture.
const LEVELS: f64 = 255.0;

/// Steps per pixel of the places that are read.
const STEPS: f64 = 32.0;

impl Distortion {
    /// True if there is none.
    pub(super) fn is_none(&self) -> bool {
        self.coefficients == [0.0; 5]
    }

    /// Every number, for digests.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.focal.into_iter().chain(self.centre).chain(self.coefficients)
    }

    /// Where a pixel of the undistorted picture is in the distorted one.
    fn source(&self, u: f64, v: f64) -> [f64; 2] {
        let ([fx, fy], [cx, cy]) = (self.focal, self.centre);
        let [k1, k2, p1, p2, k3] = self.coefficients;
        let (x, y) = ((u - cx) / fx, (v - cy) / fy);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let tangential =
            [2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y];
        [fx * (x * radial + tangential[0]) + cx, fy * (y * radial + tangential[1]) + cy]
    }

    /// The undistorted picture.
    pub(super) fn undone(&self, image: &Image) -> Result<Image, SceneError> {
        let (width, height) = (image.width(), image.height());
        let read = |x: usize, y: usize| image.at(x, y).map(f64::from);
        let level = |v: f64| (((v * LEVELS + 0.5).floor()) / LEVELS) as f32;
        let pixels = self.remapped(width, height, read).map(|rgb| rgb.map(level)).collect();
        Image::new(width, height, pixels)
    }

    /// The undistorted mask, each pixel wholly in or out.
    pub(super) fn undone_mask(&self, mask: &Mask) -> Result<Mask, SceneError> {
        let (width, height) = (mask.width(), mask.height());
        let read = |x: usize, y: usize| [f64::from(mask.at(x, y))];
        let values = self.remapped(width, height, read).map(|[v]| f32::from(v >= 0.5)).collect();
        Mask::new(width, height, values)
    }

    /// Bilinear means at the sources of all pixels, row by row.
    fn remapped<const N: usize>(
        &self,
        width: usize,
        height: usize,
        read: impl Fn(usize, usize) -> [f64; N],
    ) -> impl Iterator<Item = [f64; N]> {
        let inside = move |x: f64, y: f64| {
            let within = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
            if within { read(x as usize, y as usize) } else { [0.0; N] }
        };
        let places = (0..height).flat_map(move |v| (0..width).map(move |u| (u as f64, v as f64)));
        let distortion = *self;
        places.map(move |(u, v)| {
            let [x, y] = distortion.source(u, v).map(|place| (place * STEPS).round_ties_even() / STEPS);
            let ([left, top], [s, t]) = ([x.floor(), y.floor()], [x - x.floor(), y - y.floor()]);
            let corners = [
                (inside(left, top), (1.0 - s) * (1.0 - t)),
                (inside(left + 1.0, top), s * (1.0 - t)),
                (inside(left, top + 1.0), (1.0 - s) * t),
                (inside(left + 1.0, top + 1.0), s * t),
            ];
            std::array::from_fn(|c| corners.iter().map(|(value, weight)| value[c] * weight).sum())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_coefficients_a_picture_stays_as_it_is() {
        let plain = Distortion { focal: [20.0, 21.0], centre: [3.5, 2.5], coefficients: [0.0; 5] };
        let pixels: Vec<[f32; 3]> =
            (0..48).map(|i| [i as f32 / 255.0, (i * 5) as f32 / 255.0, 1.0]).collect();
        let image = Image::new(8, 6, pixels).unwrap();
        assert!(plain.is_none());
        assert_eq!(plain.undone(&image).unwrap(), image);
        let mask = Mask::new(8, 6, (0..48).map(|i| f32::from(i % 3 == 0)).collect()).unwrap();
        assert_eq!(plain.undone_mask(&mask).unwrap(), mask);
    }
}
