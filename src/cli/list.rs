//! `reproduce list`: what there is to choose from.

use super::Exit;
use super::data::Data;
use super::output::{emit, table_format, written};
use super::planning::known_experiments;
use anyhow::Result;
use skinsplat::datasets::{Dataset, Presence};
use skinsplat_fit::RECIPES;
use skinsplat_metrics::{METRICS, Metric, PROTOCOLS, SsimVariant, VARIANT_IDS};
use skinsplat_posing::PRESETS;
use skinsplat_table::{Cell, Column, Label, Row, Table, text};
use std::path::{Path, PathBuf};

/// List experiments, datasets, strategies, recipes, protocols or metrics.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct List {
    /// What to list
    #[arg(value_enum)]
    what: What,
    /// How to print it
    #[arg(long, value_name = "FORMAT", value_parser = table_format(), default_value = "text")]
    format: String,
    #[command(flatten)]
    data: Data,
}

/// A kind of thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum What {
    /// Tables that `run` can make.
    Experiments,
    /// Datasets, and whether they are here.
    Datasets,
    /// Rotation strategies.
    Strategies,
    /// Fitting recipes.
    Recipes,
    /// Scoring protocols.
    Protocols,
    /// Metrics and their variants.
    Metrics,
}

const EXAMPLES: &str = "\
Examples:
  reproduce list datasets
  reproduce list strategies --format json";

impl List {
    pub(super) fn run(&self) -> Result<Exit> {
        let table = match self.what {
            What::Experiments => experiments()?,
            What::Datasets => self.datasets()?,
            What::Strategies => strategies(),
            What::Recipes => recipes(),
            What::Protocols => protocols(),
            What::Metrics => metrics(),
        };
        match self.format.as_str() {
            // Without headings: a line per thing, its id first.
            "text" => emit(&text::rows(&table))?,
            format => emit(&written(&table, format))?,
        }
        Ok(Exit::Success)
    }

    fn datasets(&self) -> Result<Table> {
        let registry = self.data.registry()?;
        let rows = registry
            .datasets
            .iter()
            .map(|d| (d.id.clone(), [d.title.clone(), d.licence.clone(), presence(d)]));
        Ok(listing(
            "Datasets",
            [("title", "Title"), ("licence", "Licence"), ("available", "Available")],
            rows,
        ))
    }
}

/// How much of a data set is there, in words.
fn presence(dataset: &Dataset) -> String {
    match (dataset.presence(), &dataset.path) {
        (Presence::Complete, _) => "available".to_owned(),
        (Presence::Partial { subjects, missing, broken }, _) => {
            let left = subjects.saturating_sub(missing.len() + broken.len());
            let gone = (!missing.is_empty()).then(|| format!("no folder {}", names(&missing)));
            let why = broken.first().map(|first| match broken.len() {
                1 => format!("one cannot be loaded: {first}"),
                count => format!("{count} cannot be loaded, the first: {first}"),
            });
            let reasons: Vec<String> = gone.into_iter().chain(why).collect();
            format!("not complete: {left} of {subjects} subjects; {}", reasons.join("; "))
        }
        (Presence::Broken(error), _) => format!("not available: {error}"),
        (Presence::Absent, _) if !dataset.is_generated() && dataset.reader().is_none() => {
            format!("not available: nothing reads the layout {} yet", dataset.layout)
        }
        (Presence::Absent, Some(path)) => format!("not there: looked in {}", absolute(path).display()),
        (Presence::Absent, None) => "not there: the registry names no path".to_owned(),
    }
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

fn names(folders: &[PathBuf]) -> String {
    let names: Vec<String> = folders.iter().map(|folder| absolute(folder).display().to_string()).collect();
    names.join(", ")
}

/// A table of things by id, and texts about them.
fn listing<const N: usize>(
    title: &str,
    columns: [(&str, &str); N],
    rows: impl IntoIterator<Item = (String, [String; N])>,
) -> Table {
    let row = |(id, texts): (String, [String; N])| Row::new(&id, [&id], texts.map(Cell::text).into());
    Table {
        labels: vec![Label::new("id", "Id")],
        columns: columns.map(|(key, title)| Column::text(key, title)).into(),
        rows: rows.into_iter().map(row).collect(),
        ..Table::new(title.to_lowercase(), title)
    }
}

fn experiments() -> Result<Table> {
    let rows = known_experiments()?.into_iter().map(|e| (e.id, [e.protocol, e.caption]));
    Ok(listing("Experiments", [("protocol", "Protocol"), ("caption", "Caption")], rows))
}

fn strategies() -> Table {
    let presets = PRESETS.iter().map(|p| (p.id.to_owned(), [p.title, p.summary]));
    let variations =
        skinsplat_posing::variations().into_iter().map(|v| (format!("+{}", v.spec), ["", v.summary]));
    let rows = presets.chain(variations).map(|(id, texts)| (id, texts.map(str::to_owned)));
    listing("Strategies", [("title", "Title"), ("summary", "Summary")], rows)
}

fn recipes() -> Table {
    let rows = RECIPES.iter().map(|r| (r.id.clone(), [r.title.clone(), r.strategy.to_string()]));
    listing("Recipes", [("title", "Title"), ("strategy", "Strategy")], rows)
}

fn protocols() -> Table {
    let rows = PROTOCOLS.iter().map(|p| (p.id.clone(), [p.version.to_string(), p.title.clone()]));
    listing("Protocols", [("version", "Version"), ("title", "Title")], rows)
}

fn metrics() -> Table {
    let metric = |m: &Metric| (m.id.to_owned(), [format!("table column {}: {}", m.title, m.summary)]);
    let kinds = METRICS.iter().map(metric);
    let ssims = SsimVariant::ALL.map(|s| (s.id().to_owned(), ["SSIM of a protocol".to_owned()]));
    let variants = VARIANT_IDS.iter().flat_map(|(region, ids)| {
        ids.iter().map(|id| ((*id).to_owned(), [format!("variant of `score`, region {}", region.id())]))
    });
    listing("Metrics", [("what", "What")], kinds.chain(ssims).chain(variants))
}
