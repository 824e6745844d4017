//! Two ways of doing something, timed in turns.

use serde::Serialize;
use std::time::Instant;

/// Seconds that something took, over repetitions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// The least: what the machine can do undisturbed.
    pub least: f64,
    /// The median.
    pub median: f64,
    /// The most.
    pub most: f64,
    /// Repetitions.
    pub runs: usize,
}

impl Timing {
    fn of(mut seconds: Vec<f64>) -> Self {
        seconds.sort_by(f64::total_cmp);
        let at = |i: usize| seconds.get(i).copied().unwrap_or(f64::NAN);
        let runs = seconds.len();
        Self { least: at(0), median: at(runs / 2), most: at(runs.saturating_sub(1)), runs }
    }
}

/// Times both, one after the other `runs` times (at least once), after one turn each that is not counted. Times are
/// divided by `units`.
pub(super) fn in_turns<E>(
    runs: usize,
    units: usize,
    mut without: impl FnMut() -> Result<(), E>,
    mut with: impl FnMut() -> Result<(), E>,
) -> Result<[Timing; 2], E> {
    let mut seconds = [Vec::new(), Vec::new()];
    let timed = |list: &mut Vec<f64>, work: &mut dyn FnMut() -> Result<(), E>| {
        let start = Instant::now();
        work()?;
        list.push(start.elapsed().as_secs_f64() / units.max(1) as f64);
        Ok(())
    };
    for _ in 0..=runs.max(1) {
        timed(&mut seconds[0], &mut without)?;
        timed(&mut seconds[1], &mut with)?;
    }
    Ok(seconds.map(|mut all| {
        all.remove(0);
        Timing::of(all)
    }))
}
