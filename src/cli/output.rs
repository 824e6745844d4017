//! Standard output and error: written in one place, so that a closed pipe (`| head`) neither ends the program nor changes how
//! it ends: what was found out counts, whoever reads it.

use anyhow::{Context as _, Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser};
use skinsplat_data::atomic;
use skinsplat_table::{FORMATS, Format as TableFormat, Table, is_hidden, to_json};
use std::io::{ErrorKind, Write};
use std::path::Path;

/// Writes text to standard output, unless its reader went away.
///
/// # Errors
/// As the file behind it, such as a full disk's.
pub(super) fn emit(text: &str) -> Result<()> {
    // Names and comments are whatever files say: a terminal obeys none of them.
    let commands = |c: char| is_hidden(c) && c != '\n' && c != '\t';
    let text = text.replace(commands, "\u{fffd}");
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("standard output: cannot write"),
    }
}

/// The files of a run's folder that later calls read.
const OF_A_RUN: [&str; 4] = ["results.json", "frames.jsonl", "run.json", "costs.json"];

/// Refuses to write over what a command reads: files, or the files of runs' folders.
///
/// # Errors
/// Names the target.
pub(super) fn apart<'a>(target: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let Ok(own) = target.canonicalize() else { return Ok(()) };
    let is = |path: &Path| path.canonicalize().is_ok_and(|path| path == own);
    if read.into_iter().any(|path| is(path) || OF_A_RUN.iter().any(|name| is(&path.join(name)))) {
        bail!("{}: it is read; expected another file to write", target.display());
    }
    Ok(())
}

/// Writes text to a file that the arguments name; one that is a pipe whose reader went away is no error.
///
/// # Errors
/// As [`atomic::write`].
pub(super) fn save(path: &Path, text: &str) -> Result<()> {
    match atomic::write(path, |w| w.write_all(text.as_bytes())) {
        Err(skinsplat_data::Error::Write { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => Ok(written?),
    }
}

/// Writes a line to standard error. Where nobody reads it, there is nobody to be told.
pub(super) fn say(line: impl std::fmt::Display) {
    // Names are whatever files say: a terminal obeys none of them.
    let line = line.to_string().replace(is_hidden, "\u{fffd}");
    let _ = writeln!(std::io::stderr().lock(), "{line}");
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

/// How a command prints a page that it also writes in every format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum PageFormat {
    /// GitHub-flavoured Markdown.
    #[default]
    Markdown,
    /// For programs: one JSON document.
    Json,
}

impl PageFormat {
    /// The text of the two that is wanted.
    pub(super) fn of<'a>(self, markdown: &'a str, json: &'a str) -> &'a str {
        match self {
            Self::Markdown => markdown,
            Self::Json => json,
        }
    }
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
