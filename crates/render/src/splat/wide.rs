//! Arithmetic on sixteen lanes, written as for one number.

use super::lanes::Lanes;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Sixteen `f32`.
#[derive(Clone, Copy)]
pub(super) struct Wide<L: Lanes> {
    lanes: L,
    pub(super) values: L::F,
}

impl<L: Lanes> Wide<L> {
    #[inline(always)]
    pub(super) fn splat(lanes: L, value: f32) -> Self {
        Self { lanes, values: lanes.splat(value) }
    }

    #[inline(always)]
    pub(super) fn load(lanes: L, values: &[f32; 16]) -> Self {
        Self { lanes, values: lanes.load(values) }
    }

    #[inline(always)]
    pub(super) fn store(self) -> [f32; 16] {
        self.lanes.store(self.values)
    }

    /// Lane j of row i becomes lane i of row j.
    #[inline(always)]
    pub(super) fn transpose(rows: &[Self; 16]) -> [Self; 16] {
        let lanes = rows[0].lanes;
        let mut values = [rows[0].values; 16];
        for i in 1..16 {
            values[i] = rows[i].values;
        }
        let columns = lanes.transpose(&values);
        let mut out = *rows;
        for i in 0..16 {
            out[i].values = columns[i];
        }
        out
    }

    /// [`Wide::transpose`] of rows in memory.
    #[inline(always)]
    pub(super) fn load_transposed(lanes: L, rows: &[[f32; 16]; 16]) -> [Self; 16] {
        let mut loaded = [Self::load(lanes, &rows[0]); 16];
        for i in 1..16 {
            loaded[i] = Self::load(lanes, &rows[i]);
        }
        Self::transpose(&loaded)
    }

    #[inline(always)]
    fn with(self, values: L::F) -> Self {
        Self { values, ..self }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub(super) fn constant(self, value: f32) -> Self {
        self.with(self.lanes.splat(value))
    }

    /// `self b + c`, rounded once.
    #[inline(always)]
    pub(super) fn mul_add(self, b: Self, c: Self) -> Self {
        self.with(self.lanes.mul_add(self.values, b.values, c.values))
    }

    /// `c - self b`, rounded once.
    #[inline(always)]
    pub(super) fn neg_mul_add(self, b: Self, c: Self) -> Self {
        self.with(self.lanes.neg_mul_add(self.values, b.values, c.values))
    }

    /// `self` where it is less, else `b`.
    #[inline(always)]
    pub(super) fn min(self, b: Self) -> Self {
        self.with(self.lanes.min(self.values, b.values))
    }

    /// `self` where it is greater, else `b`.
    #[inline(always)]
    pub(super) fn max(self, b: Self) -> Self {
        self.with(self.lanes.max(self.values, b.values))
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        self.max(-self)
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        self.with(self.lanes.sqrt(self.values))
    }

    #[inline(always)]
    pub(super) fn floor(self) -> Self {
        self.with(self.lanes.floor(self.values))
    }

    #[inline(always)]
    pub(super) fn ceil(self) -> Self {
        self.with(self.lanes.ceil(self.values))
    }

    /// `2^-self` to 1.6e-7, for 0 to 120.
    #[inline(always)]
    pub(super) fn exp2_negated(self) -> Self {
        // Minimax in relative error for 2^f, |f| <= 1/2, with 2^0 = 1 exactly.
        const POLYNOMIAL: [f32; 5] =
            [0.001_326_472_7, 0.009_671_512_7, 0.055_507_337_4, 0.240_222_420_8, 0.693_146_977_6];
        let n = self.with(self.lanes.round(self.values));
        let f = n - self;
        let mut p = self.constant(POLYNOMIAL[0]);
        for coefficient in &POLYNOMIAL[1..] {
            p = p.mul_add(f, self.constant(*coefficient));
        }
        p = p.mul_add(f, self.constant(1.0));
        self.with(self.lanes.divide_by_power_of_two(p.values, n.values))
    }

    /// Base-2 logarithm of positive normal numbers, to about 1e-7; anything for others.
    #[inline(always)]
    pub(super) fn log2(self) -> Self {
        let (exponent, mantissa) = self.lanes.split_exponent(self.values);
        let (exponent, mantissa) = (self.with(exponent), self.with(mantissa));
        // log2 m = 2/ln 2 artanh((m - 1) / (m + 1)).
        let one = self.constant(1.0);
        let s = (mantissa - one) / (mantissa + one);
        let s2 = s * s;
        let mut series = self.constant(1.0 / 9.0);
        for coefficient in [1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0] {
            series = series.mul_add(s2, self.constant(coefficient));
        }
        let artanh = s.mul_add(s2 * series, s);
        artanh.mul_add(self.constant(2.0 * std::f32::consts::LOG2_E), exponent)
    }

    /// Where `self < b`.
    #[inline(always)]
    pub(super) fn less(self, b: Self) -> Mask<L> {
        Mask { lanes: self.lanes, values: self.lanes.less(self.values, b.values) }
    }

    /// Where `self >= b`.
    #[inline(always)]
    pub(super) fn at_least(self, b: Self) -> Mask<L> {
        Mask { lanes: self.lanes, values: self.lanes.at_least(self.values, b.values) }
    }

    /// Where `0 <= self <= limit`, for positive limits (−0 counts as negative).
    #[inline(always)]
    pub(super) fn in_range(self, limit: Self) -> Mask<L> {
        Mask { lanes: self.lanes, values: self.lanes.in_range(self.values, limit.values) }
    }

    #[inline(always)]
    pub(super) fn to_integers(self) -> [i32; 16] {
        self.lanes.to_integers(self.values)
    }
}

/// `values.map(f)`. (`map` is not always inlined, and then loses the vector instructions of its caller. So does `f` if it
/// is more than a few operations: then it should be a function that is always inlined.)
#[inline(always)]
pub(super) fn each<const N: usize, T: Copy, U: Copy>(values: [T; N], mut f: impl FnMut(T) -> U) -> [U; N] {
    let mut out = [f(values[0]); N];
    for i in 1..N {
        out[i] = f(values[i]);
    }
    out
}

/// Sixteen truth values.
#[derive(Clone, Copy)]
pub(super) struct Mask<L: Lanes> {
    lanes: L,
    values: L::M,
}

impl<L: Lanes> Mask<L> {
    #[inline(always)]
    pub(super) fn any(self) -> bool {
        self.lanes.any(self.values)
    }

    #[inline(always)]
    pub(super) fn and(self, b: Self) -> Self {
        Self { values: self.lanes.both(self.values, b.values), ..self }
    }

    /// `a` where set, else 0.
    #[inline(always)]
    pub(super) fn keep(self, a: Wide<L>) -> Wide<L> {
        a.with(self.lanes.keep(self.values, a.values))
    }

    /// `a` where set, else `b`.
    #[inline(always)]
    pub(super) fn select(self, a: Wide<L>, b: Wide<L>) -> Wide<L> {
        a.with(self.lanes.select(self.values, a.values, b.values))
    }
}

impl<L: Lanes> Add for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.with(self.lanes.add(self.values, b.values))
    }
}

impl<L: Lanes> Sub for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.with(self.lanes.sub(self.values, b.values))
    }
}

impl<L: Lanes> Mul for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.with(self.lanes.mul(self.values, b.values))
    }
}

impl<L: Lanes> Div for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.with(self.lanes.div(self.values, b.values))
    }
}

impl<L: Lanes> Neg for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.constant(0.0) - self
    }
}
