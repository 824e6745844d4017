//! Round numbers along an axis.

/// An axis: what is shown of it, and its ticks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) log: bool,
    /// Positions and labels.
    pub(super) ticks: Vec<(f64, String)>,
}

/// Most ticks of an axis.
const MOST: f64 = 6.0;

/// Larger numbers have no place on an axis: what is computed around them must stay finite.
const LARGEST: f64 = 1e100;

impl Axis {
    /// An axis that shows all of these values; those that are not finite or beyond [`LARGEST`], or not above 0 on a logarithmic
    /// one, are left out.
    pub(super) fn of(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let shown: Vec<f64> = values.filter(|v| v.abs() <= LARGEST && (!log || *v > 0.0)).collect();
        // Nothing lies between two frames.
        let whole = shown.iter().all(|v| v.fract() == 0.0);
        let [low, high] = shown
            .into_iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        let [low, high] = if low <= high { [low, high] } else { [1.0, 10.0] };
        if log { Self::logarithmic(low, high) } else { Self::linear(low, high, whole) }
    }

    fn linear(low: f64, high: f64, whole: bool) -> Self {
        let span = if high > low { high - low } else { high.abs().max(1.0) * 0.1 };
        let (low, high) = (low - 0.04 * span, high + 0.04 * span);
        let step = round_step((high - low) / MOST).max(if whole { 1.0 } else { 0.0 });
        let decimals = (0..12).find(|d| (0..*d).fold(step, |s, _| s * 10.0) > 0.999).unwrap_or(12);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        let ticks = (first..=last).map(|k| (k as f64 * step, format!("{:.decimals$}", k as f64 * step)));
        Self { low, high, log: false, ticks: ticks.collect() }
    }

    fn logarithmic(low: f64, high: f64) -> Self {
        let (mut decade, mut ticks) = (1.0_f64, Vec::new());
        while decade > low {
            decade /= 10.0;
        }
        while decade * 10.0 <= low {
            decade *= 10.0;
        }
        let bottom = decade;
        while decade < high * 10.0 && ticks.len() < 40 {
            ticks.push((decade, show(decade)));
            decade *= 10.0;
        }
        let top = ticks.last().map_or(high, |(at, _)| *at).max(high);
        let every = ticks.len().div_ceil(8);
        let ticks = ticks.into_iter().step_by(every).collect();
        Self { low: bottom, high: if top > bottom { top } else { bottom * 10.0 }, log: true, ticks }
    }

    /// Where a value lies, 0 to 1; none outside.
    pub(super) fn at(&self, value: f64) -> Option<f64> {
        let place = match self.log {
            true if value > 0.0 => (log2(value) - log2(self.low)) / (log2(self.high) - log2(self.low)),
            true => return None,
            false => (value - self.low) / (self.high - self.low),
        };
        (place.is_finite() && (-1e-9..=1.0 + 1e-9).contains(&place)).then_some(place)
    }
}

/// A logarithm that is good enough to place a dot, the same on every machine: the exponent, and a rational function of the rest.
fn log2(value: f64) -> f64 {
    let (mut exponent, mut rest) = (0.0, value);
    while rest >= 2.0 {
        rest /= 2.0;
        exponent += 1.0;
    }
    while rest < 1.0 && rest > 0.0 {
        rest *= 2.0;
        exponent -= 1.0;
    }
    let t = (rest - 1.0) / (rest + 1.0);
    let t2 = t * t;
    let series = t * (1.0 + t2 * (1.0 / 3.0 + t2 * (0.2 + t2 * (1.0 / 7.0 + t2 / 9.0))));
    exponent + 2.0 * series / std::f64::consts::LN_2
}

/// A power of ten in few letters.
fn show(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.0e}")
    }
}

/// The next of 1, 2, 5 times a power of ten.
fn round_step(at_least: f64) -> f64 {
    let mut power = 1.0;
    while power * 10.0 <= at_least {
        power *= 10.0;
    }
    while power > at_least && power > 1e-12 {
        power /= 10.0;
    }
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|step| *step >= at_least)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_numbers_have_no_place() {
        for log in [false, true] {
            let axis = Axis::of([1.0, 1.7e308, -1.7e308, f64::NAN, f64::INFINITY, 20.0].into_iter(), log);
            assert!(axis.high <= 100.0 && axis.low.is_finite() && !axis.ticks.is_empty(), "{axis:?}");
            assert_eq!(axis.at(1.7e308), None);
        }
    }

    #[test]
    fn ticks_are_round_and_few() {
        let labels = |low, high| {
            let axis = Axis::of([low, high].into_iter(), false);
            axis.ticks.into_iter().map(|(_, label)| label).collect::<Vec<_>>()
        };
        assert_eq!(labels(0.0, 5.0), ["0", "1", "2", "3", "4", "5"]);
        assert_eq!(labels(0.0, 2.0), ["0", "1", "2"], "frames are whole");
        assert_eq!(labels(30.1, 30.4), ["30.1", "30.2", "30.3", "30.4"]);
        assert!(!labels(7.0, 7.0).is_empty() && !labels(0.0, 0.0).is_empty());
        assert!(Axis::of(std::iter::empty(), false).low < 10.0);
    }

    #[test]
    fn a_logarithmic_axis_has_decades() {
        let axis = Axis::of([0.02, 30.0, 0.0, -1.0, f64::NAN].into_iter(), true);
        let labels: Vec<&str> = axis.ticks.iter().map(|(_, label)| label.as_str()).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10", "100"]);
        assert!((axis.at(1.0).unwrap() - 0.5).abs() < 1e-4);
        assert_eq!((axis.at(0.0), axis.at(-1.0)), (None, None));
    }
}
