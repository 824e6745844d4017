//! Which subjects the tables of a data set's entry speak of: `[dataset.splits]` and `[dataset.folders]`.

use super::Dataset;
use skinsplat_core::choice::one_of;
use skinsplat_data::layouts::Split;
use std::collections::BTreeMap;

/// What is wrong with a key: the field, the problem, what was expected.
pub(super) type Fault = (String, String, String);

impl Dataset {
    /// The frames that the entry gives a subject, if it does: under the subject's id, or under its folder's name.
    pub fn split_of(&self, subject: &str) -> Option<&Split> {
        let of_subject = |key: &&String| self.subject_meant(key) == Some(subject);
        self.splits.keys().find(of_subject).map(|key| &self.splits[key])
    }

    /// The first key that no subject answers to, or the second of one subject.
    pub(super) fn fault_of_keys(&self) -> Option<Fault> {
        let ids = self.listed_ids();
        let strange = |table: &str, key: &str, known: &[&str]| {
            (format!("{table}.{key:?}"), "no subject of this name".to_owned(), one_of(key, known))
        };
        if let Some(key) = self.folders.keys().find(|key| !ids.contains(&key.as_str())) {
            return Some(strange("folders", key, &ids));
        }
        let mut first_of: BTreeMap<&str, &str> = BTreeMap::new();
        for key in self.splits.keys() {
            let Some(subject) = self.subject_meant(key) else {
                let mut known = ids.clone();
                known.extend(self.folders.values().map(String::as_str).filter(|name| !ids.contains(name)));
                return Some(strange("splits", key, &known));
            };
            if let Some(other) = first_of.insert(subject, key) {
                let problem = format!("the subject of splits.{other:?} again");
                return Some((format!("splits.{key:?}"), problem, "one split per subject".to_owned()));
            }
        }
        None
    }

    /// The subject that a key means: by its id, else by its folder's name.
    fn subject_meant(&self, key: &str) -> Option<&str> {
        let ids = self.listed_ids();
        let by_folder = || ids.iter().find(|id| self.folders.get(**id).is_some_and(|name| name == key));
        ids.iter().find(|id| **id == key).or_else(by_folder).copied()
    }

    /// Ids of the subjects that lie in folders: those of the list, else the name of the only folder.
    fn listed_ids(&self) -> Vec<&str> {
        if !self.subjects.is_empty() {
            return self.subjects.iter().map(String::as_str).collect();
        }
        self.path.as_deref().and_then(|path| path.file_name()?.to_str()).into_iter().collect()
    }
}
