//! What the planner knows about data: names, counts and digests, no pixels.

use super::spec::OWN_BODIES;
use serde::{Deserialize, Serialize};
use skinsplat_data::Capture;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// The part that a sequence plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Avatars are made from it.
    Train,
    /// Renders are scored against it.
    Test,
    /// Settings are chosen on it: scored where a table names it.
    Val,
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
    /// Width and height of the largest image as stored, pixels, if somebody knows: for estimates of cost.
    #[serde(default)]
    pub image: Option<[u32; 2]>,
}

/// A person (or figure) and the sequences in which it was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubjectInfo {
    /// Id, unique within its data set.
    pub id: String,
    /// How it was captured.
    pub capture: Capture,
    /// Its sequences.
    pub sequences: Vec<SequenceInfo>,
    /// True if the registry says which frames are for what: the split of an experiment does not count then.
    #[serde(default)]
    pub split_given: bool,
    /// What a reader of its numbers has to know: what its files leave out or what was guessed, what does not fit.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Avatars that are registered for it.
    #[serde(default)]
    pub avatars: Vec<AvatarFile>,
    /// Renders of its test sequences.
    #[serde(default)]
    pub renders: Vec<RenderedFrames>,
}

/// Frames of a test sequence that another program rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderedFrames {
    /// Where an experiment says they are. No key depends on it.
    #[serde(serialize_with = "super::lossy::path")]
    pub path: PathBuf,
    /// Where those of this sequence are.
    #[serde(serialize_with = "super::lossy::path")]
    pub folder: PathBuf,
    /// The sequence.
    pub sequence: String,
    /// The images that were found, by the names of the frames.
    #[serde(serialize_with = "super::lossy::paths")]
    pub frames: BTreeMap<String, PathBuf>,
    /// Images that are of no frame, if there are any. No key depends on them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_over: Option<LeftOver>,
    /// Digest of the images that were found.
    pub digest: String,
    /// Gaussians of the avatar, if the folder says so.
    pub splats: Option<u64>,
    /// Size of the avatar in bytes, if the folder says so.
    pub bytes: Option<u64>,
    /// Time of a frame in milliseconds, if the folder says so.
    pub milliseconds: Option<f64>,
}

/// Images in a folder of renders that are of no frame of the sequence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOver {
    /// How many.
    pub count: usize,
    /// The name of the first.
    pub first: String,
}

impl fmt::Display for LeftOver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, first } = self;
        let images = if *count == 1 { "image is" } else { "images are" };
        write!(f, "{count} more {images} of no frame, such as {first}")
    }
}

/// An avatar that was fitted elsewhere.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AvatarFile {
    /// Name that experiments use, unique in its subject.
    pub name: String,
    /// The file, or the folder of an export. No key depends on it.
    #[serde(serialize_with = "super::lossy::path")]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dataset {
    /// Id, unique among the data sets given to one plan; a real data set carries the id that experiments name.
    pub id: String,
    /// Name for captions.
    pub title: String,
    /// Its subjects.
    pub subjects: Vec<SubjectInfo>,
    /// Subjects that cannot be used.
    #[serde(default)]
    pub unreadable: Vec<Unreadable>,
}

impl Dataset {
    /// What the registry calls it: its id without the experiment whose bodies it was loaded on.
    pub fn registered_id(&self) -> &str {
        self.id.split(OWN_BODIES).next().unwrap_or(&self.id)
    }

    /// True if it was loaded on the bodies of one experiment, and is for no other.
    pub fn is_for_one_table(&self) -> bool {
        self.id.contains(OWN_BODIES)
    }
}

/// A subject that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unreadable {
    /// Its id.
    pub subject: String,
    /// File, field and expectation, one line.
    pub problem: String,
}
