//! Progress: a bar on a terminal, a line per avatar and per sequence elsewhere.

use super::output::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use skinsplat::run::Event;
use skinsplat_fit::train::Step;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};

/// What a single fit is called.
const FITTING: &str = "fitting";

/// Shows a run's events on standard error: as a bar if that is a terminal, else as lines.
pub(super) struct Watch {
    bar: ProgressBar,
    quiet: bool,
    /// Nobody sees a bar: lines take its place.
    lines: bool,
    /// Avatars begun.
    avatars: AtomicU64,
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
        let lines = !quiet && !std::io::stderr().is_terminal();
        Self { bar, quiet, lines, avatars: AtomicU64::new(0) }
    }

    /// Shows what happened.
    pub(super) fn see(&self, event: Event) {
        match event {
            Event::Avatars(count) => self.start("avatars", count),
            Event::Frames(count) => self.start("frames", count),
            Event::Avatar(name) => {
                let number = self.avatars.fetch_add(1, Ordering::Relaxed) + 1;
                self.line(&format!("avatar {number}/{}: {name}", self.bar.length().unwrap_or_default()));
            }
            Event::Fitting(step) => {
                let Step { iteration, iterations, psnr, splats, .. } = step;
                self.detail(format!(" | iteration {iteration}/{iterations}, {psnr:.2} dB, {splats} splats"));
            }
            Event::Took(..) => {}
            Event::AvatarReady | Event::FrameDone => {
                self.detail(String::new());
                self.bar.inc(1);
            }
            Event::SequenceDone(name, frames) => {
                let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
                self.line(&format!("sequence {name}: {frames} frames; {done} of {all} in all"));
            }
            Event::Warning(text) => self.above(&format!("warning: {text}"), self.quiet),
        }
    }

    /// A line, where there is no bar.
    fn line(&self, text: &str) {
        if self.lines {
            say(text);
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
    pub(super) fn above(&self, text: &str, quiet: bool) {
        if !quiet {
            self.bar.suspend(|| say(text));
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
