//! Real spherical harmonics to degree 3 in the basis, order and signs of 3DGS, and their rotation.
//!
//! Coefficients are ordered by degree l, then m = −l … l. The functions are the real spherical harmonics with polar axis
//! z and an extra factor (−1)^m.

mod rotation;

pub use rotation::{Rotation, torque};

use super::Real;

/// Degree 0: 1 / (2 √π).
pub const C0: f64 = 0.28209479177387814;
/// Degree 1.
pub const C1: f64 = 0.4886025119029199;
/// Degree 2, m = −2 … 2.
pub const C2: [f64; 5] =
    [1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396];
/// Degree 3, m = −3 … 3.
pub const C3: [f64; 7] = [
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
];

/// The highest degree.
pub const MAX_DEGREE: usize = 3;

/// Number of coefficients up to a degree: (degree + 1)².
pub const fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// The basis functions in the unit direction `dir`, up to `degree` (at most 3; more counts as 3); zero above.
#[inline]
pub fn basis<T: Real>(degree: usize, [x, y, z]: [T; 3]) -> [T; 16] {
    let c = T::from_f64;
    let mut b = [T::ZERO; 16];
    b[0] = c(C0);
    if degree == 0 {
        return b;
    }
    b[1] = -c(C1) * y;
    b[2] = c(C1) * z;
    b[3] = -c(C1) * x;
    if degree == 1 {
        return b;
    }
    let (two, three, four) = (c(2.0), c(3.0), c(4.0));
    let (xx, yy, zz, xy) = (x * x, y * y, z * z, x * y);
    b[4] = c(C2[0]) * xy;
    b[5] = c(C2[1]) * (y * z);
    b[6] = c(C2[2]) * (two * zz - xx - yy);
    b[7] = c(C2[3]) * (x * z);
    b[8] = c(C2[4]) * (xx - yy);
    if degree == 2 {
        return b;
    }
    b[9] = c(C3[0]) * y * (three * xx - yy);
    b[10] = c(C3[1]) * xy * z;
    b[11] = c(C3[2]) * y * (four * zz - xx - yy);
    b[12] = c(C3[3]) * z * (two * zz - three * xx - three * yy);
    b[13] = c(C3[4]) * x * (four * zz - xx - yy);
    b[14] = c(C3[5]) * z * (xx - yy);
    b[15] = c(C3[6]) * x * (xx - three * yy);
    b
}

/// Σ coefficient × basis in the unit direction `dir`, per channel. 3DGS adds 0.5 and clamps afterwards. Coefficients
/// above `degree` or missing from the slice count as zero.
#[inline]
pub fn evaluate<T: Real>(degree: usize, coefficients: &[[T; 3]], dir: [T; 3]) -> [T; 3] {
    let basis = basis(degree, dir);
    let mut sum = [T::ZERO; 3];
    for (c, b) in coefficients.iter().zip(&basis[..count(degree.min(MAX_DEGREE))]) {
        for channel in 0..3 {
            sum[channel] += *b * c[channel];
        }
    }
    sum
}
