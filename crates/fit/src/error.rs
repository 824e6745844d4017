//! What can go wrong when an avatar is made.

use skinsplat_core::scene::SceneError;
use skinsplat_posing::PosingError;

/// An avatar could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A training frame could not be read.
    #[error(transparent)]
    Data(#[from] skinsplat_data::Error),
    /// A camera, pose or body that does not fit.
    #[error("sequence {sequence}: {problem}")]
    Scene {
        /// Id of the sequence.
        sequence: String,
        /// What is wrong; part of the message, so no source of its own.
        problem: SceneError,
    },
    /// The avatar cannot be posed.
    #[error("sequence {sequence}: {problem}")]
    Strategy {
        /// Id of the sequence.
        sequence: String,
        /// What is wrong; part of the message, so no source of its own.
        problem: PosingError,
    },
    /// An optimisation ran into numbers that are not finite.
    #[error(
        "sequence {sequence}: not finite at iteration {iteration} on frame {frame}: {parameter}; expected finite losses \
         (smaller learning rates may help)"
    )]
    Diverged {
        /// Id of the sequence.
        sequence: String,
        /// Iterations before it.
        iteration: u32,
        /// The training frame.
        frame: String,
        /// What is not finite.
        parameter: String,
    },
    /// A checkpoint that is none of this fit.
    #[error("checkpoint: {problem}")]
    Checkpoint {
        /// What is wrong with it, and what was expected.
        problem: String,
    },
    /// A setting out of its range, or data that cannot give an avatar.
    #[error("{field}: {problem}; expected {expected}")]
    Invalid {
        /// The setting, or the part of the sequence.
        field: String,
        /// What is wrong with it.
        problem: String,
        /// What was expected instead.
        expected: String,
    },
}

impl Error {
    pub(super) fn invalid(
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Invalid { field: field.into(), problem: problem.into(), expected: expected.into() }
    }

    pub(super) fn strategy(
        sequence: &skinsplat_data::sequence::Sequence,
    ) -> impl Fn(PosingError) -> Self + '_ {
        |problem| Self::Strategy { sequence: sequence.id.clone(), problem }
    }

    pub(super) fn scene(sequence: &skinsplat_data::sequence::Sequence) -> impl Fn(SceneError) -> Self + '_ {
        |problem| Self::Scene { sequence: sequence.id.clone(), problem }
    }
}
