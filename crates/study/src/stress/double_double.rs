//! Numbers of 106 bits as unevaluated sums of two `f64` (Dekker 1971): what reference answers are computed in.

use std::ops::{Add, Mul, Sub};

/// `high + low`, |low| at most half an ulp of `high`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DoubleDouble {
    high: f64,
    low: f64,
}

/// The sum and what rounding took from it (Knuth).
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let of_b = high - a;
    DoubleDouble { high, low: (a - (high - of_b)) + (b - of_b) }
}

/// The same, for |a| at least |b|.
fn fast_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

/// Two halves of 26 bits.
fn split(a: f64) -> (f64, f64) {
    let shifted = 134_217_729.0 * a;
    let high = shifted - (shifted - a);
    (high, a - high)
}

/// The product and what rounding took from it, without a fused instruction.
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    DoubleDouble { high, low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2 }
}

impl DoubleDouble {
    pub(super) const ONE: Self = Self { high: 1.0, low: 0.0 };

    pub(super) fn new(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }

    /// The nearest `f64`.
    pub(super) fn to_f64(self) -> f64 {
        self.high
    }

    /// 1 / self, by two Newton steps.
    pub(super) fn reciprocal(self) -> Self {
        let mut inverse = Self::new(1.0 / self.high);
        for _ in 0..2 {
            inverse = inverse + inverse * (Self::ONE - self * inverse);
        }
        inverse
    }
}

impl Add for DoubleDouble {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, low) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let sum = fast_two_sum(high.high, high.low + low.high);
        fast_two_sum(sum.high, sum.low + low.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { high: -other.high, low: -other.low }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = two_product(self.high, other.high);
        fast_two_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_digits_survive() {
        let third = DoubleDouble::new(3.0).reciprocal();
        let rest = third * DoubleDouble::new(3.0) - DoubleDouble::ONE;
        assert!(rest.to_f64().abs() < 1e-31, "{rest:?}");
        let tiny = DoubleDouble::ONE + DoubleDouble::new(1e-25) - DoubleDouble::ONE;
        assert!((tiny.to_f64() - 1e-25).abs() < 1e-38, "{tiny:?}");
    }
}
