//! What can stop a run.

use super::store;

use std::path::{Path, PathBuf};

/// A run, or one of its frames, that cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Data that cannot be read.
    #[error(transparent)]
    Data(#[from] skinsplat_data::Error),
    /// An avatar that cannot be made.
    #[error(transparent)]
    Fit(#[from] skinsplat_fit::Error),
    /// An avatar that cannot be posed.
    #[error(transparent)]
    Strategy(#[from] skinsplat_posing::PosingError),
    /// A pose or an image that breaks an invariant.
    #[error(transparent)]
    Scene(#[from] skinsplat_core::scene::SceneError),
    /// An image that cannot be scored.
    #[error(transparent)]
    Metrics(#[from] skinsplat_metrics::MetricsError),
    /// The results store.
    #[error(transparent)]
    Store(#[from] store::Error),
    /// A folder that cannot be made.
    #[error("{}: cannot make the folder: {source}; expected a place where folders can be made", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that the system refuses to read or remove.
    #[error("{}: cannot {action}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was to be done with it.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The report beside a fitted avatar, if it is none.
    #[error("{}: {problem}; expected the report of a fit (remove it and the avatar beside it to fit anew)", path.display())]
    Sidecar {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Gaussians that are to be drawn without a strategy.
    #[error("strategy: missing; expected one, since the avatar has Gaussians to pose")]
    NoStrategy,
    /// A pose that is to be fitted where none is read.
    #[error("fitted pose: the frame comes from another program; expected an avatar that a pose moves")]
    NoPoseToFit,
    /// Rotations that are to be compared where there are none.
    #[error("{of}")]
    NoRotations {
        /// What there is instead, in a few words.
        of: &'static str,
    },
    /// Noise on the poses of frames that another program rendered.
    #[error("pose_noise: the frame was rendered by another program; expected an avatar that a pose moves")]
    NoPoseToDisturb,
    /// A test sequence on which nothing can be scored.
    #[error("sequence {sequence}: frames: none; expected at least one to score")]
    NoTestFrames {
        /// The sequence.
        sequence: String,
    },
    /// A checkpoint that cannot be read, or that belongs to another fit.
    #[error("{}: {problem}; expected a checkpoint of a fit (remove the file to start anew)", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The plan beside the stores of its shards, if it is none.
    #[error("{}: {problem}; expected the plan of a run, as `run --shard` writes it", path.display())]
    PlanFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A store whose plan is nowhere.
    #[error("{}: no {name} beside it; expected the plan that `run --shard` writes there", store.display())]
    NoPlanFile {
        /// The store.
        store: PathBuf,
        /// Name of the file.
        name: String,
    },
    /// A folder in which nobody computed.
    #[error("{}: no results; expected the folder of a `run --shard`", folder.display())]
    NoStores {
        /// The folder.
        folder: PathBuf,
    },
    /// Stores of two plans.
    #[error(
        "{} and {} are of two plans: {field}: {first_has} in the first, {second_has} in the second; expected slices of one",
        first.display(), second.display()
    )]
    MixedPlans {
        /// A store of the one.
        first: PathBuf,
        /// A store of the other.
        second: PathBuf,
        /// The first field that differs.
        field: String,
        /// What it is there.
        first_has: String,
        /// What it is here.
        second_has: String,
    },
    /// Data that the plan names and the library does not have.
    #[error("{name}: not among the data at hand; expected the data that the plan was made from")]
    Absent {
        /// Its name.
        name: String,
    },
    /// An avatar that could not be made, when a frame needed it.
    #[error("avatar: {problem}")]
    Avatar {
        /// What went wrong.
        problem: String,
    },
    /// A protocol with a captured background, for data that has none.
    #[error(
        "protocol {protocol}: background `captured`; expected a colour, since the data has no captured background"
    )]
    NoBackground {
        /// Its id.
        protocol: String,
    },
}

impl Error {
    /// What is wrong with going on from a checkpoint: if it is the checkpoint, its file is named.
    pub(super) fn checkpoint(path: &Path, error: skinsplat_fit::Error) -> Self {
        match error {
            skinsplat_fit::Error::Checkpoint { problem } => {
                Self::Checkpoint { path: path.to_owned(), problem }
            }
            other => other.into(),
        }
    }
}
