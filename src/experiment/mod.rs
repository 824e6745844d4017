//! Experiments as data: `experiments/*.toml` and descriptions of the data at hand become a [`Plan`].
//!
//! An [`Experiment`] says what one table asks: which data set, variants, protocol and columns, and what the paper
//! printed. [`plan()`] is a pure function of experiments, [`Dataset`] descriptions and [`Options`]; it yields avatars
//! and one [`Job`] per test frame, each with a content key that changes when anything changes that its numbers
//! depend on. A [`FrameRecord`] is what a job leaves behind. Nothing in this layer renders, and nothing reads a file
//! but [`Experiment::load`] and [`Experiment::load_folder`].
//!
//! A further table is a further TOML file; a further column is a line in [`METRICS`](skinsplat_metrics::METRICS).

mod avatar;
mod catalog;
mod dataset;
mod embedded;
mod equivalence;
mod error;
mod grid;
mod lossy;
mod paper;
mod plan;
mod poses;
mod profile;
mod record;
mod rows;
mod seeds;
mod shard;
mod slices;
mod spec;
mod subset;
mod validate;
mod versions;

pub use avatar::{AvatarSource, PlannedAvatar, PlannedFit, TrainingFrames};
pub use dataset::{
    AvatarFile, AvatarState, Dataset, FrameInfo, LeftOver, RenderedFrames, Role, SequenceInfo, SubjectInfo,
    Unreadable,
};
pub use embedded::{EMBEDDED, FURTHER};
pub use error::Error;
pub use grid::Grid;
pub use paper::{Paper, PaperRow, PaperVariant, Printed, Split};
pub use plan::{Job, JobVariant, Plan, PlannedTable, plan};
pub use poses::{PoseNoise, TestPoses};
pub use profile::{GivenWeights, Options, Profile, Subset};
pub use record::{FittedOutcome, FrameRecord, Outcome, Records, Seconds};
pub use rows::{DataRow, RowDigests, Source};
pub use seeds::Replicate;
pub use shard::{MOST_SHARDS, Shard};
pub use slices::Slices;
pub use spec::{
    ADDED_VARIANT, AvatarRecipe, Average, Column, Experiment, GIVEN_AVATAR, Layout, Shown, StandIn, Variant,
};
pub use versions::CodeVersions;
