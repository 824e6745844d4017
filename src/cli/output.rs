//! Standard output: written in one place, so that a closed pipe (`| head`) ends the program quietly.

use anyhow::{Context as _, Result};
use std::io::Write;

/// Writes text to standard output.
///
/// # Errors
/// As the pipe or file behind it; a broken pipe is recognised by [`is_broken_pipe`].
pub(super) fn emit(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).context("standard output: cannot write")
}

/// True if the reader of our output went away, which is no error.
pub(super) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let broken = |e: &std::io::Error| e.kind() == std::io::ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref::<std::io::Error>().is_some_and(broken))
}

/// How a command prints what it found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// For people.
    #[default]
    Text,
    /// For programs: one JSON document.
    Json,
}

/// A serialisable value as indented JSON with a final newline.
///
/// # Errors
/// If the value cannot be represented (a map with keys that are not strings).
pub(super) fn emit_json(value: &impl serde::Serialize) -> Result<()> {
    emit(&(serde_json::to_string_pretty(value)? + "\n"))
}
