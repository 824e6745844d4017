//! `datasets.toml`: which datasets exist, where they lie, under which licence.

mod keys;
mod load;

pub use load::Presence;

use crate::toml_problem::TomlProblem;
use serde::{Deserialize, Serialize};
use skinsplat_core::choice::one_of;
use skinsplat_data::folder::{self, Options, Subject};
use skinsplat_data::layouts::{LAYOUTS, Layout, Request, Split};
use skinsplat_data::{Capture, Error, error};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// Every dataset that experiments can name.
#[derive(Clone, Debug, PartialEq)]
pub struct Registry {
    /// The datasets, in the order of the file.
    pub datasets: Vec<Dataset>,
    path: PathBuf,
}

/// One dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dataset {
    /// What experiments call it.
    pub id: String,
    /// What tables call it.
    pub title: String,
    /// How it is stored: `synthetic`, or the id of one of [`LAYOUTS`].
    #[serde(deserialize_with = "known_layout")]
    pub layout: String,
    /// How its subjects were captured.
    pub capture: Capture,
    /// Terms of use.
    pub licence: String,
    /// Who made it, and how.
    pub provenance: String,
    /// Where it is to be had.
    #[serde(default)]
    pub url: Option<String>,
    /// A subject, or a folder that holds the subjects. After loading relative to the current folder, or absolute.
    #[serde(default)]
    pub path: Option<PathBuf>,
    /// Body model for layouts that do not bring one. After loading as `path`.
    #[serde(default)]
    pub model: Option<PathBuf>,
    /// Whether its subjects may stand in for those of a dataset that is not here.
    #[serde(default = "yes")]
    pub stand_in: bool,
    /// Ids of the subjects, which are their folders' names unless `folders` says otherwise; empty if `path` is the only
    /// subject.
    #[serde(default)]
    pub subjects: Vec<String>,
    /// Folder names of subjects that experiments call otherwise.
    #[serde(default)]
    pub folders: BTreeMap<String, String>,
    /// Frames to train and test on, by subject (its id or its folder's name), for layouts that do not say.
    #[serde(default)]
    pub splits: BTreeMap<String, Split>,
    /// What the generator of a synthetic dataset is given.
    #[serde(default)]
    pub parameters: toml::Table,
    /// Avatars that somebody else made of its subjects.
    #[serde(default)]
    pub avatars: Vec<AvatarEntry>,
}

/// Avatars that somebody else made, one per subject that has one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvatarEntry {
    /// Name by which experiments ask for it.
    pub name: String,
    /// The file, or the folder of an export; `{subject}` stands for the id of the subject. After loading as
    /// [`Dataset::path`].
    pub path: PathBuf,
}

/// The default of [`Dataset::stand_in`].
fn yes() -> bool {
    true
}

/// The layout of data sets that are generated in-process.
const GENERATED: &str = "synthetic";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    dataset: Vec<Dataset>,
}

const EMBEDDED: &str = include_str!("../../datasets.toml");

impl Registry {
    /// The registry that the program was built with. Its paths are relative to the current folder: what is not there is
    /// not available, and what is generated always is.
    pub fn embedded() -> Self {
        Self::parse(EMBEDDED, Path::new("datasets.toml")).expect("a test parses the embedded registry")
    }

    /// Loads a `datasets.toml`; paths in it are relative to its folder.
    ///
    /// # Errors
    /// An unreadable file, unknown or missing keys, two datasets of one id, a path that leaves out its subjects, splits or folders
    /// of nobody.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Self::parse(&error::read_text(path, "registry", "a datasets.toml")?, path)
    }

    /// Makes a registry of a folder: a subject, a folder of subjects, or a folder with `datasets/` in it.
    ///
    /// # Errors
    /// If no subject is found, or one that is found cannot be inspected.
    pub fn scan(root: &Path) -> Result<Self, Error> {
        let inner = root.join("datasets");
        let parent = if inner.is_dir() { inner } else { root.to_owned() };
        let folders = if folder::is_subject(&parent) { vec![parent.clone()] } else { subfolders(&parent)? };
        let subjects = folders.iter().filter(|folder| folder::is_subject(folder));
        let datasets = subjects.map(|folder| found(folder)).collect::<Result<Vec<_>, _>>()?;
        if datasets.is_empty() {
            let expected = "subjects: folders with sequences train* and test*, each with transforms.json";
            return Err(Error::invalid(root, "datasets", "none", expected));
        }
        Ok(Self { datasets, path: root.to_owned() })
    }

    /// A dataset by id.
    ///
    /// # Errors
    /// If there is none; the message lists the known ids.
    pub fn get(&self, id: &str) -> Result<&Dataset, Error> {
        self.datasets.iter().find(|d| d.id == id).ok_or_else(|| {
            let ids: Vec<&str> = self.datasets.iter().map(|d| d.id.as_str()).collect();
            Error::invalid(&self.path, "dataset", format!("no id {id:?}"), one_of(id, &ids))
        })
    }

    fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let malformed = |error: toml::de::Error| {
            let TomlProblem { line, problem, expected, .. } = TomlProblem::of(text, &error);
            let expected = expected.unwrap_or_else(|| "a [[dataset]] table".to_owned());
            Error::invalid(path, format!("line {line}"), problem, expected)
        };
        let File { dataset: mut datasets } = toml::from_str(text).map_err(malformed)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut ids = BTreeSet::new();
        for (i, dataset) in datasets.iter_mut().enumerate() {
            let invalid = |field: &str, problem: String, expected: &str| {
                Error::invalid(path, format!("dataset[{i}].{field}"), problem, expected)
            };
            if !ids.insert(dataset.id.clone()) {
                return Err(invalid("id", format!("{:?} again", dataset.id), "an id of its own"));
            }
            if !is_folder_name(&dataset.id) {
                let expected = "a name that a folder could have";
                return Err(invalid("id", format!("the path {:?}", dataset.id), expected));
            }
            let names = dataset.subjects.iter().chain(dataset.folders.values());
            if let Some(name) = names.into_iter().find(|name| !is_folder_name(name)) {
                return Err(invalid(
                    "subjects",
                    format!("the path {name:?}"),
                    "names of folders inside path",
                ));
            }
            let mut seen = BTreeSet::new();
            if let Some(twice) = dataset.subjects.iter().find(|name| !seen.insert(name.as_str())) {
                return Err(invalid("subjects", format!("{twice:?} again"), "each subject once"));
            }
            if let Some((field, problem, expected)) = dataset.fault_of_keys() {
                return Err(invalid(&field, problem, &expected));
            }
            let names: BTreeSet<&str> = dataset.avatars.iter().map(|avatar| avatar.name.as_str()).collect();
            if names.len() < dataset.avatars.len() || names.contains("") {
                return Err(invalid("avatars", "names that repeat or are empty".into(), "a name for each"));
            }
            let avatars = dataset.avatars.iter_mut().map(|avatar| &mut avatar.path);
            let places = [&mut dataset.path, &mut dataset.model].into_iter().flatten();
            places.chain(avatars).for_each(|place| *place = folder.join(&*place));
        }
        Ok(Self { datasets, path: path.to_owned() })
    }
}

/// True for a name that leads one folder down and nowhere else.
fn is_folder_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name)
}

impl Dataset {
    /// True if its subjects are generated in-process.
    pub fn is_generated(&self) -> bool {
        self.layout == GENERATED
    }

    /// What reads its subjects; none if they are generated.
    pub fn reader(&self) -> Option<&'static Layout> {
        Layout::named(&self.layout)
    }

    /// True if the data is there: always if it is generated, else if its layout is read and the folder of every subject
    /// exists.
    pub fn is_available(&self) -> bool {
        self.is_generated() || (self.reader().is_some() && self.is_present())
    }

    /// True if the folder of every subject exists, whether or not anything reads it.
    pub fn is_present(&self) -> bool {
        self.subject_folders().is_some_and(|folders| folders.iter().all(|folder| folder.is_dir()))
    }

    /// True if the folder of at least one subject exists and its layout is read.
    pub fn is_begun(&self) -> bool {
        let some =
            || self.subject_folders().is_some_and(|folders| folders.iter().any(|folder| folder.is_dir()));
        self.is_generated() || (self.reader().is_some() && some())
    }

    /// The folders of subjects that are not there.
    pub fn missing_folders(&self) -> Vec<PathBuf> {
        self.subject_folders().unwrap_or_default().into_iter().filter(|folder| !folder.is_dir()).collect()
    }

    /// The subjects' folders; `None` without a path.
    pub fn subject_folders(&self) -> Option<Vec<PathBuf>> {
        let path = self.path.as_ref()?;
        Some(match self.subjects.is_empty() {
            true => vec![path.clone()],
            false => {
                let folder = |subject| path.join(self.folders.get(subject).unwrap_or(subject));
                self.subjects.iter().map(folder).collect()
            }
        })
    }

    /// Loads a subject from one of [`Dataset::subject_folders`]; no image is decoded.
    ///
    /// # Errors
    /// As [`Subject::load`]; a layout that is not read from files.
    pub fn load_subject(&self, folder: &Path, options: &Options) -> Result<Subject, Error> {
        let mut options = options.clone();
        options.model = options.model.or_else(|| self.model.clone());
        let Some(reader) = self.reader() else {
            let known: Vec<&str> = LAYOUTS.iter().map(|layout| layout.id).collect();
            let expected = format!("{} (convert the data first)", known.join(" or "));
            return Err(Error::invalid(folder, "layout", format!("no reader for {}", self.layout), expected));
        };
        let place = self.subject_folders().unwrap_or_default().iter().position(|own| own == folder);
        let id = place.and_then(|place| self.subject_ids().ok()?.into_iter().nth(place));
        let split = id.and_then(|id| self.split_of(&id));
        (reader.load)(&Request { folder, split, options: &options })
    }
}

/// A layout that something reads.
fn known_layout<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let id = String::deserialize(deserializer)?;
    let known = || [GENERATED].into_iter().chain(LAYOUTS.iter().map(|layout| layout.id));
    if known().any(|known| known == id) {
        return Ok(id);
    }
    let known: Vec<&str> = known().collect();
    Err(serde::de::Error::custom(format!("layout: {id:?}; expected one of {}", known.join(", "))))
}

fn found(folder: &Path) -> Result<Dataset, Error> {
    let id = folder.file_name().map_or_else(|| "dataset".into(), |name| name.to_string_lossy().into_owned());
    Ok(Dataset {
        title: id.clone(),
        id,
        layout: "folder".to_owned(),
        capture: folder::inspect(folder)?,
        licence: "see the data".to_owned(),
        provenance: "found by scanning a folder".to_owned(),
        url: None,
        path: Some(folder.to_owned()),
        model: None,
        stand_in: true,
        subjects: Vec::new(),
        folders: BTreeMap::new(),
        splits: BTreeMap::new(),
        parameters: toml::Table::new(),
        avatars: Vec::new(),
    })
}

fn subfolders(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let entries = std::fs::read_dir(folder)
        .map_err(|cause| Error::read(folder, "datasets", "a folder of subjects", cause))?;
    let mut folders: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir()).collect();
    folders.sort();
    Ok(folders)
}
