//! What can be wrong with an answer before it can be judged.

use skinsplat_core::scene::SceneError;

/// An answer, a folder or an option that cannot be used. One line, in the form of all errors here.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Where: a file and a field, or an option.
    pub place: String,
    /// What was read.
    pub problem: String,
    /// What was expected.
    pub expected: String,
}

impl Error {
    /// Builds an error from its parts.
    pub fn new(place: impl Into<String>, problem: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { place: place.into(), problem: problem.into(), expected: expected.into() }
    }

    /// The same, in a file.
    #[must_use]
    pub fn within(self, file: &std::path::Path) -> Self {
        Self { place: format!("{}: {}", file.display(), self.place), ..self }
    }
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { place, problem, expected } = self;
        write!(f, "{place}: {problem}; expected {expected}")
    }
}

impl std::error::Error for Error {}

impl From<SceneError> for Error {
    fn from(error: SceneError) -> Self {
        Self::new(error.field, error.problem, error.expected)
    }
}

impl From<skinsplat_data::Error> for Error {
    fn from(error: skinsplat_data::Error) -> Self {
        let place = format!("{}: {}", error.path().display(), error.field());
        match error {
            skinsplat_data::Error::Invalid { problem, expected, .. } => Self::new(place, problem, expected),
            skinsplat_data::Error::Read { expected, cause, .. } => {
                Self::new(place, format!("cannot read: {cause}"), expected)
            }
            skinsplat_data::Error::Write { expected, cause, .. } => {
                Self::new(place, format!("cannot write: {cause}"), expected)
            }
        }
    }
}
