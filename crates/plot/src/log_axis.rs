//! A logarithmic axis whose ticks are round numbers over any range, also within one decade.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// From and to, both above 0.
#[derive(Clone, Debug)]
pub(super) struct LogAxis(pub(super) Range<f64>);

/// Ticks of a decade, from many to few.
const DIGITS: [&[u32]; 4] = [&[1, 2, 3, 4, 5, 6, 7, 8, 9], &[1, 2, 3, 5], &[1, 3], &[1]];
/// Most ticks of an axis.
const MOST: usize = 10;

impl LogAxis {
    /// As many ticks as there is room for.
    fn ticks(&self) -> Vec<f64> {
        let Range { start, end } = self.0;
        let [first, last] = [start, end].map(|v| v.log10().floor() as i32);
        let within = |value: &f64| (start..=end).contains(value);
        let of = |digits: &[u32]| -> Vec<f64> {
            let decade = |k: i32| digits.iter().map(move |&d| f64::from(d) * 10.0_f64.powi(k));
            (first..=last).flat_map(decade).filter(within).collect()
        };
        if let Some(ticks) = DIGITS.iter().map(|digits| of(digits)).find(|ticks| ticks.len() <= MOST) {
            return ticks;
        }
        let stride = of(&[1]).len().div_ceil(MOST);
        (first..=last).step_by(stride).map(|k| 10.0_f64.powi(k)).filter(within).collect()
    }
}

impl Ranged for LogAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let share = (value / self.0.start).ln() / (self.0.end / self.0.start).ln();
        low + (share * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format(value: &f64) -> String {
        tick(*value)
    }
}

/// A tick as text: plain between 0.001 and 10,000, with a power of ten beyond.
pub(super) fn tick(value: f64) -> String {
    let exponent = (value.log10() + 1e-9).floor();
    if (-3.0..5.0).contains(&exponent) {
        let digits = (-exponent).max(0.0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{:.0}e{exponent}", value / 10.0_f64.powf(exponent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_has_some_round_ticks_and_not_too_many() {
        for (start, end) in
            [(13.0, 110.0), (50.0, 1300.0), (1e-13, 1e3), (2.1, 2.9), (0.004, 0.9), (3.0, 40.0)]
        {
            let ticks = LogAxis(start..end).ticks();
            assert!(ticks.len() <= MOST, "{start} to {end}: {ticks:?}");
            assert!(ticks.len() >= 2 || end / start < 2.0, "{start} to {end}: {ticks:?}");
            assert!(ticks.is_sorted() && ticks.iter().all(|t| (start..=end).contains(t)));
        }
    }

    #[test]
    fn ticks_are_short() {
        for (value, text) in [(100.0, "100"), (0.03, "0.03"), (2e-7, "2e-7"), (1e5, "1e5"), (0.001, "0.001")]
        {
            assert_eq!(tick(value), text);
        }
    }
}
