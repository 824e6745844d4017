//! Which data a command looks at.

use crate::datasets::{Dataset, Registry};
use crate::experiment::{AvatarRecipe, Experiment};
use crate::run::{Library, LoadedDataset, RegisteredAvatar};
use anyhow::{Result, bail};
use skinsplat_data::Subject;
use skinsplat_data::folder::Options;
use std::path::{Path, PathBuf};

/// The registry of a folder.
const LOCAL: &str = "datasets.toml";
/// The environment variable that names a registry.
const VARIABLE: &str = "REPRODUCE_DATASETS";

/// Where data comes from.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Data")]
pub(super) struct Data {
    /// Run on the subjects of this folder: a subject, a folder of subjects, or a folder with datasets/ in it
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Registry of datasets [default: the file that REPRODUCE_DATASETS names, else datasets.toml in this folder, else the
    /// built-in registry]
    #[arg(long, value_name = "FILE", conflicts_with = "data")]
    datasets: Option<PathBuf>,
    /// Displace bodies by the clothing that a subject's gt_normal_offset.npy holds
    #[arg(long)]
    clothing: bool,
}

impl Data {
    /// The registry that the arguments name.
    pub(super) fn registry(&self) -> Result<Registry> {
        if let Some(folder) = &self.data {
            return Ok(Registry::scan(folder)?);
        }
        let local = || Path::new(LOCAL).is_file().then(|| LOCAL.into());
        let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
        Ok(match self.datasets.clone().or(named).or_else(local) {
            Some(file) => Registry::load(&file)?,
            None => Registry::embedded(),
        })
    }

    /// True if a folder or a registry was named.
    pub(super) fn is_given(&self) -> bool {
        self.data.is_some() || self.datasets.is_some()
    }

    /// A subject by `DATASET/SUBJECT` or by its own id alone, and the id of its data set. No other is loaded.
    pub(super) fn subject(&self, name: &str) -> Result<(String, Subject)> {
        let (dataset, subject) = match name.split_once('/') {
            Some((dataset, subject)) => (Some(dataset), subject),
            None => (None, name),
        };
        let registry = self.registry()?;
        let mut known = Vec::new();
        let mut found = Vec::new();
        for candidate in wanted(&registry, dataset)? {
            for id in candidate.subject_ids()? {
                known.push(format!("{}/{id}", candidate.id));
                if id == subject {
                    found.push(candidate);
                }
            }
        }
        match found.as_slice() {
            [dataset] => Ok((dataset.id.clone(), dataset.load_one(subject, &self.options())?)),
            [] => bail!("subject `{name}`; expected one of {}", known.join(", ")),
            _ => bail!("subject `{name}` is in several data sets; expected DATASET/SUBJECT"),
        }
    }

    /// `DATASET/SUBJECT` of the first subject that is there.
    pub(super) fn first_subject(&self) -> Result<Option<String>> {
        for dataset in wanted(&self.registry()?, None)? {
            if let Some(id) = dataset.subject_ids()?.first() {
                return Ok(Some(format!("{}/{id}", dataset.id)));
            }
        }
        Ok(None)
    }

    fn options(&self) -> Options {
        Options { model: None, clothing: self.clothing }
    }

    /// Loads the subjects of a data set, and which of its avatars the experiments name.
    fn load(&self, dataset: &Dataset, experiments: &[Experiment]) -> Result<LoadedDataset> {
        let subjects = dataset.load(&self.options())?;
        let named = |wanted: &str| {
            let recipes = experiments.iter().flat_map(|e| &e.variants).map(|variant| &variant.avatar);
            recipes.into_iter().any(|r| matches!(r, AvatarRecipe::File { name, .. } if name == wanted))
        };
        let avatars = dataset.avatars.iter().filter(|avatar| named(&avatar.name));
        let avatars = avatars.map(|a| RegisteredAvatar { name: a.name.clone(), path: a.path.clone() });
        let (id, title) = (dataset.id.clone(), dataset.title.clone());
        Ok(LoadedDataset { id, title, subjects, avatars: avatars.collect() })
    }

    /// Loads what the experiments can use: their own datasets, and those that may stand in.
    pub(super) fn library(&self, experiments: &[Experiment]) -> Result<Library> {
        let own = |id: &str| experiments.iter().any(|experiment| experiment.dataset == id);
        let stands_in = experiments.iter().any(|experiment| experiment.stand_in.is_some());
        // One that is there and that nothing reads is an error where a table asks for it, and no stand-in.
        let named = |d: &Dataset| own(&d.id) && (d.is_available() || d.is_present());
        let wanted = |d: &&Dataset| named(d) || (stands_in && d.stand_in && d.is_available());
        let registry = self.registry()?;
        let loaded = registry.datasets.iter().filter(wanted).map(|dataset| self.load(dataset, experiments));
        Ok(Library::new(loaded.collect::<Result<_>>()?))
    }
}

/// Every data set that is there, or the one of this id.
fn wanted<'r>(registry: &'r Registry, id: Option<&str>) -> Result<Vec<&'r Dataset>> {
    let Some(id) = id else {
        return Ok(registry.datasets.iter().filter(|dataset| dataset.is_available()).collect());
    };
    let Some(dataset) = registry.datasets.iter().find(|dataset| dataset.id == id) else {
        let known: Vec<&str> = registry.datasets.iter().map(|dataset| dataset.id.as_str()).collect();
        bail!("data set `{id}`; expected one of {}", known.join(", "));
    };
    Ok(vec![dataset])
}
