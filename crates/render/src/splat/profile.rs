//! Where the time goes, when asked.

use std::time::{Duration, Instant};

/// The parts of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Projection, colour, and the chunks' lists.
    Preprocess,
    /// Gathering a strip's splats and sorting them by depth.
    Sort,
    /// Finding the blocks that each splat reaches.
    Bin,
    /// Blending.
    Blend,
    /// Writing pixels.
    Write,
}

/// Time spent in each [`Phase`], summed over threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhaseTimes([Duration; 5]);

impl PhaseTimes {
    /// Time spent in one phase, summed over threads.
    pub fn of(&self, phase: Phase) -> Duration {
        self.0[phase as usize]
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (sum, part) in self.0.iter_mut().zip(other.0) {
            *sum += part;
        }
    }
}

/// A stopwatch that does nothing unless it was switched on.
#[derive(Debug, Default)]
pub(super) struct Clock {
    enabled: bool,
    since: Option<Instant>,
    pub(super) times: PhaseTimes,
}

impl Clock {
    pub(super) fn reset(&mut self, enabled: bool) {
        *self = Self { enabled, ..Self::default() };
    }

    #[inline(always)]
    pub(super) fn start(&mut self) {
        if self.enabled {
            self.since = Some(Instant::now());
        }
    }

    /// Adds the time since the last call to a phase.
    #[inline(always)]
    pub(super) fn lap(&mut self, phase: Phase) {
        if self.enabled {
            let now = Instant::now();
            if let Some(since) = self.since.replace(now) {
                self.times.0[phase as usize] += now - since;
            }
        }
    }
}
