//! What can be wrong with an experiment or a plan.

use std::path::PathBuf;

/// An experiment that cannot be read or planned. Every message names the file or experiment, the key, and what was
/// expected there.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file or folder could not be read.
    #[error("{}: cannot read: {source}; expected the TOML file of an experiment", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not TOML, or a key is missing, unknown or of the wrong type.
    #[error("{file}:{line}: {message} (at `{excerpt}`)")]
    Toml {
        /// The file, or a name for embedded text.
        file: String,
        /// Line of the offending key, from 1.
        line: usize,
        /// The parser's message, one line.
        message: String,
        /// The offending line.
        excerpt: String,
    },
    /// A value is well-formed but means nothing.
    #[error("{file}: {key}: {problem}; expected {expected}")]
    Invalid {
        /// The file, or the experiment's id.
        file: String,
        /// The key, such as `variants[1].avatar`.
        key: String,
        /// What was found.
        problem: String,
        /// What would have been right.
        expected: String,
    },
}

impl Error {
    /// An [`Error::Invalid`].
    pub(super) fn invalid(
        file: &str,
        key: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            file: file.into(),
            key: key.into(),
            problem: problem.into(),
            expected: expected.into(),
        }
    }
}
