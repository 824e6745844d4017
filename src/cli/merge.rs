//! `reproduce merge`: what several machines computed, as one run.

use super::output::emit;
use super::products::{
    Printed, make_folder, printed, verdict, write_bend, write_curves, write_results, write_text,
};
use super::selection::read_json;
use super::{Context, Exit};
use anyhow::{Result, bail};
use serde_json::Value;
use skinsplat::experiment::{CodeVersions, FrameRecord, Shard};
use skinsplat::report;
use skinsplat::run::merge::{self, Disagreement, Merged, Missing, Source};
use skinsplat::run::store::{self, FILE_NAME};
use skinsplat::run::{Error, Machine};
use std::path::{Path, PathBuf};

/// Collect the slices of a run: the same tables as one run, byte for byte.
///
/// Reads the results of every slice, wherever they are: one folder that all of them wrote to, or a folder each. Needs neither
/// the data nor the arguments of the runs. Refuses slices of different plans and says in what they differ; says where two
/// machines have different results for one frame; lists what is missing, and whose slice it is in.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER)]
pub(super) struct Merge {
    /// Folders of the slices
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    /// Folder to write to [default: the folder of the slices, if it is one]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    printed: Printed,
}

const AFTER: &str = "\
Exit codes:
  0  everything is there
  1  two machines have different results for the same frame: nothing is written
  2  the slices are of different plans, or a file cannot be read
  3  scores are missing: the tables are written, and say which

Examples:
  reproduce run table1 --shard 1/2 --out runs/one     on one machine
  reproduce run table1 --shard 2/2 --out runs/two     on another
  reproduce merge runs/one runs/two --out runs/table1
  reproduce batch slurm --help                        a job script for a cluster";

/// Where a merge comes from (its `run.json`).
#[derive(Debug, serde::Serialize)]
struct MergeReport<'a> {
    program: &'static str,
    version: &'static str,
    code: CodeVersions,
    plan: &'a str,
    machine: Machine,
    merged: Vec<Slice<'a>>,
}

/// A store, and who computed what it holds.
#[derive(Debug, serde::Serialize)]
struct Slice<'a> {
    #[serde(flatten)]
    source: &'a Source,
    /// What the run said of itself; nothing where it did not end, or was one of an earlier program.
    run: Option<Value>,
}

impl Merge {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let out = self.out()?;
        let merged = merge::merge(&self.folders)?;
        if merged.file.code != CodeVersions::CURRENT {
            let [made, own] = [merged.file.code, CodeVersions::CURRENT]
                .map(|code| serde_json::to_string(&code).unwrap_or_default());
            bail!("the slices were made by code {made}; expected {own}, that of this program");
        }
        if !merged.disagreements.is_empty() {
            emit(&merged.disagreements.iter().map(disagreement).collect::<String>())?;
            let count = merged.disagreements.len();
            context.note(format!("{count} results differ between machines; nothing was written"));
            return Ok(Exit::Failed);
        }
        let results = report::results(&merged.file.plan, &merged.file.experiments, &merged.records)?;
        make_folder(out)?;
        self.write_store(out, &merged)?;
        write_results(out, &results)?;
        write_curves(out, &merged.file.plan, &merged.file.experiments, &self.folders)?;
        write_bend(out, &results)?;
        write_text(&out.join("run.json"), &(serde_json::to_string_pretty(&report_of(&merged))? + "\n"))?;
        emit(&printed(&results, &self.printed.format))?;
        self.say(out, &merged, context);
        Ok(verdict(&merged.file.plan, merged.missing.len(), &merged.file.left_out, context))
    }

    /// The folder to write to.
    fn out(&self) -> Result<&Path> {
        match (&self.out, &self.folders[..]) {
            (Some(out), _) => Ok(out),
            (None, [folder]) => Ok(folder),
            (None, _) => bail!("--out: missing; expected a folder, since the slices are in several"),
        }
    }

    /// The records as a store of their own, so that the folder is a run's; where the slices lie, they are there already.
    fn write_store(&self, out: &Path, merged: &Merged) -> Result<()> {
        let same = |folder: &PathBuf| match (folder.canonicalize(), out.canonicalize()) {
            (Ok(folder), Ok(out)) => folder == out,
            _ => folder == out,
        };
        if self.folders.iter().any(same) {
            return Ok(());
        }
        let path = out.join(FILE_NAME);
        for other in store::stores(out)? {
            let plan = store::read_all(&other)?.plan;
            if plan.is_some_and(|plan| plan != merged.file.plan.digest) || other != path {
                bail!(
                    "{}: results of another run; expected an empty folder, or that of an earlier merge",
                    other.display()
                );
            }
        }
        let nowhere = Machine::default();
        let of = |record: &FrameRecord| merged.machines.get(&record.key).map(|machine| &**machine);
        let records = merged.records.values().map(|record| (of(record).unwrap_or(&nowhere), record));
        Ok(store::write_new(&path, &merged.file.plan.digest, records).map_err(Error::from)?)
    }

    /// What was collected, and what was not.
    fn say(&self, out: &Path, merged: &Merged, context: Context) {
        for Source { store, machines, records, .. } in &merged.sources {
            let machines: Vec<String> = machines.iter().map(Machine::to_string).collect();
            context.note(format!("{store}: {records} records, by {}", machines.join(", ")));
        }
        context.note(format!("{}: tables.md, results.json and more", out.display()));
        if merged.missing.is_empty() {
            return;
        }
        merged.missing.iter().for_each(|missing| context.note(line_of(missing)));
        context.note(format!("{} scores are missing", merged.missing.len()));
    }
}

fn report_of(merged: &Merged) -> MergeReport<'_> {
    MergeReport {
        program: env!("CARGO_PKG_NAME"),
        version: env!("CARGO_PKG_VERSION"),
        code: CodeVersions::CURRENT,
        plan: &merged.file.plan.digest,
        machine: Machine::here(),
        merged: merged.sources.iter().map(|source| Slice { source, run: run_of(source) }).collect(),
    }
}

/// What the run that wrote a store said of itself.
fn run_of(source: &Source) -> Option<Value> {
    let store = Path::new(&source.store);
    let file = source.shard.map_or_else(|| "run.json".to_owned(), Shard::provenance_name);
    let said: Value = read_json(&store.with_file_name(file)).ok()?;
    // A merge says nothing of its own.
    said.get("phases").is_some().then_some(said)
}

fn line_of(Missing { label, shard, problem }: &Missing) -> String {
    let problem = problem.as_ref().map_or_else(|| "not run".to_owned(), |why| format!("failed: {why}"));
    match shard {
        Some(shard) => format!("missing: {label}: {problem}; in slice {shard}"),
        None => format!("missing: {label}: {problem}"),
    }
}

/// Two results of one frame: the frame and its key, then a line per number.
fn disagreement(Disagreement { key, label, places: [first, second], values }: &Disagreement) -> String {
    let mut text =
        format!("{label} (key {key})\n  {} on {}\n  {} on {}\n", first.0, first.1, second.0, second.1);
    for (metric, a, b) in values {
        text += &format!("  {metric}: {a} and {b}\n");
    }
    text
}
