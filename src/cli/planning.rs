//! Which experiments, on how much of the data: the arguments of `run` and `plan`.

use super::data::Data;
use super::lpips::LpipsWeights;
use crate::experiment::{self, Experiment, GivenWeights, Options, Plan, Profile, Subset};
use crate::run::Library;
use anyhow::{Result, bail};
use skinsplat_metrics::lpips::weights::Networks;
use std::path::{Path, PathBuf};

/// What to plan.
#[derive(Debug, clap::Args)]
pub(super) struct Planning {
    /// Experiments: ids (see `reproduce list experiments`) or .toml files [default: the six tables]
    #[arg(value_name = "EXPERIMENT")]
    experiments: Vec<String>,
    /// How much of the data to look at: quick (256 pixels, few frames, short fits), standard (everything), paper (long fits)
    #[arg(long, value_name = "P", default_value = "quick", value_parser = profile)]
    profile: Profile,
    /// Most iterations of a fit [default: the profile's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    fit_iterations: Option<u32>,
    /// Repeat every fit with these seeds (such as 0,1,2), and print means and spreads
    #[arg(long, value_name = "S,…", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Add a row for every strategy
    #[arg(long)]
    all_strategies: bool,
    /// Only test frames START <= index < END of each sequence
    #[arg(long, value_name = "START..END", value_parser = range, help_heading = "Subset")]
    frames: Option<Range>,
    /// At most N test frames per sequence
    #[arg(long, value_name = "N", help_heading = "Subset")]
    limit: Option<usize>,
    /// Only this subject (may be repeated)
    #[arg(long = "subject", value_name = "ID", help_heading = "Subset")]
    subjects: Vec<String>,
    /// Only this variant (may be repeated)
    #[arg(long = "variant", value_name = "ID", help_heading = "Subset")]
    variants: Vec<String>,
    #[command(flatten)]
    lpips: LpipsWeights,
    #[command(flatten)]
    data: Data,
}

#[derive(Clone, Copy, Debug)]
struct Range([usize; 2]);

/// A plan and all that it was made from.
pub(super) struct Planned {
    pub(super) plan: Plan,
    pub(super) experiments: Vec<Experiment>,
    pub(super) library: Library,
    pub(super) networks: Networks,
}

impl Planning {
    /// Loads experiments and data, and plans.
    pub(super) fn plan(&self) -> Result<Planned> {
        let experiments = self.experiments()?;
        let library = self.data.library(&experiments)?;
        let subset = Subset {
            frames: self.frames.map(|Range(range)| range),
            limit: self.limit,
            subjects: self.subjects.clone(),
            variants: self.variants.clone(),
        };
        let networks = self.lpips.networks()?;
        let given = |(net, digest): (_, &str)| GivenWeights { net, digest: digest.to_owned() };
        let lpips_weights = networks.given().map(given);
        let options = Options { profile: self.profile(), subset, lpips_weights };
        let plan = experiment::plan(&experiments, &library.describe()?, &options)?;
        Ok(Planned { plan, experiments, library, networks })
    }

    fn profile(&self) -> Profile {
        let fit_iterations = self.fit_iterations.or(self.profile.fit_iterations);
        Profile { fit_iterations, ..self.profile.clone() }
    }

    fn experiments(&self) -> Result<Vec<Experiment>> {
        let known = known_experiments()?;
        let mut chosen = Vec::new();
        for name in &self.experiments {
            if Path::new(name).extension().is_some_and(|e| e == "toml") {
                chosen.push(Experiment::load(Path::new(name))?);
                continue;
            }
            let Some(experiment) = known.iter().find(|e| e.id == *name) else {
                let ids: Vec<&str> = known.iter().map(|e| e.id.as_str()).collect();
                bail!("experiment `{name}`; expected a .toml file or one of {}", ids.join(", "));
            };
            chosen.push(experiment.clone());
        }
        let chosen = if chosen.is_empty() { Experiment::embedded() } else { chosen };
        let extend = self.all_strategies;
        let chosen =
            if extend { chosen.iter().map(Experiment::with_all_strategies).collect() } else { chosen };
        Ok(chosen.into_iter().map(|e| e.with_seeds(&self.seeds)).collect::<Result<_, _>>()?)
    }
}

/// The experiments of `experiments/` in this folder, if there is one; else those that are built in.
pub(super) fn known_experiments() -> Result<Vec<Experiment>> {
    let folder = PathBuf::from("experiments");
    Ok(if folder.is_dir() { Experiment::load_folder(&folder)? } else { Experiment::embedded_all() })
}

pub(super) fn profile(id: &str) -> Result<Profile, String> {
    Profile::preset(id).ok_or_else(|| format!("expected one of {}", Profile::IDS.join(", ")))
}

fn range(text: &str) -> Result<Range, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    match ends {
        Some([start, end]) if start < end => Ok(Range([start, end])),
        _ => Err("expected START..END with START < END, such as 0..10".to_owned()),
    }
}
