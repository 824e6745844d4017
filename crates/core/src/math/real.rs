//! The two floating-point precisions.

use std::fmt::{Debug, Display};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32` or `f64`: the arithmetic that the kernels of this layer need. Sealed.
pub trait Real:
    sealed::Sealed
    + Copy
    + Debug
    + Display
    + Default
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// Three numbers that travel together through SIMD registers (an RGB coefficient).
    type Triple: Copy
        + From<[Self; 3]>
        + Into<[Self; 3]>
        + Add<Output = Self::Triple>
        + Sub<Output = Self::Triple>
        + Neg<Output = Self::Triple>
        + Mul<Self, Output = Self::Triple>;

    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// The smallest positive normal number.
    const MIN_POSITIVE: Self;

    /// The nearest number of this precision.
    fn from_f64(value: f64) -> Self;
    /// The same number in `f64` (exact).
    fn to_f64(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// e to the power of `self`, of the same bits everywhere.
    fn exp(self) -> Self;
    /// `self` to the power of `y`, of the same bits everywhere.
    fn pow(self, y: Self) -> Self;
    /// Four-quadrant angle of the point (x = `x`, y = `self`), radians.
    fn atan2(self, x: Self) -> Self;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// The larger of the two (the other one where one is NaN).
    fn max(self, other: Self) -> Self;
    /// The smaller of the two (the other one where one is NaN).
    fn min(self, other: Self) -> Self;
}

macro_rules! real {
    ($type:ident, $triple:ty, $exp:path, $pow:path) => {
        impl Real for $type {
            type Triple = $triple;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = $type::EPSILON;
            const MIN_POSITIVE: Self = $type::MIN_POSITIVE;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type::abs(self)
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                $type::copysign(self, sign)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline(always)]
            fn pow(self, y: Self) -> Self {
                $pow(self, y)
            }
            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                super::portable::atan2(self, x)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $type::is_finite(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                $type::max(self, other)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                $type::min(self, other)
            }
        }
    };
}

real!(f32, glam::Vec3A, super::portable::exp_of_f32, super::portable::pow_of_f32);
real!(f64, glam::DVec3, libm::exp, libm::pow);
