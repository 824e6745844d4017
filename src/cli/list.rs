//! `reproduce list`: what there is to choose from.

use super::Exit;
use super::data::Data;
use super::output::emit;
use super::planning::known_experiments;
use anyhow::Result;
use skinsplat_fit::RECIPES;
use skinsplat_metrics::{MetricKind, PROTOCOLS, SsimVariant, VARIANT_IDS};
use skinsplat_posing::PRESETS;

/// List experiments, datasets, strategies, recipes, protocols or metrics.
#[derive(Debug, clap::Args)]
pub(super) struct List {
    /// What to list
    #[arg(value_enum)]
    what: What,
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

impl List {
    pub(super) fn run(&self) -> Result<Exit> {
        let rows = match self.what {
            What::Experiments => experiments()?,
            What::Datasets => self.datasets()?,
            What::Strategies => strategies(),
            What::Recipes => recipes(),
            What::Protocols => protocols(),
            What::Metrics => metrics(),
        };
        let width = rows.iter().map(|[id, _]| id.len()).max().unwrap_or_default();
        emit(&rows.iter().map(|[id, text]| format!("{id:width$}  {text}\n")).collect::<String>())?;
        Ok(Exit::Success)
    }

    fn datasets(&self) -> Result<Vec<[String; 2]>> {
        let registry = self.data.registry()?;
        let row = |d: &crate::datasets::Dataset| {
            let here = match (d.is_available(), &d.path) {
                (true, _) => "available".to_owned(),
                (false, Some(path)) => format!("not available: put it in {}", path.display()),
                (false, None) => "not available".to_owned(),
            };
            [d.id.clone(), format!("{}; {}; {here}", d.title, d.licence)]
        };
        Ok(registry.datasets.iter().map(row).collect())
    }
}

fn experiments() -> Result<Vec<[String; 2]>> {
    let row = |e: crate::experiment::Experiment| [e.id, format!("{} ({})", e.caption, e.protocol)];
    Ok(known_experiments()?.into_iter().map(row).collect())
}

fn strategies() -> Vec<[String; 2]> {
    let presets = PRESETS.iter().map(|p| [p.id.to_owned(), format!("{}: {}", p.title, p.summary)]);
    let variations =
        skinsplat_posing::variations().into_iter().map(|v| [format!("+{}", v.spec), v.summary.to_owned()]);
    presets.chain(variations).collect()
}

fn recipes() -> Vec<[String; 2]> {
    RECIPES.iter().map(|r| [r.id.clone(), format!("{} [{}]", r.title, r.strategy)]).collect()
}

fn protocols() -> Vec<[String; 2]> {
    PROTOCOLS.iter().map(|p| [p.id.clone(), format!("version {}; {}", p.version, p.title)]).collect()
}

fn metrics() -> Vec<[String; 2]> {
    let kinds = MetricKind::ALL.map(|m| [m.id().to_owned(), format!("table column {}", m.title())]);
    let ssims = SsimVariant::ALL.map(|s| [s.id().to_owned(), "SSIM of a protocol".to_owned()]);
    let variants = VARIANT_IDS.iter().flat_map(|(region, ids)| {
        ids.iter().map(|id| [(*id).to_owned(), format!("variant of `score`, region {}", region.id())])
    });
    kinds.into_iter().chain(ssims).chain(variants).collect()
}
