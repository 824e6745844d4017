//! [`Lanes`] on AVX-512 (one register) and AVX2 (two).

use super::lanes::{Lanes, MANTISSA, MANTISSA_BITS, ROOT_HALF};
use pulp::x86::{V3, V4};
use pulp::{cast, f32x8, f32x16, m32x8};

impl Lanes for V4 {
    type F = f32x16;
    type M = pulp::b16;

    #[inline(always)]
    fn splat(self, value: f32) -> f32x16 {
        self.splat_f32x16(value)
    }
    #[inline(always)]
    fn load(self, values: &[f32; 16]) -> f32x16 {
        cast(*values)
    }
    #[inline(always)]
    fn store(self, values: f32x16) -> [f32; 16] {
        cast(values)
    }
    #[inline(always)]
    fn add(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_add_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn sub(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_sub_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn mul(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_mul_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn div(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_div_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn mul_add(self, a: f32x16, b: f32x16, c: f32x16) -> f32x16 {
        self.mul_add_f32x16(a, b, c)
    }
    #[inline(always)]
    fn mul_add_four(self, a: f32, b: &[f32; 4], c: [f32; 4]) -> [f32; 4] {
        (*self).mul_add_four(a, b, c)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: f32x16, b: f32x16, c: f32x16) -> f32x16 {
        self.negate_mul_add_f32x16(a, b, c)
    }
    #[inline(always)]
    fn min(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_min_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn max(self, a: f32x16, b: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_max_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn sqrt(self, a: f32x16) -> f32x16 {
        self.sqrt_f32x16(a)
    }
    #[inline(always)]
    fn floor(self, a: f32x16) -> f32x16 {
        self.floor_f32x16(a)
    }
    #[inline(always)]
    fn ceil(self, a: f32x16) -> f32x16 {
        self.ceil_f32x16(a)
    }
    #[inline(always)]
    fn round(self, a: f32x16) -> f32x16 {
        // Not `round_f32x16`: pulp 0.22.3 rounds pairs of lanes as f64 there.
        cast(self.avx512f._mm512_roundscale_ps::<0>(cast(a)))
    }
    #[inline(always)]
    fn divide_by_power_of_two(self, p: f32x16, n: f32x16) -> f32x16 {
        let negated = self.sub(self.splat(0.0), n);
        cast(self.avx512f._mm512_scalef_ps(cast(p), cast(negated)))
    }
    #[inline(always)]
    fn split_exponent(self, a: f32x16) -> (f32x16, f32x16) {
        let ops = self.avx512f;
        let root_half = cast(self.splat_u32x16(ROOT_HALF));
        let offset = ops._mm512_sub_epi32(cast(a), root_half);
        let exponent = ops._mm512_cvtepi32_ps(ops._mm512_srai_epi32::<MANTISSA_BITS>(offset));
        let mantissa = ops._mm512_and_si512(offset, cast(self.splat_u32x16(MANTISSA)));
        (cast(exponent), cast(ops._mm512_add_epi32(mantissa, root_half)))
    }
    #[inline(always)]
    fn to_integers(self, a: f32x16) -> [i32; 16] {
        cast(self.convert_f32x16_to_i32x16(a))
    }
    #[inline(always)]
    fn in_range(self, a: f32x16, limit: f32x16) -> pulp::b16 {
        self.cmp_le_u32x16(cast(a), cast(limit))
    }
    #[inline(always)]
    fn less(self, a: f32x16, b: f32x16) -> pulp::b16 {
        self.cmp_lt_f32x16(a, b)
    }
    #[inline(always)]
    fn at_least(self, a: f32x16, b: f32x16) -> pulp::b16 {
        self.cmp_ge_f32x16(a, b)
    }
    #[inline(always)]
    fn both(self, a: pulp::b16, b: pulp::b16) -> pulp::b16 {
        pulp::b16(a.0 & b.0)
    }
    #[inline(always)]
    fn any(self, mask: pulp::b16) -> bool {
        mask.0 != 0
    }
    #[inline(always)]
    fn keep(self, mask: pulp::b16, a: f32x16) -> f32x16 {
        cast(self.avx512f._mm512_maskz_mov_ps(mask.0, cast(a)))
    }
    #[inline(always)]
    fn select(self, mask: pulp::b16, a: f32x16, b: f32x16) -> f32x16 {
        self.select_f32x16(mask, a, b)
    }
    #[inline(always)]
    fn transpose(self, rows: &[f32x16; 16]) -> [f32x16; 16] {
        let ops = self.avx512f;
        let mut out = *rows;
        // In each quarter of a register: the 4x4 transpose of four rows.
        for four in out.chunks_exact_mut(4) {
            let [a, b, c, d] = [cast(four[0]), cast(four[1]), cast(four[2]), cast(four[3])];
            let (ab_low, ab_high) = (ops._mm512_unpacklo_ps(a, b), ops._mm512_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (ops._mm512_unpacklo_ps(c, d), ops._mm512_unpackhi_ps(c, d));
            four[0] = cast(ops._mm512_unpacklo_pd(cast(ab_low), cast(cd_low)));
            four[1] = cast(ops._mm512_unpackhi_pd(cast(ab_low), cast(cd_low)));
            four[2] = cast(ops._mm512_unpacklo_pd(cast(ab_high), cast(cd_high)));
            four[3] = cast(ops._mm512_unpackhi_pd(cast(ab_high), cast(cd_high)));
        }
        // The 4x4 transpose of quarters.
        const EVEN: i32 = 0b10_00_10_00;
        const ODD: i32 = 0b11_01_11_01;
        for i in 0..4 {
            let [a, b, c, d] = [cast(out[i]), cast(out[4 + i]), cast(out[8 + i]), cast(out[12 + i])];
            let (ab_even, ab_odd) =
                (ops._mm512_shuffle_f32x4::<EVEN>(a, b), ops._mm512_shuffle_f32x4::<ODD>(a, b));
            let (cd_even, cd_odd) =
                (ops._mm512_shuffle_f32x4::<EVEN>(c, d), ops._mm512_shuffle_f32x4::<ODD>(c, d));
            out[i] = cast(ops._mm512_shuffle_f32x4::<EVEN>(ab_even, cd_even));
            out[4 + i] = cast(ops._mm512_shuffle_f32x4::<EVEN>(ab_odd, cd_odd));
            out[8 + i] = cast(ops._mm512_shuffle_f32x4::<ODD>(ab_even, cd_even));
            out[12 + i] = cast(ops._mm512_shuffle_f32x4::<ODD>(ab_odd, cd_odd));
        }
        out
    }
}

const SHIFT: i32 = MANTISSA_BITS as i32;

/// Sixteen lanes in two AVX2 registers.
type Pair<T> = [T; 2];

#[inline(always)]
fn map<T: Copy, U>(a: Pair<T>, f: impl Fn(T) -> U) -> Pair<U> {
    [f(a[0]), f(a[1])]
}

#[inline(always)]
fn zip<T: Copy, S: Copy, U>(a: Pair<T>, b: Pair<S>, f: impl Fn(T, S) -> U) -> Pair<U> {
    [f(a[0], b[0]), f(a[1], b[1])]
}

impl Lanes for V3 {
    type F = Pair<f32x8>;
    type M = Pair<m32x8>;

    #[inline(always)]
    fn splat(self, value: f32) -> Self::F {
        [self.splat_f32x8(value); 2]
    }
    #[inline(always)]
    fn load(self, values: &[f32; 16]) -> Self::F {
        cast(*values)
    }
    #[inline(always)]
    fn store(self, values: Self::F) -> [f32; 16] {
        cast(values)
    }
    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.add_f32x8(a, b))
    }
    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.sub_f32x8(a, b))
    }
    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.mul_f32x8(a, b))
    }
    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.div_f32x8(a, b))
    }
    #[inline(always)]
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        [self.mul_add_f32x8(a[0], b[0], c[0]), self.mul_add_f32x8(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn mul_add_four(self, a: f32, b: &[f32; 4], c: [f32; 4]) -> [f32; 4] {
        cast(self.mul_add_f32x4(self.splat_f32x4(a), cast(*b), cast(c)))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        [self.negate_mul_add_f32x8(a[0], b[0], c[0]), self.negate_mul_add_f32x8(a[1], b[1], c[1])]
    }
    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.min_f32x8(a, b))
    }
    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        zip(a, b, |a, b| self.max_f32x8(a, b))
    }
    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        map(a, |a| self.sqrt_f32x8(a))
    }
    #[inline(always)]
    fn floor(self, a: Self::F) -> Self::F {
        map(a, |a| self.floor_f32x8(a))
    }
    #[inline(always)]
    fn ceil(self, a: Self::F) -> Self::F {
        map(a, |a| self.ceil_f32x8(a))
    }
    #[inline(always)]
    fn round(self, a: Self::F) -> Self::F {
        map(a, |a| self.round_f32x8(a))
    }
    #[inline(always)]
    fn divide_by_power_of_two(self, p: Self::F, n: Self::F) -> Self::F {
        zip(p, n, |p, n| {
            let exponent = self.shl_const_u32x8::<SHIFT>(cast(self.avx._mm256_cvtps_epi32(cast(n))));
            cast(self.avx2._mm256_sub_epi32(cast(p), cast(exponent)))
        })
    }
    #[inline(always)]
    fn split_exponent(self, a: Self::F) -> (Self::F, Self::F) {
        let (avx, avx2) = (self.avx, self.avx2);
        let root_half = cast(self.splat_u32x8(ROOT_HALF));
        let offset = map(a, |a| avx2._mm256_sub_epi32(cast(a), root_half));
        let exponent = map(offset, |o| cast(avx._mm256_cvtepi32_ps(avx2._mm256_srai_epi32::<SHIFT>(o))));
        let mantissa = map(offset, |o| {
            let mantissa = avx2._mm256_and_si256(o, cast(self.splat_u32x8(MANTISSA)));
            cast(avx2._mm256_add_epi32(mantissa, root_half))
        });
        (exponent, mantissa)
    }
    #[inline(always)]
    fn to_integers(self, a: Self::F) -> [i32; 16] {
        cast(map(a, |a| self.avx._mm256_cvttps_epi32(cast(a))))
    }
    #[inline(always)]
    fn in_range(self, a: Self::F, limit: Self::F) -> Self::M {
        zip(a, limit, |a, limit| {
            let least = self.avx2._mm256_min_epu32(cast(a), cast(limit));
            cast(self.avx2._mm256_cmpeq_epi32(least, cast(a)))
        })
    }
    #[inline(always)]
    fn less(self, a: Self::F, b: Self::F) -> Self::M {
        zip(a, b, |a, b| self.cmp_lt_f32x8(a, b))
    }
    #[inline(always)]
    fn at_least(self, a: Self::F, b: Self::F) -> Self::M {
        zip(a, b, |a, b| self.cmp_ge_f32x8(a, b))
    }
    #[inline(always)]
    fn both(self, a: Self::M, b: Self::M) -> Self::M {
        zip(a, b, |a, b| cast(self.avx2._mm256_and_si256(cast(a), cast(b))))
    }
    #[inline(always)]
    fn any(self, mask: Self::M) -> bool {
        let either: f32x8 = self.or_f32x8(cast(mask[0]), cast(mask[1]));
        self.avx._mm256_movemask_ps(cast(either)) != 0
    }
    #[inline(always)]
    fn keep(self, mask: Self::M, a: Self::F) -> Self::F {
        zip(mask, a, |mask, a| self.and_f32x8(cast(mask), a))
    }
    #[inline(always)]
    fn select(self, mask: Self::M, a: Self::F, b: Self::F) -> Self::F {
        [self.select_f32x8(mask[0], a[0], b[0]), self.select_f32x8(mask[1], a[1], b[1])]
    }
    #[inline(always)]
    fn transpose(self, rows: &[Self::F; 16]) -> [Self::F; 16] {
        let mut out = *rows;
        for top in [0, 8] {
            for half in [0, 1] {
                let mut square = [rows[0][0]; 8];
                for i in 0..8 {
                    square[i] = rows[top + i][half];
                }
                let square = transpose_eight(self, square);
                for i in 0..8 {
                    out[8 * half + i][top / 8] = square[i];
                }
            }
        }
        out
    }
}

/// Lane j of row i becomes lane i of row j.
#[inline(always)]
fn transpose_eight(simd: V3, mut rows: [f32x8; 8]) -> [f32x8; 8] {
    let ops = simd.avx;
    // In each half of a register: the 4x4 transpose of four rows.
    for four in rows.chunks_exact_mut(4) {
        let [a, b, c, d] = [cast(four[0]), cast(four[1]), cast(four[2]), cast(four[3])];
        let (ab_low, ab_high) = (ops._mm256_unpacklo_ps(a, b), ops._mm256_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (ops._mm256_unpacklo_ps(c, d), ops._mm256_unpackhi_ps(c, d));
        four[0] = cast(ops._mm256_unpacklo_pd(cast(ab_low), cast(cd_low)));
        four[1] = cast(ops._mm256_unpackhi_pd(cast(ab_low), cast(cd_low)));
        four[2] = cast(ops._mm256_unpacklo_pd(cast(ab_high), cast(cd_high)));
        four[3] = cast(ops._mm256_unpackhi_pd(cast(ab_high), cast(cd_high)));
    }
    for i in 0..4 {
        let (a, b) = (cast(rows[i]), cast(rows[4 + i]));
        rows[i] = cast(ops._mm256_permute2f128_ps::<0x20>(a, b));
        rows[4 + i] = cast(ops._mm256_permute2f128_ps::<0x31>(a, b));
    }
    rows
}
