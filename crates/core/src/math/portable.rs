//! Elementary functions whose bits do not depend on the machine.
//!
//! Those of `std` call the C library, and two of its builds round differently: one release has other kernels than the next,
//! and one build picks another kernel on a CPU with FMA than on one without. Whatever reaches a table, an avatar or a
//! content key is computed with the functions here, which are compiled with the program (the `libm` crate, plain IEEE
//! arithmetic). Those of `f32` are those of `f64`, rounded: correct to half a unit in the last place and a little.
//! clippy's `disallowed-methods` keeps the others out. Square roots, absolute values, roundings and fused multiply-adds are
//! exact everywhere and may be used.

use super::Real;
use glam::{DQuat, DVec3};

macro_rules! of_one {
    ($($(#[$doc:meta])* $name:ident = $function:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[inline]
        pub fn $name<T: Real>(x: T) -> T {
            T::from_f64(libm::$function(x.to_f64()))
        }
    )*};
}

of_one! {
    /// 2 to the power of x.
    exp2 = exp2,
    /// Natural logarithm.
    ln = log,
    /// Logarithm to base 2.
    log2 = log2,
    /// Logarithm to base 10.
    log10 = log10,
    /// Cube root.
    cbrt = cbrt,
    /// Sine of radians.
    sin = sin,
    /// Cosine of radians.
    cos = cos,
    /// Tangent of radians.
    tan = tan,
    /// Angle with this sine, radians.
    asin = asin,
    /// Angle with this cosine, radians.
    acos = acos,
    /// Angle with this tangent, radians.
    atan = atan,
}

/// e to the power of x.
#[inline]
pub fn exp<T: Real>(x: T) -> T {
    x.exp()
}

/// [`exp`] of `f32`, which fits take of every scale and opacity in every step: the series in f64, without a branch.
#[inline]
pub(super) fn exp_of_f32(x: f32) -> f32 {
    exp_series(f64::from(x)) as f32
}

/// e to the power of `x`, for results that are rounded to `f32`.
#[inline]
fn exp_series(x: f64) -> f64 {
    // What lies beyond is 0 or infinite in f32.
    let x = x.clamp(-160.0, 160.0);
    // To the nearest integer, ties to even, by adding what has no digits below one: without SSE 4.1 rounding is a call.
    const NO_DIGITS: f64 = 6_755_399_441_055_744.0;
    let halvings = (x * std::f64::consts::LOG2_E + NO_DIGITS) - NO_DIGITS;
    let rest = x - halvings * std::f64::consts::LN_2;
    let mut series = EXP_SERIES[0];
    for coefficient in &EXP_SERIES[1..] {
        series = series * rest + coefficient;
    }
    let power = f64::from_bits(((halvings as i64 + 1023) as u64) << 52);
    series * power
}

/// 1/n! from n = 12 to 0: with |x| up to half the logarithm of 2 the next term is below 2e-16.
const EXP_SERIES: [f64; 13] = {
    let mut series = [1.0; 13];
    let (mut n, mut factorial) = (0, 1.0);
    while n < 13 {
        series[12 - n] = 1.0 / factorial;
        n += 1;
        factorial *= n as f64;
    }
    series
};

/// Sine and cosine of radians.
#[inline]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    (sin(x), cos(x))
}

/// Four-quadrant angle of the point (`x`, `y`), radians.
#[inline]
pub fn atan2<T: Real>(y: T, x: T) -> T {
    T::from_f64(libm::atan2(y.to_f64(), x.to_f64()))
}

/// Length of the vector (`x`, `y`), without overflow.
#[inline]
pub fn hypot<T: Real>(x: T, y: T) -> T {
    T::from_f64(libm::hypot(x.to_f64(), y.to_f64()))
}

/// `x` to the power of `y`.
#[inline]
pub fn pow<T: Real>(x: T, y: T) -> T {
    x.pow(y)
}

/// [`pow`] of `f32`, which generated images take of every sample: two series in f64.
#[inline]
pub(super) fn pow_of_f32(x: f32, y: f32) -> f32 {
    if !(x >= f32::MIN_POSITIVE && x.is_finite() && y.is_finite()) {
        return libm::pow(f64::from(x), f64::from(y)) as f32;
    }
    exp_series(f64::from(y) * ln_series(f64::from(x))) as f32
}

/// Natural logarithm of a normal number above 0, for results that are rounded to `f32`: with s = (m - 1) / (m + 1),
/// ln m = 2 (s + s^3/3 + s^5/5 + …).
#[inline]
fn ln_series(x: f64) -> f64 {
    let bits = x.to_bits();
    // x = m 2^e with m within a factor of the square root of 2 of 1.
    let e = (bits.wrapping_sub(std::f64::consts::FRAC_1_SQRT_2.to_bits()) as i64) >> 52;
    let m = f64::from_bits(bits.wrapping_sub((e as u64) << 52));
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let mut series = 1.0 / 21.0;
    for k in (0..10).rev() {
        series = series * square + 1.0 / f64::from(2 * k + 1);
    }
    2.0 * s * series + e as f64 * std::f64::consts::LN_2
}

/// `x` to an integer power, by repeated squaring in the precision of `x`; negative powers are reciprocals.
#[inline]
pub fn powi<T: Real>(x: T, n: i32) -> T {
    let (mut square, mut left, mut power) = (x, n.unsigned_abs(), T::ONE);
    loop {
        if left & 1 == 1 {
            power *= square;
        }
        left >>= 1;
        if left == 0 {
            break;
        }
        square *= square;
    }
    if n < 0 { T::ONE / power } else { power }
}

/// The turn about a unit axis by an angle in radians.
pub fn from_axis_angle(axis: DVec3, angle: f64) -> DQuat {
    let (sine, cosine) = sin_cos(0.5 * angle);
    let v = axis * sine;
    DQuat::from_xyzw(v.x, v.y, v.z, cosine)
}

/// The turn about an axis by its length in radians.
pub fn from_scaled_axis(v: DVec3) -> DQuat {
    let length = v.length();
    if length == 0.0 { DQuat::IDENTITY } else { from_axis_angle(v / length, length) }
}

/// The axis of a turn, as long as its angle in radians. Zero for turns of less than 2e-8.
pub fn to_scaled_axis(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    let length = v.length();
    if length < 1e-8 { DVec3::ZERO } else { v / length * (2.0 * atan2(length, q.w)) }
}

/// The angle of the turn that takes one rotation to another, radians in \[0, π\].
pub fn angle_between(p: DQuat, q: DQuat) -> f64 {
    2.0 * acos(p.dot(q).abs().min(1.0))
}

/// Spherical linear interpolation between unit quaternions, the shorter way.
pub fn slerp(from: DQuat, to: DQuat, t: f64) -> DQuat {
    let dot = from.dot(to);
    let (to, dot) = if dot < 0.0 { (-to, -dot) } else { (to, dot) };
    if dot > 1.0 - f64::EPSILON {
        return (from * (1.0 - t) + to * t).normalize();
    }
    let angle = acos(dot);
    (from * sin(angle * (1.0 - t)) + to * sin(angle * t)) * sin(angle).recip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits that were computed once, with libm 0.2.16 on x86-64: they may not change with compiler, CPU or C library.
    #[test]
    fn bits_are_the_same_everywhere() {
        let x = 0.731_f64;
        let found = [exp(x), ln(x), log10(x), sin(x), cos(x), tan(x), asin(x), acos(x), atan(x), cbrt(x)];
        let bits: Vec<String> = found.iter().map(|v| format!("{:016x}", v.to_bits())).collect();
        assert_eq!(bits, BITS);
    }

    #[test]
    fn the_exponential_of_f32_is_that_of_f64_rounded() {
        let special =
            [0.0, -0.0, 1e-45, 88.73, -87.4, -103.9, -104.5, 1e30, -1e30, f32::INFINITY, f32::NEG_INFINITY];
        let sweep = (0..2_000_000).map(|i| -105.0 + i as f32 * 9.7e-5);
        for x in special.into_iter().chain(sweep) {
            assert_eq!(exp(x).to_bits(), (libm::exp(f64::from(x)) as f32).to_bits(), "{x}");
        }
        assert!(exp(f32::NAN).is_nan());
    }

    const BITS: [&str; 10] = [
        "40009e04587c770e",
        "bfd40dcad8849dae",
        "bfc16b27c7c28b9b",
        "3fe55d1908832d68",
        "3fe7d300ae1af326",
        "3fecb1ee2f1d05fe",
        "3fea3bb068eee221",
        "3fe808463f99780f",
        "3fe43308d906d611",
        "3fecd3894664262f",
    ];

    #[test]
    fn functions_agree_with_those_of_the_system_to_the_last_place() {
        let near = |found: f64, expected: f64| {
            assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected.abs(), "{found} {expected}");
        };
        for k in 1..2000 {
            let x = f64::from(k) * 0.0137;
            near(exp(x), x.exp());
            near(ln(x), x.ln());
            near(log2(x), x.log2());
            near(log10(x), x.log10());
            near(sin(x), x.sin());
            near(cos(x), x.cos());
            near(atan(x), x.atan());
            near(atan2(x, -1.0), x.atan2(-1.0));
            near(cbrt(x), x.cbrt());
            near(hypot(x, 3.0), x.hypot(3.0));
            near(pow(x, 0.37), x.powf(0.37));
            near(powi(x, -3), 1.0 / (x * x * x));
            // of two correct roundings of one number, one may be next to the other
            let (single, system) = (exp(x as f32), (x as f32).exp());
            assert!(single.to_bits().abs_diff(system.to_bits()) <= 1);
            for y in [1.0 / 2.4, 2.4, -3.7] {
                let (single, system) = (pow(x as f32, y), (x as f32).powf(y));
                assert!(single.to_bits().abs_diff(system.to_bits()) <= 1, "{x} {y}");
            }
        }
        for (x, y) in [(0.0, 2.0), (f32::INFINITY, 0.5), (-8.0, 3.0), (1e-42, 0.5), (2.0, f32::INFINITY)] {
            assert_eq!(pow(x, y), x.powf(y));
        }
        assert!(pow(-1.0f32, 0.5).is_nan() && pow(3e38f32, 4.0).is_infinite() && pow(3e38f32, -4.0) == 0.0);
    }

    #[test]
    fn powers_are_products() {
        assert_eq!((powi(3.0, 0), powi(3.0, 1), powi(3.0, 5), powi(2.0f32, -2)), (1.0, 3.0, 243.0, 0.25));
    }

    #[test]
    fn turns_are_those_of_glam() {
        for k in 0..50 {
            let v = DVec3::new(f64::from(k) * 0.11 - 2.0, 0.3, -0.05 * f64::from(k));
            let (own, other) = (from_scaled_axis(v), DQuat::from_scaled_axis(v));
            assert!((own - other).length() < 1e-15);
            assert!((to_scaled_axis(own) - other.to_scaled_axis()).length() < 1e-14);
            let half = slerp(DQuat::from_rotation_x(0.2), own, 0.3);
            assert!((half - DQuat::from_rotation_x(0.2).slerp(other, 0.3)).length() < 1e-14);
            assert!((angle_between(DQuat::IDENTITY, own) - DQuat::IDENTITY.angle_between(own)).abs() < 1e-12);
        }
        assert_eq!(from_scaled_axis(DVec3::ZERO), DQuat::IDENTITY);
    }
}
