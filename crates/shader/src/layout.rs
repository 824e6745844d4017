//! What the shader's buffers hold. Everything is 32 bits wide and little-endian.
//!
//! | group, binding | what | per | numbers |
//! |---|---|---|---|
//! | 0, 0 | [`Params`] (uniform) | dispatch | 12 |
//! | 0, 1 | joints | joint | 8: quaternion x, y, z, w; translation, unused |
//! | 0, 2 | Gaussians | Gaussian | 12: mean, unused; quaternion x, y, z, w; standard deviations, unused |
//! | 0, 3 | indices of joints | Gaussian | 4 per set, `u32` |
//! | 0, 4 | weights | Gaussian | 4 per set |
//! | 0, 5 | posed means | Gaussian | 4: x, y, z, 1 |
//! | 0, 6 | covariances | Gaussian | 6: xx, xy, xz, yy, yz, zz |
//! | 0, 7 | posed quaternions | Gaussian | 4: x, y, z, w |
//! | 0, 8 | relative rotations A | Gaussian | 4: x, y, z, w |
//! | 0, 9 | view directions in the rest pose | Gaussian | 4: x, y, z, 0 |
//! | 1, 0 | SH of the rest pose | Gaussian | as the strides say; red, green, blue beside one another |
//! | 1, 1 | turned SH | Gaussian | likewise |
//! | 1, 2 | colours | Gaussian | 4: red, green, blue, 1 |
//!
//! The entry points that write covariances use 6 of the group's numbers 6 and 7, the others 7.

use skinsplat_core::math::Quaternion;

/// The uniform block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Gaussians of the dispatch.
    pub count: u32,
    /// Index of the first.
    pub first: u32,
    /// Sets of four influences per Gaussian.
    pub influence_sets: u32,
    /// Power steps of [`crate::Rotation::Power`].
    pub power_steps: u32,
    /// World position of the eye, metres.
    pub camera: [f32; 3],
    /// Degree of the SH that are read or turned, 0 to 3.
    pub sh_degree: u32,
    /// Floats from a Gaussian's SH to the next one's.
    pub sh_stride: u32,
    /// Floats from a coefficient's red to the next one's.
    pub sh_coefficient_stride: u32,
}

impl Params {
    /// Bytes of the uniform block.
    pub const SIZE: u64 = 48;

    /// The block as words.
    pub fn words(&self) -> [u32; 12] {
        let [x, y, z] = self.camera.map(f32::to_bits);
        let (count, first) = (self.count, self.first);
        let strides = [self.sh_stride, self.sh_coefficient_stride];
        let sets = self.influence_sets;
        [count, first, sets, self.power_steps, x, y, z, self.sh_degree, strides[0], strides[1], 0, 0]
    }
}

/// A joint's motion x' = R x + t; the quaternion (w, x, y, z) of unit length.
pub fn joint([w, x, y, z]: Quaternion<f32>, [a, b, c]: [f32; 3]) -> [f32; 8] {
    [x, y, z, w, a, b, c, 0.0]
}

/// A Gaussian of the rest pose: mean in metres, quaternion (w, x, y, z) of unit length, standard deviations in metres.
pub fn gaussian(mean: [f32; 3], [w, x, y, z]: Quaternion<f32>, scale: [f32; 3]) -> [f32; 12] {
    let ([a, b, c], [r, s, t]) = (mean, scale);
    [a, b, c, 0.0, x, y, z, w, r, s, t, 0.0]
}

/// From (x, y, z, w) to (w, x, y, z).
pub fn quaternion([x, y, z, w]: [f32; 4]) -> Quaternion<f32> {
    [w, x, y, z]
}
