//! Progress on a terminal, and nowhere else.

use crate::run::Event;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Draws a run's events as a bar on standard error, if that is a terminal.
pub(super) struct Watch {
    bar: ProgressBar,
}

const TEMPLATE: &str = "{msg:>8} {bar:40} {pos}/{len}, {elapsed} gone, {eta} left";

impl Watch {
    /// A bar without a length; hidden if `quiet`.
    pub(super) fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new(0);
        if quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Draws what happened.
    pub(super) fn see(&self, event: Event) {
        match event {
            Event::Avatars(count) => self.start("avatars", count),
            Event::Frames(count) => self.start("frames", count),
            Event::AvatarReady | Event::FrameDone => self.bar.inc(1),
        }
    }

    fn start(&self, what: &'static str, count: usize) {
        self.bar.set_message(what);
        self.bar.set_length(count as u64);
        self.bar.set_position(0);
        self.bar.reset_eta();
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
