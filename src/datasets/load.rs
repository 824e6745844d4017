//! Datasets of the registry, loaded.

use super::Dataset;
use skinsplat_data::Error;
use skinsplat_data::folder::{Options, Subject};
use skinsplat_synthetic as synthetic;
use std::collections::BTreeMap;
use std::path::Path;

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

    /// Why a subject cannot be loaded: the first such reason.
    pub fn first_problem(&self) -> Option<Error> {
        let ids = match self.subject_ids() {
            Ok(ids) => ids,
            Err(problem) => return Some(problem),
        };
        let read = ids.iter().filter(|_| !self.is_generated());
        read.map(|id| self.load_one(id, &Options::default())).find_map(Result::err)
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
                notes: Vec::new(),
                shapes: Vec::new(),
            });
        }
        let folder = self.subject_folders().and_then(|folders| folders.into_iter().nth(place));
        Ok(Subject { id: id.to_owned(), ..self.load_subject(&folder.ok_or_else(absent)?, options)? })
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
