//! Half floats: which numbers one of them holds exactly, and how far apart they lie.

/// The largest finite one.
const LARGEST: f64 = 65504.0;

/// The distance between half floats of this size: 11 significant bits, 2^-24 at least.
pub(crate) fn step(value: f64) -> f64 {
    let exponent = (value.abs().to_bits() >> 52) as i64 - 1023;
    let power = exponent.max(-14) - 10;
    f64::from_bits(((power + 1023) as u64) << 52)
}

/// True if a half float holds the number, written as f32 or exactly.
pub(crate) fn holds(value: f64) -> bool {
    let single = f64::from(value as f32);
    // Digits enough for f32 are not always enough for f64.
    let written = (single - value).abs() <= 1e-7 * value.abs();
    written && single.abs() <= LARGEST && (single / step(single)).fract() == 0.0
}

/// What is expected, moved towards what was found by no more than rounding to half floats does.
pub(crate) fn towards(expected: f64, found: f64) -> f64 {
    let reach = 0.5 * step(expected.abs().max(found.abs()));
    found.clamp(expected - reach, expected + reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_known() {
        for value in [0.0, 1.0, -1.5, 0.333_251_953_125, 65504.0, 5.960_464_477_539_063e-8, 0.1_f32 as f64] {
            assert_eq!(holds(value), value != 0.1_f32 as f64, "{value}");
        }
        assert!(!holds(65520.0) && !holds(1.000_5) && !holds(1e-9));
        assert_eq!(
            (step(1.0), step(1.999), step(2.0), step(0.0)),
            (0.000_976_562_5, 0.000_976_562_5, 0.001_953_125, step(1e-7))
        );
        assert_eq!(towards(1.0, 1.000_4), 1.000_4);
        assert!(towards(1.0, 1.1) < 1.000_5);
    }
}
