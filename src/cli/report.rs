//! `reproduce report`: the tables of a run again, or against a baseline.

use super::compare::{COMPARISON, Comparing, check_tables, folder, load, only};
use super::output::{apart, emit, save, written};
use super::page::{Images, page, write_page};
use super::products::{MARKDOWN, printed};
use super::selection::read_json;
use super::{Context, Exit};
use anyhow::{Result, bail};
use clap::Arg;
use clap::builder::{PossibleValue, PossibleValuesParser};
use skinsplat::experiment::Shard;
use skinsplat::report::html::BOUND;
use skinsplat::report::{self, Results};
use skinsplat::run::provenance::Phases;
use skinsplat::run::store;
use skinsplat_table::{FORMATS, Table, to_json};
use std::path::PathBuf;

/// Print the tables of a run again.
///
/// With --baseline it is `reproduce compare BASELINE RUN`, with the same exit codes.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, mut_args(of_comparisons))]
pub(super) struct Report {
    /// Folder of a run, or its results.json
    #[arg(value_name = "RUN", default_value = super::run::DEFAULT_OUT)]
    run: PathBuf,
    /// How to print the tables, or what moved [default: markdown; with --baseline text]
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    format: Option<String>,
    /// Write to a file [default: standard output]
    #[arg(long, value_name = "FILE", conflicts_with = "baseline")]
    out: Option<PathBuf>,
    /// Which of the pictures that the run kept (`run --images`) a page (--format html) shows [default: all]
    #[arg(long, value_enum, value_name = "WHICH")]
    images: Option<Images>,
    /// Megabytes that a page (--format html) stays below: pictures get smaller, then fewer [default: 15]
    #[arg(long, value_name = "MB", value_parser = megabytes)]
    page_mb: Option<f64>,
    /// Where the time went, instead of the tables: plan, avatars and frames of the last call, posing, drawing and scoring
    #[arg(long, conflicts_with = "baseline")]
    timing: bool,
    /// Only this table
    #[arg(long, value_name = "EXPERIMENT")]
    table: Option<String>,
    /// Folder of an earlier run, or its results.json: print what moved, as `reproduce compare` does
    #[arg(long, value_name = "RUN", help_heading = COMPARISON)]
    baseline: Option<PathBuf>,
    #[command(flatten)]
    comparing: Comparing,
}

/// Options that say how to compare want something to compare with.
fn of_comparisons(arg: Arg) -> Arg {
    match arg.get_help_heading() == Some(COMPARISON) && arg.get_id() != "baseline" {
        true => arg.requires("baseline"),
        false => arg,
    }
}

const EXAMPLES: &str = "\
Examples:
  reproduce report runs/default                                tables of a run as Markdown
  reproduce report runs/default --format latex --table table3
  reproduce report runs/default --format html --out page.html  a page with charts and pictures
  reproduce report runs/default --timing                       where the time went";

impl Report {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let tables: Vec<String> = self.table.iter().cloned().collect();
        let of_pages = [("--images", self.images.is_some()), ("--page-mb", self.page_mb.is_some())];
        if let Some((name, _)) = of_pages.iter().find(|(_, given)| *given && self.format(MARKDOWN) != HTML) {
            bail!("{name} without --format html; expected a page, which alone has pictures");
        }
        self.out.iter().try_for_each(|path| apart(path, [self.run.as_path(), folder(&self.run)]))?;
        let results = load(&self.run)?;
        if let Some(baseline) = &self.baseline {
            let format = self.format("text");
            if format == HTML {
                bail!("--format html with --baseline; expected another format: what moved has no page");
            }
            let both = [load(baseline)?, results];
            check_tables(&tables, &both)?;
            let [before, after] = both.map(|results| only(&tables, results));
            return self.comparing.print(&self.comparing.compare(&before, &after)?, format, context);
        }
        check_tables(&tables, std::slice::from_ref(&results))?;
        let results = only(&tables, results);
        let text =
            if self.timing { self.timing(&results, context)? } else { self.tables(&results, context)? };
        match &self.out {
            Some(path) if self.format(MARKDOWN) == HTML => write_page(path, &text, self.bound(), context)?,
            Some(path) => save(path, &text)?,
            None => emit(&text)?,
        }
        Ok(if results.missing() > 0 { Exit::Incomplete } else { Exit::Success })
    }

    /// Most bytes of a page.
    fn bound(&self) -> usize {
        self.page_mb.map_or(BOUND, |megabytes| (1e6 * megabytes) as usize)
    }

    /// The wanted format.
    fn format<'a>(&'a self, default: &'a str) -> &'a str {
        self.format.as_deref().unwrap_or(default)
    }

    /// The tables in the wanted format.
    fn tables(&self, results: &Results, context: Context) -> Result<String> {
        Ok(match self.format(MARKDOWN) {
            HTML => {
                let images = self.images.unwrap_or(Images::All);
                page(results, folder(&self.run), images, self.bound(), context)?
            }
            format => printed(results, format),
        })
    }

    fn timing(&self, results: &Results, context: Context) -> Result<String> {
        let format = self.format(MARKDOWN);
        if format == HTML {
            bail!(
                "--format html with --timing; expected another format: a page of the tables has times at its end"
            );
        }
        let records = store::merge(store::stores(folder(&self.run))?.iter().map(PathBuf::as_path))?;
        let mut tables: Vec<_> = report::timing::phases(results, &records).into_iter().collect();
        let path = folder(&self.run).join("run.json");
        let run: Option<Timed> = path.is_file().then(|| read_json(&path)).transpose()?;
        let calls: Vec<_> = run.iter().flat_map(Timed::calls).collect();
        if calls.is_empty() && !tables.is_empty() {
            context.note(format!("{}: no times of avatars: a run that did not end", path.display()));
        }
        tables.splice(..0, calls);
        if tables.is_empty() {
            bail!(
                "{}: no recorded times; expected the folder of a run, with its {} or run.json",
                folder(&self.run).join(store::FILE_NAME).display(),
                store::FILE_NAME
            );
        }
        Ok(match format {
            "json" => to_json(&tables),
            format => tables.iter().map(|table| written(table, format)).collect::<Vec<_>>().join("\n"),
        })
    }
}

/// What `run.json` says of times; runs of earlier programs say nothing.
#[derive(serde::Deserialize)]
struct Timed {
    phases: Option<Phases>,
    /// The slices of a merge.
    #[serde(default)]
    merged: Vec<Slice>,
}

#[derive(serde::Deserialize)]
struct Slice {
    shard: Option<Shard>,
    run: Option<Box<Timed>>,
}

impl Timed {
    /// The calls that made a run, a table each.
    fn calls(&self) -> Vec<Table> {
        let of_slice = |slice: &Slice| {
            let phases = slice.run.as_ref()?.phases.as_ref()?;
            let mut table = report::timing::calls(phases);
            table.title = slice.shard.map_or(table.title, |shard| format!("The last call of slice {shard}"));
            Some(table)
        };
        let own = self.phases.iter().map(report::timing::calls);
        own.chain(self.merged.iter().filter_map(of_slice)).collect()
    }
}

fn megabytes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

/// The format of pages, beside those of tables.
const HTML: &str = "html";

fn formats() -> PossibleValuesParser {
    let html = PossibleValue::new(HTML).help("one page for a browser, with charts and pictures");
    let tables = FORMATS.iter().map(|format| PossibleValue::new(format.id).help(format.about));
    PossibleValuesParser::new(tables.chain([html]).collect::<Vec<_>>())
}
