//! Rotations, rotation averaging and its solvers, spherical harmonics. No I/O, no allocation in kernels.
//!
//! Everything is generic over [`Real`] (`f32`, `f64`), so that both precisions of every solver are real paths.
//! Quaternions are `[T; 4]` in the order (w, x, y, z), Hamilton product, active rotations; matrices are
//! `[[T; 3]; 3]`, row-major, acting on column vectors.

pub mod average;
pub mod dual_quaternion;
pub mod matrix3;
pub mod portable;
pub mod random;
mod real;
pub mod rotation;
pub mod sh;

pub use real::Real;

/// A quaternion (w, x, y, z).
pub type Quaternion<T> = [T; 4];

/// A 3x3 matrix, row-major.
pub type Matrix3<T> = [[T; 3]; 3];

/// Inner product of two quaternions as vectors of R⁴.
#[inline(always)]
pub fn dot4<T: Real>(a: Quaternion<T>, b: Quaternion<T>) -> T {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

/// A gap that can be told from zero in this precision: wider than 16 units in the last place of the largest eigenvalue
/// (or singular value), about what summing the problem's matrix costs. False for NaN.
pub fn is_distinct<T: Real>(gap: T, largest: T) -> bool {
    gap > T::from_f64(16.0) * T::EPSILON * largest
}
