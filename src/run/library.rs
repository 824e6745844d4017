//! The data at hand: loaded subjects, and what the planner needs to know about them.

use super::drawable::Drawable;
use super::{Error, renders};
use crate::experiment::{
    AvatarFile, AvatarState, Dataset, FrameInfo, Role, SequenceInfo, SubjectInfo, Unreadable,
};
use rayon::prelude::*;
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::select::{each_once, evenly_spaced};
use skinsplat_data::{FrameSource, Sequence, Subject};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A data set whose subjects are loaded; no image is decoded.
#[derive(Debug)]
pub struct LoadedDataset {
    /// Id.
    pub id: String,
    /// Name for captions.
    pub title: String,
    /// Its subjects.
    pub subjects: Vec<Subject>,
    /// Avatars that somebody else made of them.
    pub avatars: Vec<RegisteredAvatar>,
    /// Ids of the subjects for which the registry says which frames are for what.
    pub splits_given: BTreeSet<String>,
    /// Subjects that cannot be used.
    pub unreadable: Vec<Unreadable>,
}

/// Avatars that somebody else made, one per subject.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegisteredAvatar {
    /// Name that experiments use.
    pub name: String,
    /// Where they are; `{subject}` stands for the id of the subject.
    pub path: PathBuf,
}

impl RegisteredAvatar {
    /// Where the avatar of a subject is.
    pub fn of_subject(&self, subject: &str) -> PathBuf {
        match self.path.to_str() {
            Some(path) => path.replace("{subject}", subject).into(),
            None => self.path.clone(),
        }
    }
}

/// Every data set of a run.
#[derive(Debug)]
pub struct Library {
    datasets: Vec<LoadedDataset>,
    /// Where renders of other programs are.
    renders: Vec<PathBuf>,
}

impl Library {
    /// A library of these data sets.
    pub fn new(datasets: Vec<LoadedDataset>) -> Self {
        Self { datasets, renders: Vec::new() }
    }

    /// Registers an avatar of every subject, besides those of its data set.
    pub fn register(&mut self, avatar: &RegisteredAvatar) {
        self.datasets.iter_mut().for_each(|dataset| dataset.avatars.push(avatar.clone()));
    }

    /// Looks for renders of every test sequence in a folder, as an experiment names it.
    pub fn look_for_renders(&mut self, path: &Path) {
        if !self.renders.iter().any(|known| known == path) {
            self.renders.push(path.to_owned());
        }
    }

    /// Subjects that cannot be used, each with its data set.
    pub fn unreadable(&self) -> impl Iterator<Item = (&str, &Unreadable)> {
        self.datasets
            .iter()
            .flat_map(|dataset| dataset.unreadable.iter().map(|own| (dataset.id.as_str(), own)))
    }

    /// What the planner needs: names, counts and content digests. Reads every file once, to digest it, and binds every
    /// registered avatar to its subject's body: one that cannot be bound is described as such, with the reason.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn describe(&self) -> Result<Vec<Dataset>, Error> {
        let describe = |dataset: &LoadedDataset| {
            let describe = |subject| describe_subject(subject, dataset, &self.renders);
            let subjects = dataset.subjects.iter().map(describe).collect::<Result<_, _>>()?;
            let (id, title) = (dataset.id.clone(), dataset.title.clone());
            Ok(Dataset { id, title, subjects, unreadable: dataset.unreadable.clone() })
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

fn describe_subject(
    subject: &Subject,
    dataset: &LoadedDataset,
    renders: &[PathBuf],
) -> Result<SubjectInfo, skinsplat_data::Error> {
    let parts = [(&subject.train, Role::Train), (&subject.test, Role::Test), (&subject.val, Role::Val)];
    let sequences: Vec<(&Sequence, Role)> =
        parts.into_iter().flat_map(|(part, role)| part.iter().map(move |s| (s, role))).collect();
    let describe = |&(sequence, role): &(&Sequence, Role)| {
        let frame =
            |f: &skinsplat_data::FrameRef| FrameInfo { name: f.name.clone(), time: f.time, camera: f.camera };
        let digest = sequence.digest()?;
        let frames = sequence.frames.iter().map(frame).collect();
        Ok(SequenceInfo { id: sequence.id.clone(), role, digest, frames, image: largest_image(sequence) })
    };
    let sequences = sequences.par_iter().map(describe).collect::<Result<_, skinsplat_data::Error>>()?;
    let avatars = dataset.avatars.iter().map(|avatar| describe_avatar(avatar, subject)).collect();
    let places = renders.iter().flat_map(|path| subject.test.iter().map(move |sequence| (path, sequence)));
    let renders = places.map(|(path, sequence)| renders::describe(path, &subject.id, sequence));
    let renders = renders.collect::<Result<_, _>>()?;
    let split_given = dataset.splits_given.contains(&subject.id);
    let notes = subject_notes(subject);
    let (id, capture) = (subject.id.clone(), subject.capture);
    Ok(SubjectInfo { id, capture, sequences, split_given, notes, avatars, renders })
}

/// What a reader of numbers has to know of a subject: what its files say or lack, and what a quick look finds.
pub fn subject_notes(subject: &Subject) -> Vec<String> {
    let mut notes = subject.notes.clone();
    // Some findings are notes already.
    let own =
        skinsplat_check::subject(subject).into_iter().filter(|found| !subject.notes.contains(&found.detail));
    notes.extend(own.map(|found| format!("check finds {}", found.kind)));
    notes.extend(subject.sequences().flat_map(misfits));
    each_once(notes)
}

/// Width and height of the largest image of a sequence.
fn largest_image(sequence: &Sequence) -> Option<[u32; 2]> {
    let sizes = sequence.cameras.iter().map(|camera| [camera.width, camera.height]);
    sizes.max_by_key(|[width, height]| u64::from(*width) * u64::from(*height))
}

/// Frames of a sequence that are looked at before a run.
const LOOKS: usize = 8;

/// What a quick look at a sequence finds; `reproduce check` looks at all of it. What is generated fits itself.
fn misfits(sequence: &Sequence) -> Vec<String> {
    let stored = |frame: &skinsplat_data::FrameRef| matches!(frame.source, FrameSource::Files(_));
    if !sequence.frames.iter().any(stored) {
        return Vec::new();
    }
    let all: Vec<usize> = (0..sequence.frames.len()).collect();
    let (_, findings) = skinsplat_check::sequence(sequence, &evenly_spaced(&all, Some(LOOKS)));
    findings.iter().map(|found| format!("check finds {} in {}", found.kind, sequence.id)).collect()
}

/// What is where the avatar of a subject should be.
fn describe_avatar(avatar: &RegisteredAvatar, subject: &Subject) -> AvatarFile {
    let path = avatar.of_subject(&subject.id);
    let state = match path.exists() {
        false => AvatarState::Absent,
        true => {
            present(&path, subject).unwrap_or_else(|error| AvatarState::Broken { problem: error.to_string() })
        }
    };
    AvatarFile { name: avatar.name.clone(), path, state }
}

fn present(path: &Path, subject: &Subject) -> Result<AvatarState, Error> {
    let no_body = || Error::Absent { name: format!("{}: a sequence with a body", subject.id) };
    let body = &subject.sequences().next().ok_or_else(no_body)?.body;
    let (_, notes) = Drawable::read(path, body)?;
    Ok(AvatarState::Present { digest: read_avatar(path)?.digest()?, notes })
}
