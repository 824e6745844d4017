//! Sixteen `f32` lanes on AVX-512, AVX2 or plain arrays, chosen at run time, with the same bits from each.
//!
//! Every operation is elementwise and correctly rounded (multiply-add is fused everywhere, also in the portable
//! version), so an image does not depend on the machine's vector width.

use pulp::Arch;

/// Operations on sixteen `f32` lanes. Comparisons with NaN are false.
pub(super) trait Lanes: Copy {
    /// Sixteen numbers.
    type F: Copy;
    /// Sixteen truth values.
    type M: Copy;

    fn splat(self, value: f32) -> Self::F;
    fn load(self, values: &[f32; 16]) -> Self::F;
    fn store(self, values: Self::F) -> [f32; 16];
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `a b + c`, rounded once, on four numbers.
    fn mul_add_four(self, a: f32, b: &[f32; 4], c: [f32; 4]) -> [f32; 4];
    /// `c - a b`, rounded once.
    fn neg_mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `a` where `a < b`, else `b`.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a` where `a > b`, else `b`.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    fn sqrt(self, a: Self::F) -> Self::F;
    fn floor(self, a: Self::F) -> Self::F;
    fn ceil(self, a: Self::F) -> Self::F;
    /// To the nearest integer, ties to even.
    fn round(self, a: Self::F) -> Self::F;
    /// `p / 2^n` for p in \[0.5, 2\] and integral n in 0..=120; any value for other n, but no trap.
    fn divide_by_power_of_two(self, p: Self::F, n: Self::F) -> Self::F;
    /// `(e, m)` with `a = m 2^e`, m in \[√½, √2): for positive normal numbers; anything for others.
    fn split_exponent(self, a: Self::F) -> (Self::F, Self::F);
    /// Towards zero, for values that an `i32` holds.
    fn to_integers(self, a: Self::F) -> [i32; 16];
    /// `0 <= a <= limit` for positive limits (−0 counts as negative).
    fn in_range(self, a: Self::F, limit: Self::F) -> Self::M;
    fn less(self, a: Self::F, b: Self::F) -> Self::M;
    /// `a >= b`.
    fn at_least(self, a: Self::F, b: Self::F) -> Self::M;
    fn both(self, a: Self::M, b: Self::M) -> Self::M;
    fn any(self, mask: Self::M) -> bool;
    /// `a` where the mask is set, else 0.
    fn keep(self, mask: Self::M, a: Self::F) -> Self::F;
    /// `a` where the mask is set, else `b`.
    fn select(self, mask: Self::M, a: Self::F, b: Self::F) -> Self::F;
    /// Lane j of row i becomes lane i of row j.
    fn transpose(self, rows: &[Self::F; 16]) -> [Self::F; 16];
}

/// Bits of the mantissa of an `f32`.
pub(super) const MANTISSA_BITS: u32 = 23;
pub(super) const MANTISSA: u32 = (1 << MANTISSA_BITS) - 1;
/// Bits of √½.
pub(super) const ROOT_HALF: u32 = 0x3f35_04f3;

/// A computation that runs on any [`Lanes`]. Implementations of `run` must be `#[inline(always)]`, or they lose the
/// vector instructions of the caller.
pub(super) trait Kernel {
    type Output;
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// Runs a kernel compiled for chosen instructions.
pub(super) fn run<K: Kernel>(arch: Arch, kernel: K) -> K::Output {
    match arch {
        #[cfg(target_arch = "x86_64")]
        Arch::V3(lanes) => lanes.vectorize(OnLanes { kernel, lanes }),
        #[cfg(target_arch = "x86_64")]
        Arch::V4(lanes) => lanes.vectorize(OnLanes { kernel, lanes }),
        _ => kernel.run(Arrays),
    }
}

#[cfg(target_arch = "x86_64")]
struct OnLanes<K, L> {
    kernel: K,
    lanes: L,
}

#[cfg(target_arch = "x86_64")]
impl<K: Kernel, L: Lanes> pulp::NullaryFnOnce for OnLanes<K, L> {
    type Output = K::Output;

    #[inline(always)]
    fn call(self) -> K::Output {
        self.kernel.run(self.lanes)
    }
}

/// Plain arrays, left to the compiler.
#[derive(Clone, Copy)]
pub(super) struct Arrays;

#[inline(always)]
fn map(a: [f32; 16], f: impl Fn(f32) -> f32) -> [f32; 16] {
    std::array::from_fn(|i| f(a[i]))
}

#[inline(always)]
fn zip<T>(a: [f32; 16], b: [f32; 16], f: impl Fn(f32, f32) -> T) -> [T; 16] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

impl Lanes for Arrays {
    type F = [f32; 16];
    type M = [bool; 16];

    #[inline(always)]
    fn splat(self, value: f32) -> [f32; 16] {
        [value; 16]
    }
    #[inline(always)]
    fn load(self, values: &[f32; 16]) -> [f32; 16] {
        *values
    }
    #[inline(always)]
    fn store(self, values: [f32; 16]) -> [f32; 16] {
        values
    }
    #[inline(always)]
    fn add(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, a: [f32; 16], b: [f32; 16], c: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn mul_add_four(self, a: f32, b: &[f32; 4], c: [f32; 4]) -> [f32; 4] {
        std::array::from_fn(|i| a.mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: [f32; 16], b: [f32; 16], c: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| (-a[i]).mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn min(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn sqrt(self, a: [f32; 16]) -> [f32; 16] {
        map(a, f32::sqrt)
    }
    #[inline(always)]
    fn floor(self, a: [f32; 16]) -> [f32; 16] {
        map(a, f32::floor)
    }
    #[inline(always)]
    fn ceil(self, a: [f32; 16]) -> [f32; 16] {
        map(a, f32::ceil)
    }
    #[inline(always)]
    fn round(self, a: [f32; 16]) -> [f32; 16] {
        map(a, f32::round_ties_even)
    }
    #[inline(always)]
    fn divide_by_power_of_two(self, p: [f32; 16], n: [f32; 16]) -> [f32; 16] {
        zip(p, n, |p, n| f32::from_bits(p.to_bits().wrapping_sub((n as i32 as u32) << 23)))
    }
    #[inline(always)]
    fn split_exponent(self, a: [f32; 16]) -> ([f32; 16], [f32; 16]) {
        let offset = a.map(|a| a.to_bits().wrapping_sub(ROOT_HALF));
        let exponent = offset.map(|o| ((o as i32) >> MANTISSA_BITS) as f32);
        (exponent, offset.map(|o| f32::from_bits((o & MANTISSA).wrapping_add(ROOT_HALF))))
    }
    #[inline(always)]
    fn to_integers(self, a: [f32; 16]) -> [i32; 16] {
        std::array::from_fn(|i| a[i] as i32)
    }
    #[inline(always)]
    fn in_range(self, a: [f32; 16], limit: [f32; 16]) -> [bool; 16] {
        zip(a, limit, |a, limit| a.to_bits() <= limit.to_bits())
    }
    #[inline(always)]
    fn less(self, a: [f32; 16], b: [f32; 16]) -> [bool; 16] {
        zip(a, b, |a, b| a < b)
    }
    #[inline(always)]
    fn at_least(self, a: [f32; 16], b: [f32; 16]) -> [bool; 16] {
        zip(a, b, |a, b| a >= b)
    }
    #[inline(always)]
    fn both(self, a: [bool; 16], b: [bool; 16]) -> [bool; 16] {
        std::array::from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn any(self, mask: [bool; 16]) -> bool {
        mask.iter().any(|&m| m)
    }
    #[inline(always)]
    fn keep(self, mask: [bool; 16], a: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| if mask[i] { a[i] } else { 0.0 })
    }
    #[inline(always)]
    fn select(self, mask: [bool; 16], a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| if mask[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn transpose(self, rows: &[[f32; 16]; 16]) -> [[f32; 16]; 16] {
        std::array::from_fn(|j| std::array::from_fn(|i| rows[i][j]))
    }
}
