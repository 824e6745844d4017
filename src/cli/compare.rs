//! `reproduce compare`: a run against an earlier one, or against the paper.

use super::output::{apart, emit, resolved, save, written};
use super::page::PICTURES;
use super::selection::name_and_path;
use super::tolerances::ToleranceOptions;
use super::{Context, Exit};
use anyhow::{Result, anyhow, bail};
use clap::builder::{OsStringValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use skinsplat::report::compare::{self, Changes, Fate, Tolerances, Verdict};
use skinsplat::report::{Results, picture_name};
use skinsplat::run::pictures::single_picture;
use skinsplat::run::store;
use skinsplat_core::choice::one_of;
use skinsplat_data::atomic;
use skinsplat_data::error::read_text;
use skinsplat_table::{FORMATS, to_json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Compare a run with an earlier one: what regressed, improved, is missing or new.
///
/// Every number (a metric of a variant on a sequence) is judged by its tolerance; frames show where a movement comes from, with the
/// pictures that both runs kept (`run --images`). Not compared, with a line that says why: tables of another protocol or version of
/// the experiment, sequences of other data under the same name.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER)]
pub(super) struct Compare {
    /// Folders of runs, or their results.json: the baseline, then the current run (with --against-paper: the run alone)
    #[arg(value_name = "BASELINE CURRENT", required = true, num_args = 1..=2)]
    runs: Vec<PathBuf>,
    #[command(flatten)]
    how: Comparing,
    /// Judge the tables of real data by the printed numbers, instead of a baseline: each may miss by half of the printed one's last
    /// digit, or a tolerance that is given instead, and twice our standard deviation over seeds
    #[arg(long, conflicts_with = "shown")]
    against_paper: bool,
    /// How to print the comparison
    #[arg(long, value_name = "FORMAT", value_parser = formats(), default_value = "text")]
    format: String,
    /// Also write it to a file (may be repeated)
    #[arg(long, value_name = "FORMAT=FILE", value_parser = saving())]
    save: Vec<Saving>,
    /// Only these tables (may be repeated)
    #[arg(long = "table", value_name = "EXPERIMENT")]
    tables: Vec<String>,
}

/// The heading of what is asked of comparisons.
pub(super) const COMPARISON: &str = "Comparison";

/// How a comparison is made, whoever asks for it.
#[derive(Debug, clap::Args)]
pub(super) struct Comparing {
    /// TOML file of tolerances: `psnr = 0.05`; for one table under `[tables.ID]`; for single frames, which count only then, under
    /// `[frames]`. The options below go before it; inf: whatever it is
    #[arg(long, value_name = "FILE", help_heading = COMPARISON)]
    tolerances: Option<PathBuf>,
    #[command(flatten)]
    asked: ToleranceOptions,
    /// What improved by more than its tolerance counts too: for a program whose numbers should not move
    #[arg(long, help_heading = COMPARISON)]
    strict: bool,
    /// Numbers of frames to show, those that got worse first
    #[arg(long = "frames", value_name = "N", default_value_t = 10, help_heading = COMPARISON)]
    shown: usize,
    /// Show what is unchanged too (csv, latex and json always have it)
    #[arg(long, help_heading = COMPARISON)]
    all: bool,
}

const AFTER: &str = "\
Exit codes:
  0  no regression
  1  a number regressed (with --strict: or improved)
  3  no regression was found, but something of the baseline is missing or does not compare, or nothing was compared

Examples:
  reproduce compare runs/main runs/mine
  reproduce compare ci/baseline.json runs/ci --save junit=compare.xml
  reproduce compare runs/mine --against-paper";

/// A file and its format.
#[derive(Clone, Debug)]
struct Saving {
    format: String,
    file: PathBuf,
}

/// Formats beside those of tables.
const MORE: [(&str, &str); 2] =
    [("junit", "JUnit XML"), ("github", "annotations of GitHub Actions (workflow commands)")];

/// Every format of tables, which hold the verdicts, and those for continuous integration.
fn formats() -> PossibleValuesParser {
    let tables = FORMATS.iter().map(|format| (format.id, format.about));
    let value = |(id, about): (&'static str, &'static str)| PossibleValue::new(id).help(about);
    PossibleValuesParser::new(tables.chain(MORE).map(value).collect::<Vec<_>>())
}

fn saving() -> impl TypedValueParser<Value = Saving> {
    OsStringValueParser::new().try_map(|text| {
        let known: Vec<&str> = FORMATS.iter().map(|format| format.id).chain(MORE.map(|(id, _)| id)).collect();
        let named = name_and_path(&text).filter(|(format, _)| known.contains(&format.as_str()));
        let expected = || format!("expected FORMAT=FILE with a format of {}", known.join(", "));
        named.map(|(format, file)| Saving { format, file }).ok_or_else(expected)
    })
}

impl Compare {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        self.check_targets()?;
        let changes = match (&self.runs[..], self.against_paper) {
            ([run], true) => self.how.against_paper(&self.chosen(load(run)?)?)?,
            ([baseline, current], false) => {
                let both = [load(baseline)?, load(current)?];
                check_tables(&self.tables, &both)?;
                let [before, after] = both.map(|results| only(&self.tables, results));
                let mut changes = self.how.compare(&before, &after)?;
                add_pictures(&mut changes, [baseline, current]);
                changes
            }
            ([_, ..], true) => bail!("--against-paper with two runs; expected one, without a baseline"),
            _ => bail!("one run; expected two, the baseline and the current run, or --against-paper"),
        };
        // Written before the verdict ends the program: a report of a failure is what they are for.
        for Saving { format, file } in &self.save {
            let text = self.how.written(&changes, format);
            save(file, &text)?;
        }
        self.how.print(&changes, &self.format, context)
    }

    /// Finds out what could not be written before anything is.
    fn check_targets(&self) -> Result<()> {
        for (i, Saving { format, file }) in self.save.iter().enumerate() {
            let shown = format!("--save {format}={}", file.display());
            if file.as_os_str() == "-" {
                bail!("{shown}; expected a file: --format {format} prints it");
            }
            let before = &self.save[..i];
            if before.iter().any(|other| other.format == *format) {
                bail!("{shown}: {format} twice; expected each format once");
            }
            if before.iter().any(|other| resolved(&other.file) == resolved(file)) {
                bail!("{shown}: the same file twice; expected one for each format");
            }
            apart(file, self.runs.iter().map(PathBuf::as_path))?;
            atomic::check(file)?;
        }
        Ok(())
    }

    fn chosen(&self, results: Results) -> Result<Results> {
        check_tables(&self.tables, std::slice::from_ref(&results))?;
        Ok(only(&self.tables, results))
    }
}

/// Refuses a table that none of the runs has.
///
/// # Errors
/// The first such table, with those that there are.
pub(super) fn check_tables(tables: &[String], runs: &[Results]) -> Result<()> {
    let known: BTreeSet<&str> = runs.iter().flat_map(|r| &r.tables).map(|t| t.experiment.as_str()).collect();
    match tables.iter().find(|id| !known.contains(id.as_str())) {
        Some(id) => {
            let known: Vec<&str> = known.into_iter().collect();
            bail!("--table {id}; expected {}", one_of(id, &known))
        }
        None => Ok(()),
    }
}

/// The tables that were asked for; all if none was.
pub(super) fn only(tables: &[String], mut results: Results) -> Results {
    results.tables.retain(|table| tables.is_empty() || tables.contains(&table.experiment));
    results
}

impl Comparing {
    /// Compares as the options say.
    ///
    /// # Errors
    /// A file of tolerances that cannot be read or says something else.
    pub(super) fn compare(&self, baseline: &Results, current: &Results) -> Result<Changes> {
        Ok(self.judged(compare::compare(baseline, current, &self.tolerances()?)))
    }

    /// Judges by the printed numbers, as the options say.
    ///
    /// # Errors
    /// As [`Self::compare`], and tolerances of frames, of which a paper prints nothing.
    fn against_paper(&self, results: &Results) -> Result<Changes> {
        let tolerances = self.tolerances()?;
        if let (Some(path), false) = (&self.tolerances, tolerances.frames.0.is_empty()) {
            bail!("{}: [frames] with --against-paper; expected none: no frame is printed", path.display());
        }
        Ok(self.judged(compare::against_paper(results, &tolerances)))
    }

    fn judged(&self, changes: Changes) -> Changes {
        let changes = changes.with_frames(self.shown);
        if self.strict { changes.strictly() } else { changes }
    }

    fn tolerances(&self) -> Result<Tolerances> {
        let asked = self.asked.0.clone();
        let Some(path) = &self.tolerances else { return Ok(Tolerances { asked, ..Tolerances::default() }) };
        let text = read_text(path, "tolerances", "a TOML file of tolerances")?;
        let file = Tolerances::parse(&text).map_err(|problem| anyhow!("{}: {problem}", path.display()))?;
        Ok(Tolerances { asked, ..file })
    }

    /// Prints the comparison; says how it ended.
    pub(super) fn print(&self, changes: &Changes, format: &str, context: Context) -> Result<Exit> {
        emit(&self.written(changes, format))?;
        context.note(format!("{} sequences and variants compared", changes.compared));
        Ok(match changes.verdict {
            Verdict::Regressed => Exit::Failed,
            Verdict::Incomplete => Exit::Incomplete,
            Verdict::Improved | Verdict::Unchanged if changes.is_good() => Exit::Success,
            Verdict::Improved | Verdict::Unchanged => Exit::Failed,
        })
    }

    fn written(&self, changes: &Changes, format: &str) -> String {
        match format {
            "text" => compare::text(changes, self.all),
            "markdown" => compare::markdown(changes, self.all),
            "json" => to_json(changes),
            "junit" => compare::junit(changes),
            "github" => compare::github(changes),
            table => written(&compare::verdicts(changes, |_: Fate| true), table),
        }
    }
}

/// Notes the pictures that both runs kept of the frames that moved.
fn add_pictures(changes: &mut Changes, runs: [&PathBuf; 2]) {
    for frame in &mut changes.frames {
        let name = picture_name(&frame.table, &frame.label, &frame.frame);
        let single = single_picture(&frame.table, &frame.label, &frame.frame, &frame.variant);
        let places = [Path::new(PICTURES).join(single), Path::new("images").join(name)];
        let both = places.iter().map(|place| runs.map(|run| folder(run).join(place)));
        let kept = both.into_iter().find(|pair| pair.iter().all(|path| path.is_file()));
        frame.pictures = kept.map(|pair| pair.map(|path| path.to_string_lossy().into_owned()));
    }
}

/// The folder of a run that was named by its folder or its results.
pub(super) fn folder(run: &Path) -> &Path {
    if run.is_dir() { run } else { run.parent().unwrap_or(Path::new("")) }
}

/// Reads the results of a run.
///
/// # Errors
/// A file that cannot be read or is none; the message names the file.
pub(super) fn load(path: &Path) -> Result<Results> {
    let file = if path.is_dir() { path.join("results.json") } else { path.to_owned() };
    if path.is_dir() && !file.exists() && !store::stores(path)?.is_empty() {
        let done = "a run that has ended, or is done with a table: the same `reproduce run` goes on from what is there, and \
                    `reproduce merge` collects slices";
        bail!("{}: not there yet; expected {done}", file.display());
    }
    let text = read_text(&file, "results", "a run's folder, or its results.json")?;
    Results::from_json(&text).map_err(|problem| anyhow!("{}: {problem}", file.display()))
}
