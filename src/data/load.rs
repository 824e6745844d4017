//! Datasets of the registry, loaded.

use super::folder::{Options, Subject};
use super::registry::{Dataset, Layout};
use super::{Error, synthetic};
use std::path::Path;

impl Dataset {
    /// Loads every subject; no image is decoded or generated.
    ///
    /// # Errors
    /// As [`Subject::load`]; generator parameters that are out of range.
    pub fn load(&self, options: &Options) -> Result<Vec<Subject>, Error> {
        if self.layout == Layout::Synthetic {
            return self.generate();
        }
        let folders = self.subject_folders().unwrap_or_default();
        let mut subjects =
            folders.iter().map(|f| self.load_subject(f, options)).collect::<Result<Vec<_>, _>>()?;
        for (subject, id) in subjects.iter_mut().zip(&self.subjects) {
            subject.id.clone_from(id);
        }
        Ok(subjects)
    }

    /// The subjects of a synthetic dataset: those of its parameters, or those that come with the program.
    fn generate(&self) -> Result<Vec<Subject>, Error> {
        let own = self.parameters.to_string();
        let text = if self.parameters.is_empty() { synthetic::SUBJECTS } else { own.as_str() };
        let invalid = |e| Error::scene(Path::new(&format!("dataset {}, parameters", self.id)), e);
        let subject = |(id, parameters): (String, synthetic::Parameters)| {
            let made = synthetic::Subject::new(&parameters).map_err(invalid)?;
            let capture = parameters.capture;
            Ok(Subject { id, capture, train: made.train(), test: made.test() })
        };
        synthetic::subjects(text).map_err(invalid)?.into_iter().map(subject).collect()
    }
}
