//! What can be wrong when an avatar is bound or posed.

use skinsplat_core::choice::one_of;
use skinsplat_core::scene::SceneError;
use std::fmt;

/// Why an avatar cannot be bound or posed, or a strategy not be understood.
#[derive(Clone, Debug, PartialEq)]
pub enum PosingError {
    /// The avatar or the body breaks an invariant.
    Scene(SceneError),
    /// A strategy reads faces, and the body has none.
    NoFaces {
        /// The strategy, as text.
        strategy: String,
    },
    /// The posed body is not the one that the avatar was bound to.
    OtherBody {
        /// Counts of the posed body.
        found: String,
        /// Counts of the body at binding.
        expected: String,
    },
    /// An id that nothing has.
    UnknownId {
        /// The axis of the strategy.
        axis: &'static str,
        /// What was given.
        id: String,
        /// What is known.
        expected: String,
    },
    /// A part of a strategy's text that is no `axis=choice`.
    BadVariation {
        /// What was given.
        part: String,
        /// What was expected.
        expected: String,
    },
}

impl fmt::Display for PosingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(error) => error.fmt(f),
            Self::NoFaces { strategy } => {
                write!(f, "strategy {strategy}: the body has no faces; expected a body with a mesh")
            }
            Self::OtherBody { found, expected } => {
                write!(f, "body: {found}; expected {expected} as in the body that the avatar was bound to")
            }
            Self::UnknownId { axis, id, expected } => {
                let known: Vec<&str> = expected.split(", ").collect();
                write!(f, "{axis}: unknown {id:?}; expected {}", one_of(id, &known))
            }
            Self::BadVariation { part, expected } => write!(f, "strategy: {part:?}; expected {expected}"),
        }
    }
}

impl std::error::Error for PosingError {}

impl From<SceneError> for PosingError {
    fn from(error: SceneError) -> Self {
        Self::Scene(error)
    }
}

/// That an array has as many values as it must.
pub(crate) fn expect_count(field: &str, found: usize, expected: usize) -> Result<(), SceneError> {
    let problem = || SceneError::new(field, format!("{found} values"), format!("{expected}"));
    if found == expected { Ok(()) } else { Err(problem()) }
}
