//! Which data a command looks at.

use anyhow::{Result, bail};
use skinsplat::datasets::{Dataset, Registry};
use skinsplat::experiment::{AvatarRecipe, Experiment, Unreadable};
use skinsplat::run::{Library, LoadedDataset, RegisteredAvatar};
use skinsplat_core::choice::one_of;
use skinsplat_data::folder::Options;
use skinsplat_data::{Error, Gender, Subject};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The registry of a folder.
const LOCAL: &str = "datasets.toml";
/// The environment variable that names a registry.
const VARIABLE: &str = "REPRODUCE_DATASETS";

/// Where data comes from.
#[derive(Debug, Default, clap::Args)]
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
            [] => bail!("subject `{name}`; expected {}", one_of(name, &known)),
            _ => bail!("subject `{name}` is in several data sets; expected DATASET/SUBJECT"),
        }
    }

    /// Every subject of a data set, one of them by `DATASET/SUBJECT`, or every subject that is there; each as
    /// `DATASET/SUBJECT`, or why it cannot be loaded.
    pub(super) fn subjects(&self, name: Option<&str>) -> Result<Vec<(String, Result<Subject, Error>)>> {
        let registry = self.registry()?;
        let (dataset, subject) = match name.map(|name| name.split_once('/').unwrap_or((name, ""))) {
            Some((dataset, subject)) => (Some(dataset), Some(subject).filter(|subject| !subject.is_empty())),
            None => (None, None),
        };
        let mut found = Vec::new();
        for dataset in wanted(&registry, dataset)? {
            let ids = dataset.subject_ids()?;
            if let Some(subject) = subject
                && !ids.iter().any(|id| id == subject)
            {
                bail!("{}: no subject `{subject}`; expected {}", dataset.id, one_of(subject, &ids));
            }
            for id in ids.iter().filter(|id| subject.is_none_or(|subject| *id == subject)) {
                found.push((format!("{}/{id}", dataset.id), dataset.load_one(id, &self.options())));
            }
        }
        Ok(found)
    }

    /// `DATASET/SUBJECT` with the body of each gender of which there is one.
    pub(super) fn in_genders(&self, name: &str) -> Vec<(Gender, Subject)> {
        let Some((dataset, subject)) = name.split_once('/') else { return Vec::new() };
        let Ok(registry) = self.registry() else { return Vec::new() };
        let dataset =
            registry.datasets.iter().find(|candidate| candidate.id == dataset && !candidate.is_generated());
        let load = |gender| {
            let options = Options { gender: Some(gender), ..self.options() };
            Some((gender, dataset?.load_one(subject, &options).ok()?))
        };
        Gender::ALL.into_iter().filter_map(load).collect()
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
        Options { clothing: self.clothing, ..Options::default() }
    }

    /// Loads the subjects of a data set, and which of its avatars the experiments name; on the bodies that one of them asks
    /// for, if it is given. A subject that cannot be loaded does not keep the others from being used.
    fn load(
        &self,
        dataset: &Dataset,
        experiments: &[Experiment],
        asking: Option<&Experiment>,
        left_out: &BTreeSet<String>,
    ) -> Result<LoadedDataset> {
        let (mut subjects, mut unreadable) = (Vec::new(), Vec::new());
        for id in dataset.subject_ids()?.into_iter().filter(|id| !left_out.contains(id)) {
            let gender = asking.and_then(|experiment| experiment.genders.get(&id)).copied();
            match dataset.load_one(&id, &Options { gender, ..self.options() }) {
                Ok(subject) => subjects.push(subject),
                Err(error) => unreadable.push(Unreadable { subject: id, problem: error.to_string() }),
            }
        }
        let named = |wanted: &str| {
            let recipes = experiments.iter().flat_map(|e| &e.variants).map(|variant| &variant.avatar);
            recipes.into_iter().any(|r| matches!(r, AvatarRecipe::File { name, .. } if name == wanted))
        };
        let avatars = dataset.avatars.iter().filter(|avatar| named(&avatar.name));
        let avatars = avatars.map(|a| RegisteredAvatar { name: a.name.clone(), path: a.path.clone() });
        let id = asking.map_or_else(|| dataset.id.clone(), Experiment::data_id);
        let title = dataset.title.clone();
        let splits_given =
            dataset.subject_ids()?.into_iter().filter(|id| dataset.split_of(id).is_some()).collect();
        Ok(LoadedDataset { id, title, subjects, avatars: avatars.collect(), splits_given, unreadable })
    }

    /// Loads what the experiments can use: their own datasets, and those that may stand in. Figures that nobody `asked` for are not
    /// generated.
    pub(super) fn library(&self, experiments: &[Experiment], asked: &[String]) -> Result<Library> {
        let own = |id: &str| experiments.iter().any(|experiment| experiment.data_id() == id);
        let stands_in = experiments.iter().any(|experiment| experiment.stand_in.is_some());
        let named = |d: &Dataset| own(&d.id) && d.is_begun();
        let wanted = |d: &Dataset| named(d) || (stands_in && d.stand_in && d.is_available());
        let registry = self.registry()?;
        let mut known = BTreeSet::new();
        for dataset in registry.datasets.iter().filter(|dataset| wanted(dataset)) {
            known.extend(dataset.subject_ids()?);
        }
        // An error about a name that is nobody's lists all that there are.
        let some_asked = !asked.is_empty() && asked.iter().all(|id| known.contains(id));
        let mut loaded: Vec<LoadedDataset> = Vec::new();
        for dataset in &registry.datasets {
            if wanted(dataset) {
                let skip = some_asked && !own(&dataset.id);
                let left_out = if skip { not_asked(dataset, asked)? } else { BTreeSet::new() };
                loaded.push(self.load(dataset, experiments, None, &left_out)?);
            }
            let asking =
                |e: &&Experiment| e.has_own_bodies() && e.dataset == dataset.id && dataset.is_begun();
            for experiment in experiments.iter().filter(asking) {
                loaded.push(self.load(dataset, experiments, Some(experiment), &BTreeSet::new())?);
            }
        }
        let mut broken = loaded.iter().flat_map(|dataset| &dataset.unreadable);
        if loaded.iter().all(|dataset| dataset.subjects.is_empty())
            && let Some(Unreadable { problem, .. }) = broken.next()
        {
            bail!("{problem}");
        }
        let mut library = Library::new(loaded);
        for variant in experiments.iter().flat_map(|experiment| &experiment.variants) {
            if let AvatarRecipe::Renders { path } = &variant.avatar {
                library.look_for_renders(path);
            }
        }
        Ok(library)
    }
}

/// The figures of a generated data set that are not among the subjects asked for.
fn not_asked(dataset: &Dataset, asked: &[String]) -> Result<BTreeSet<String>> {
    let ids = if dataset.is_generated() { dataset.subject_ids()? } else { Vec::new() };
    Ok(ids.into_iter().filter(|id| !asked.contains(id)).collect())
}

/// Every data set that is there, or the one of this id.
fn wanted<'r>(registry: &'r Registry, id: Option<&str>) -> Result<Vec<&'r Dataset>> {
    let Some(id) = id else {
        return Ok(registry.datasets.iter().filter(|dataset| dataset.is_available()).collect());
    };
    let Some(dataset) = registry.datasets.iter().find(|dataset| dataset.id == id) else {
        let known: Vec<&str> = registry.datasets.iter().map(|dataset| dataset.id.as_str()).collect();
        bail!("data set `{id}`; expected {}", one_of(id, &known));
    };
    Ok(vec![dataset])
}
