//! The data at hand: loaded subjects, and what the planner needs to know about them.

use super::Error;
use crate::experiment::{Dataset, FrameInfo, Role, SequenceInfo, SubjectInfo};
use rayon::prelude::*;
use skinsplat_data::{Sequence, Subject};

/// A data set whose subjects are loaded; no image is decoded.
#[derive(Debug)]
pub struct LoadedDataset {
    /// Id.
    pub id: String,
    /// Name for captions.
    pub title: String,
    /// Its subjects.
    pub subjects: Vec<Subject>,
}

/// Every data set of a run.
#[derive(Debug)]
pub struct Library {
    datasets: Vec<LoadedDataset>,
}

impl Library {
    /// A library of these data sets.
    pub fn new(datasets: Vec<LoadedDataset>) -> Self {
        Self { datasets }
    }

    /// What the planner needs: names, counts and content digests. Reads every file once, to digest it.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn describe(&self) -> Result<Vec<Dataset>, Error> {
        let describe = |dataset: &LoadedDataset| {
            let subjects = dataset.subjects.iter().map(describe_subject).collect::<Result<_, _>>()?;
            Ok(Dataset { id: dataset.id.clone(), title: dataset.title.clone(), subjects })
        };
        self.datasets.iter().map(describe).collect()
    }

    /// A sequence by the names that the plan uses.
    ///
    /// # Errors
    /// If there is none: the plan was made from other data.
    pub fn sequence(&self, dataset: &str, subject: &str, sequence: &str) -> Result<&Sequence, Error> {
        let find = || {
            let dataset = self.datasets.iter().find(|d| d.id == dataset)?;
            dataset.subjects.iter().find(|s| s.id == subject)?.sequence(sequence)
        };
        find().ok_or_else(|| Error::Absent { name: format!("{dataset}/{subject}/{sequence}") })
    }
}

fn describe_subject(subject: &Subject) -> Result<SubjectInfo, skinsplat_data::Error> {
    let roles =
        subject.train.iter().map(|s| (s, Role::Train)).chain(subject.test.iter().map(|s| (s, Role::Test)));
    let sequences: Vec<(&Sequence, Role)> = roles.collect();
    let describe = |&(sequence, role): &(&Sequence, Role)| {
        let frame =
            |f: &skinsplat_data::FrameRef| FrameInfo { name: f.name.clone(), time: f.pose, camera: f.camera };
        let digest = sequence.digest()?;
        let frames = sequence.frames.iter().map(frame).collect();
        Ok(SequenceInfo { id: sequence.id.clone(), role, digest, frames })
    };
    let sequences = sequences.par_iter().map(describe).collect::<Result<_, skinsplat_data::Error>>()?;
    Ok(SubjectInfo { id: subject.id.clone(), capture: subject.capture, sequences, avatars: Vec::new() })
}
