//! What the planner knows about data: names, counts and digests, no pixels.

use serde::{Deserialize, Serialize};
use skinsplat_data::Capture;
use std::path::PathBuf;

/// The part that a sequence plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Avatars are made from it.
    Train,
    /// Renders are scored against it.
    Test,
    /// Both: the experiment's split says which frames are which.
    Whole,
}

/// One image: a point in time seen by a camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameInfo {
    /// Name of the image, unique in its sequence: records and reports use it.
    pub name: String,
    /// Time step: the number that a split's ranges count.
    pub time: usize,
    /// Camera index.
    pub camera: usize,
}

/// A sequence of frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SequenceInfo {
    /// Id, unique within its subject.
    pub id: String,
    /// Train, test, or split by the experiment.
    pub role: Role,
    /// Digest of everything the sequence holds: images, masks, cameras, poses and the body they move.
    pub digest: String,
    /// The frames, in the order in which the loader numbers them.
    pub frames: Vec<FrameInfo>,
}

/// A person (or figure) and the sequences in which it was seen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubjectInfo {
    /// Id, unique within its data set.
    pub id: String,
    /// How it was captured.
    pub capture: Capture,
    /// Its sequences.
    pub sequences: Vec<SequenceInfo>,
    /// Avatars that are registered for it.
    #[serde(default)]
    pub avatars: Vec<AvatarFile>,
}

/// An avatar that was fitted elsewhere.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AvatarFile {
    /// Name that experiments use, unique in its subject.
    pub name: String,
    /// The file, or the folder of an export. No key depends on it.
    pub path: PathBuf,
    /// What was found there.
    pub state: AvatarState,
}

/// What was found where an avatar should be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AvatarState {
    /// An avatar that fits the subject's body.
    Present {
        /// Digest of its files.
        digest: String,
        /// What a reader of a table has to know of it, such as where its skinning weights come from.
        notes: Vec<String>,
    },
    /// Nothing.
    Absent,
    /// Something that cannot be used.
    Broken {
        /// File, field and expectation, one line.
        problem: String,
    },
}

/// A data set that is present on this machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dataset {
    /// Id, unique among the data sets given to one plan; a real data set carries the id that experiments name.
    pub id: String,
    /// Name for captions.
    pub title: String,
    /// Its subjects.
    pub subjects: Vec<SubjectInfo>,
}
