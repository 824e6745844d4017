//! Repeated timing.

use std::hint::black_box;
use std::time::Instant;

/// The time of one piece of work over several repeats, seconds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// First quartile.
    pub low: f64,
    /// Third quartile.
    pub high: f64,
    /// Repeats behind it.
    pub repeats: usize,
}

impl Spread {
    /// The quartiles of some times, at least one; linear between neighbours.
    pub fn of(times: &[f64]) -> Self {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |p: f64| {
            let place = (sorted.len() - 1) as f64 * p;
            let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            below + (above - below) * place.fract()
        };
        Self { median: at(0.5), low: at(0.25), high: at(0.75), repeats: sorted.len() }
    }

    /// The same per part of the work.
    pub fn per(self, parts: usize) -> Self {
        let parts = parts.max(1) as f64;
        Self {
            median: self.median / parts,
            low: self.low / parts,
            high: self.high / parts,
            repeats: self.repeats,
        }
    }
}

/// Times a piece of work `repeats` times (at least once), after one run that is not counted. What it returns is kept from
/// being optimised away.
pub(super) fn time<T>(repeats: usize, mut work: impl FnMut() -> T) -> Spread {
    black_box(work());
    let times: Vec<f64> = (0..repeats.max(1))
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            // Zero has no logarithm, and no clock is finer than a nanosecond.
            start.elapsed().as_secs_f64().max(1e-9)
        })
        .collect();
    Spread::of(&times)
}

/// Times two ways of doing something, one after the other `repeats` times (at least once), after one turn each that is not
/// counted.
pub(super) fn in_turns<E>(
    repeats: usize,
    mut one: impl FnMut() -> Result<(), E>,
    mut other: impl FnMut() -> Result<(), E>,
) -> Result<[Spread; 2], E> {
    let mut seconds = [Vec::new(), Vec::new()];
    let timed = |times: &mut Vec<f64>, work: &mut dyn FnMut() -> Result<(), E>| {
        let start = Instant::now();
        work()?;
        times.push(start.elapsed().as_secs_f64().max(1e-9));
        Ok(())
    };
    for _ in 0..=repeats.max(1) {
        timed(&mut seconds[0], &mut one)?;
        timed(&mut seconds[1], &mut other)?;
    }
    Ok(seconds.map(|times| Spread::of(&times[1..])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_of_known_times() {
        let spread = Spread::of(&[5.0, 1.0, 4.0, 2.0, 3.0]);
        assert_eq!((spread.low, spread.median, spread.high, spread.repeats), (2.0, 3.0, 4.0, 5));
        assert_eq!(spread.per(2).high, 2.0);
        assert_eq!(Spread::of(&[7.0]).median, 7.0);
        assert_eq!(Spread::of(&[1.0, 3.0]).low, 1.5);
    }

    #[test]
    fn work_is_done_once_more_than_it_is_counted() {
        let mut runs = 0;
        let spread = time(4, || runs += 1);
        assert_eq!((runs, spread.repeats), (5, 4));
        assert!(spread.low > 0.0);
    }
}
