//! Progress: a bar on a terminal, a line per avatar and per sequence elsewhere.

use super::output::say;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use skinsplat::run::Event;
use skinsplat_fit::train::Step;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

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
    /// The avatar that is being made.
    avatar: Mutex<String>,
    /// The part of the work, before what is said of it.
    part: String,
}

const TEMPLATE: &str = "{msg:>8} {bar:32} {pos}/{len}, {elapsed} gone{left}{prefix}";

impl Watch {
    /// A bar without a length; hidden if `quiet`.
    pub(super) fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new(0);
        if quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style.with_key("left", left));
        }
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        let lines = !quiet && !std::io::stderr().is_terminal();
        Self { bar, quiet, lines, avatars: AtomicU64::new(0), avatar: Mutex::default(), part: String::new() }
    }

    /// As [`Self::new`], for a part of the work, which each line names.
    pub(super) fn of(id: &str, quiet: bool) -> Self {
        let mut watch = Self::new(quiet);
        watch.part = format!("{id}: ");
        watch
    }

    /// Shows what happened.
    pub(super) fn see(&self, event: Event) {
        match event {
            Event::Avatars(count) => self.start("avatars", count),
            Event::Frames(count) => self.start("frames", count),
            Event::Avatar(name, variants) => {
                let name = format!("{name}, for {}", variants.join(", "));
                let number = self.avatars.fetch_add(1, Ordering::Relaxed) + 1;
                let all = self.bar.length().unwrap_or_default();
                self.line(&format!("{}avatar {number}/{all}: {name}", self.part));
                self.detail(format!(" | {name}"));
                *self.avatar() = name;
            }
            Event::Fitting(step) => {
                let Step { iteration, iterations, psnr, splats, .. } = step;
                let avatar = self.avatar().clone();
                self.detail(format!(
                    " | {avatar}, iteration {iteration}/{iterations}, {psnr:.2} dB, {splats} splats"
                ));
            }
            Event::Took(..) => {}
            Event::AvatarReady => self.done(""),
            Event::FrameDone(name) => self.done(&name),
            Event::SequenceDone(name, frames) => {
                let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
                self.line(&format!(
                    "{}sequence {name}: {frames} {}; {done} of {all} in all",
                    self.part,
                    if frames == 1 { "frame" } else { "frames" }
                ));
            }
            Event::Warning(text) => self.above(&format!("warning: {text}"), self.quiet),
        }
    }

    fn avatar(&self) -> MutexGuard<'_, String> {
        self.avatar.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One step further; what it was.
    fn done(&self, name: &str) {
        self.detail(if name.is_empty() { String::new() } else { format!(" | {name}") });
        self.bar.inc(1);
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
    pub(super) fn start(&self, what: &str, count: usize) {
        // The position first: a bar that seems to be at its end says so.
        self.bar.set_position(0);
        self.bar.set_length(count as u64);
        self.bar.set_message(format!("{}{what}", self.part));
        self.bar.reset_eta();
    }
}

/// How much longer it will take, once there is something to tell it from.
fn left(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    let (done, all) = (state.pos(), state.len().unwrap_or_default());
    if done > 0 && done < all && state.eta().as_secs() > 0 {
        // Nobody can be told of an error here.
        let _ = write!(out, ", about {:#} left", HumanDuration(state.eta()));
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
