//! Standard output: written in one place, so that a closed pipe (`| head`) ends the program quietly.

use anyhow::{Context as _, Result};
use clap::builder::{PossibleValue, PossibleValuesParser};
use skinsplat_table::{FORMATS, Format as TableFormat, Table, to_json};
use std::io::Write;

/// Writes text to standard output.
///
/// # Errors
/// As the pipe or file behind it; a broken pipe is recognised by [`is_broken_pipe`].
pub(super) fn emit(text: &str) -> Result<()> {
    // Names and comments are whatever files say: a terminal obeys none of them.
    let commands = |c: char| c.is_control() && c != '\n' && c != '\t';
    let text = text.replace(commands, "\u{fffd}");
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

/// The formats of tables, for `--format`.
pub(super) fn table_format() -> PossibleValuesParser {
    let value = |format: &TableFormat| PossibleValue::new(format.id).help(format.about);
    PossibleValuesParser::new(FORMATS.iter().map(value).collect::<Vec<_>>())
}

/// A table in one of the formats of [`table_format`].
pub(super) fn written(table: &Table, format: &str) -> String {
    TableFormat::named(format).map_or_else(String::new, |format| (format.write)(table))
}

/// A serialisable value as indented JSON with a final newline.
///
/// # Errors
/// As [`emit`].
pub(super) fn emit_json(value: &impl serde::Serialize) -> Result<()> {
    emit(&to_json(value))
}
