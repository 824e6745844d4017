//! Standard output and error: written in one place, so that a closed pipe (`| head`) neither ends the program nor changes how
//! it ends: what was found out counts, whoever reads it.

use super::page::PICTURES;
use super::products::AVATARS;
use anyhow::{Context as _, Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser};
use skinsplat_data::atomic;
use skinsplat_table::{FORMATS, Format as TableFormat, Table, is_hidden, to_json};
use std::io::{ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

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
const OF_A_RUN: [&str; 5] = ["results.json", "frames.jsonl", "run.json", "costs.json", "curves.csv"];

/// Refuses to write over what a command reads: files, or the files of runs' folders.
///
/// # Errors
/// Names the target.
pub(super) fn apart<'a>(target: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let own = resolved(target);
    let mut read = read.into_iter();
    let is_read = |path: &Path| {
        own == resolved(path)
            || OF_A_RUN.iter().any(|name| own == resolved(&path.join(name)))
            || own.starts_with(resolved(&path.join(PICTURES)))
    };
    if read.any(is_read) {
        bail!("{}: it is read; expected another file to write", target.display());
    }
    Ok(())
}

/// Endings of the files that a run leaves in its folder, beside those in folders of its own.
const WRITTEN: [&str; 6] = ["md", "json", "jsonl", "csv", "tex", "svg"];
/// The folders in a run's.
const FOLDERS: [&str; 5] = [AVATARS, PICTURES, "images", "motion", "curves"];

/// Refuses a page that a run would write over what else it writes, or cannot write. The run's folder may not be there yet.
///
/// # Errors
/// Names the target.
pub(super) fn beside_run(target: &Path, run: &Path) -> Result<()> {
    let (own, folder) = (resolved(target), resolved(run));
    if folder.starts_with(&own) {
        bail!("{}: it is a folder of this run; expected a file", target.display());
    }
    let in_run = own.parent() == Some(&folder);
    let ends = |ending: &&str| own.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    if in_run && WRITTEN.iter().any(ends) || FOLDERS.iter().any(|name| own.starts_with(folder.join(name))) {
        bail!("{}: it is written by this run; expected another file", target.display());
    }
    // The folder itself is made once there is a plan.
    if !in_run || own.is_dir() {
        atomic::check(target)?;
    }
    Ok(())
}

/// A path with links and `..` resolved, as far as it is there.
pub(super) fn resolved(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let there = whole.ancestors().find_map(|part| Some((part, part.canonicalize().ok()?)));
    let Some((part, mut resolved)) = there else { return whole };
    for component in whole.strip_prefix(part).into_iter().flat_map(Path::components) {
        match component {
            Component::ParentDir => drop(resolved.pop()),
            other => resolved.push(other),
        }
    }
    resolved
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_the_same_however_they_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("there")).unwrap();
        assert_eq!(resolved(&at("there/../there/a")), resolved(&at("there/a")));
        assert_eq!(resolved(&at("new/../there/./a")), resolved(&at("there/a")));
        assert_ne!(resolved(&at("new/a")), resolved(&at("there/a")));
    }

    #[test]
    fn pages_keep_off_what_a_run_writes() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let refused = |name: &str| beside_run(&at(name), &at("runs/a")).err().map(|error| error.to_string());
        for name in
            ["tables.md", "curves.csv", "frames.JSONL", "pictures/x.html", "avatars/a", "no/../bend.csv"]
        {
            let said = refused(&format!("runs/a/{name}")).unwrap_or_default();
            assert!(said.ends_with("it is written by this run; expected another file"), "{name}: {said}");
        }
        for name in ["runs/a", "runs"] {
            assert!(refused(name).unwrap_or_default().ends_with("expected a file"), "{name}");
        }
        for name in ["runs/a/page.html", "page.html", "a.json"] {
            assert_eq!(refused(name), None, "{name}");
        }
        std::fs::create_dir_all(at("runs/a/folder")).unwrap();
        for name in ["runs/a/folder", "runs/a/none/page.html", "none/page.html"] {
            assert!(refused(name).unwrap_or_default().contains("cannot write"), "{name}");
        }
    }
}
