//! `reproduce report`: the tables of a run again, or against a baseline.

use super::output::{emit, emit_json, table_format, written};
use super::tolerances::ToleranceOptions;
use super::{Context, Exit};
use anyhow::{Context as _, Result, anyhow};
use skinsplat::report::compare::{Changes, Move, compare};
use skinsplat::report::{self, Results};
use std::path::{Path, PathBuf};

/// Print the tables of a run again, or compare them with a baseline.
///
/// With --baseline the exit code is 1 if a sequence got worse by more than the tolerances.
#[derive(Debug, clap::Args)]
pub(super) struct Report {
    /// Folder of a run, or its results.json
    #[arg(value_name = "RUN", default_value = super::run::DEFAULT_OUT)]
    run: PathBuf,
    /// How to print the tables
    #[arg(long, value_name = "FORMAT", value_parser = table_format(), default_value = "markdown")]
    format: String,
    /// Only this table
    #[arg(long, value_name = "EXPERIMENT")]
    table: Option<String>,
    /// Folder of an earlier run, or its results.json: print what moved
    #[arg(long, value_name = "RUN", help_heading = "Comparison")]
    baseline: Option<PathBuf>,
    #[command(flatten)]
    tolerances: ToleranceOptions,
}

impl Report {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let mut results = load(&self.run)?;
        if let Some(id) = &self.table {
            let known: Vec<String> = results.tables.iter().map(|table| table.experiment.clone()).collect();
            results.tables.retain(|table| table.experiment == *id);
            if results.tables.is_empty() {
                return Err(anyhow!("--table {id}; expected one of {}", known.join(", ")));
            }
        }
        if let Some(baseline) = &self.baseline {
            return self.compare(&load(baseline)?, &results, context);
        }
        let tables = results.tables.iter().map(|table| &table.table);
        match self.format.as_str() {
            // With what is said around the tables, as in tables.md.
            "markdown" => emit(&report::page(&results))?,
            // One document.
            "json" => emit_json(&tables.collect::<Vec<_>>())?,
            format => emit(&tables.map(|table| written(table, format)).collect::<Vec<_>>().join("\n"))?,
        }
        Ok(if results.missing() > 0 { Exit::Incomplete } else { Exit::Success })
    }

    fn compare(&self, baseline: &Results, candidate: &Results, context: Context) -> Result<Exit> {
        let changes = compare(baseline, candidate, &self.tolerances.0);
        match self.format.as_str() {
            "json" => emit_json(&changes)?,
            _ => emit(&text(&changes))?,
        }
        context.note(format!("{} sequences and variants compared", changes.compared));
        Ok(if changes.verdict.is_good() { Exit::Success } else { Exit::Failed })
    }
}

/// Frames of a comparison that are worth a line.
const FRAMES_SHOWN: usize = 10;

fn text(changes: &Changes) -> String {
    let line = |m: &Move| format!("  {} {}: {} -> {}\n", m.at, m.metric.id(), m.baseline, m.candidate);
    let mut text = format!("verdict: {:?}\n", changes.verdict).to_lowercase();
    for (title, moves) in [
        ("sequences that moved", &changes.sequences[..]),
        ("frames that moved most", &changes.frames[..changes.frames.len().min(FRAMES_SHOWN)]),
    ] {
        if !moves.is_empty() {
            text += &format!("{title}:\n{}", moves.iter().map(line).collect::<String>());
        }
    }
    for (title, names) in [("lost", &changes.lost), ("new", &changes.gained)] {
        if !names.is_empty() {
            text += &format!("{title}: {}\n", names.join(", "));
        }
    }
    text
}

fn load(path: &Path) -> Result<Results> {
    let file = if path.is_dir() { path.join("results.json") } else { path.to_owned() };
    let text = std::fs::read_to_string(&file).with_context(|| format!("{}: cannot read", file.display()))?;
    Results::from_json(&text).map_err(|problem| anyhow!("{}: {problem}", file.display()))
}
