//! Progress on a terminal, and nowhere else.

use crate::run::Event;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use skinsplat_fit::train::Step;

/// What a single fit is called.
const FITTING: &str = "fitting";

/// Draws a run's events as a bar on standard error, if that is a terminal.
pub(super) struct Watch {
    bar: ProgressBar,
}

const TEMPLATE: &str = "{msg:>8} {bar:40} {pos}/{len}, {elapsed} gone, {eta} left{prefix}";

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
            Event::Fitting(step) => {
                let Step { iteration, iterations, psnr, splats, .. } = step;
                self.detail(format!(" | iteration {iteration}/{iterations}, {psnr:.2} dB, {splats} splats"));
            }
            Event::AvatarReady | Event::FrameDone => {
                self.detail(String::new());
                self.bar.inc(1);
            }
        }
    }

    /// Draws an iteration of a single fit.
    pub(super) fn fitting(&self, step: Step) {
        if self.bar.length() != Some(u64::from(step.iterations)) || self.bar.message() != FITTING {
            self.start(FITTING, step.iterations as usize);
        }
        self.bar.set_position(u64::from(step.iteration));
        self.detail(format!(" | loss {:.4}, {:.2} dB, {} splats", step.loss, step.psnr, step.splats));
    }

    /// So many steps are done, and what comes next.
    pub(super) fn at(&self, done: usize, next: &str) {
        self.bar.set_position(done as u64);
        self.detail(format!(" | {next}"));
    }

    /// Says something above the bar.
    #[allow(clippy::print_stderr, reason = "a warning for the person at the terminal")]
    pub(super) fn above(&self, text: &str, quiet: bool) {
        if !quiet {
            self.bar.suspend(|| eprintln!("{text}"));
        }
    }

    /// What is said behind the bar.
    fn detail(&self, text: String) {
        self.bar.set_prefix(text);
    }

    /// A bar of so many steps begins.
    pub(super) fn start(&self, what: &'static str, count: usize) {
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
