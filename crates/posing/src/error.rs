//! What can be wrong when an avatar is bound or posed.

use skinsplat_core::scene::SceneError;

/// Why an avatar cannot be bound or posed, or a strategy not be understood.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StrategyError {
    /// The avatar or the body breaks an invariant.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A strategy reads faces, and the body has none.
    #[error("strategy {strategy}: the body has no faces; expected a body with a mesh")]
    NoFaces {
        /// The strategy, as text.
        strategy: String,
    },
    /// The posed body is not the one that the avatar was bound to.
    #[error("body: {found}; expected {expected} as in the body that the avatar was bound to")]
    OtherBody {
        /// Counts of the posed body.
        found: String,
        /// Counts of the body at binding.
        expected: String,
    },
    /// An id that nothing has.
    #[error("{axis}: unknown {id:?}; expected one of {expected}")]
    UnknownId {
        /// The axis of the strategy.
        axis: &'static str,
        /// What was given.
        id: String,
        /// What is known.
        expected: String,
    },
    /// A part of a strategy's text that is no `axis=choice`.
    #[error("strategy: {part:?}; expected {expected}")]
    BadVariation {
        /// What was given.
        part: String,
        /// What was expected.
        expected: String,
    },
}
