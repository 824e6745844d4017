//! Datasets of the registry, loaded.

use super::Dataset;
use skinsplat_data::Error;
use skinsplat_data::folder::{Options, Subject};
use skinsplat_synthetic as synthetic;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How much of a data set is there.
#[derive(Debug)]
pub enum Presence {
    /// Every subject can be loaded.
    Complete,
    /// Some folders are there. What is not there or cannot be loaded is a gap in tables.
    Partial {
        /// Subjects that the registry lists.
        subjects: usize,
        /// Folders of subjects that are not there.
        missing: Vec<PathBuf>,
        /// What is wrong with subjects that are there.
        broken: Vec<Error>,
    },
    /// No folder is there, or nothing reads them.
    Absent,
    /// The entry itself cannot be used.
    Broken(Error),
}

impl Dataset {
    /// Loads every subject; no image is decoded or generated.
    ///
    /// # Errors
    /// As [`Subject::load`]; generator parameters that are out of range.
    pub fn load(&self, options: &Options) -> Result<Vec<Subject>, Error> {
        self.subject_ids()?.iter().map(|id| self.load_one(id, options)).collect()
    }

    /// Ids of the subjects, in the order of [`Dataset::load`]; nothing is loaded.
    ///
    /// # Errors
    /// Generator parameters that are out of range.
    pub fn subject_ids(&self) -> Result<Vec<String>, Error> {
        if self.is_generated() {
            return Ok(self.generators()?.into_keys().collect());
        }
        if !self.subjects.is_empty() {
            return Ok(self.subjects.clone());
        }
        let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
        Ok(self.path.as_deref().map(|path| name(path).unwrap_or_default()).into_iter().collect())
    }

    /// How much of it a command would find. Loads every subject.
    pub fn presence(&self) -> Presence {
        if self.is_generated() {
            return self.subject_ids().map_or_else(Presence::Broken, |_| Presence::Complete);
        }
        if self.reader().is_none() || !self.is_begun() {
            return Presence::Absent;
        }
        let missing = self.missing_folders();
        let there = |(_, folder): &(String, PathBuf)| !missing.contains(folder);
        let ids = self.subject_ids().unwrap_or_default();
        let subjects = ids.len();
        let found = ids.into_iter().zip(self.subject_folders().unwrap_or_default()).filter(there);
        let broken: Vec<Error> =
            found.filter_map(|(id, _)| self.load_one(&id, &Options::default()).err()).collect();
        match missing.is_empty() && broken.is_empty() {
            true => Presence::Complete,
            false => Presence::Partial { subjects, missing, broken },
        }
    }

    /// Loads one of [`Dataset::subject_ids`].
    ///
    /// # Errors
    /// As [`Dataset::load`]; an id that is not one of them.
    pub fn load_one(&self, id: &str, options: &Options) -> Result<Subject, Error> {
        let ids = self.subject_ids()?;
        let absent = || {
            let path = self.path.as_deref().unwrap_or(Path::new(&self.id));
            Error::invalid(path, "subject", id.to_owned(), format!("one of {}", ids.join(", ")))
        };
        let place = ids.iter().position(|own| own == id).ok_or_else(absent)?;
        if self.is_generated() {
            let parameters = self.generators()?.remove(id).ok_or_else(absent)?;
            let made = synthetic::Subject::new(&parameters).map_err(|e| self.invalid_parameters(e))?;
            let (train, test) = (made.train(), made.test());
            return Ok(Subject {
                id: id.to_owned(),
                capture: parameters.capture,
                train,
                test,
                val: Vec::new(),
                notes: Vec::new(),
                doubts: Vec::new(),
                shapes: Vec::new(),
            });
        }
        let folder = self.subject_folders().and_then(|folders| folders.into_iter().nth(place));
        let folder = folder.ok_or_else(absent)?;
        if !folder.is_dir() {
            return Err(Error::invalid(folder, "subject", "no folder", format!("the folder of {id}")));
        }
        Ok(Subject { id: id.to_owned(), ..self.load_subject(&folder, options)? })
    }

    /// What the subjects of a synthetic dataset are made from: its parameters, or those that come with the program.
    fn generators(&self) -> Result<BTreeMap<String, synthetic::Parameters>, Error> {
        let own = self.parameters.to_string();
        let text = if self.parameters.is_empty() { synthetic::SUBJECTS } else { own.as_str() };
        synthetic::subjects(text).map_err(|e| self.invalid_parameters(e))
    }

    fn invalid_parameters(&self, cause: skinsplat_core::scene::SceneError) -> Error {
        Error::scene(Path::new(&format!("dataset {}, parameters", self.id)), cause)
    }
}
