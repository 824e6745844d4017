//! What can go wrong between a file and a scene type.

use super::source;
use skinsplat_core::scene::SceneError;
use std::io;
use std::path::{Path, PathBuf};

/// What the errors of a subject's files are about, in their fields.
const SUBJECTS: [&str; 6] = ["poses", "betas", "camera", "body model", "mask", "image"];

/// An error of the data layer. Every variant names the file, the field in it and what was expected, in one line.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused to read.
    #[error("{}: {field}: cannot read: {cause}; expected {expected}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The part of the input that the file is ("body", "image").
        field: String,
        /// What was expected.
        expected: String,
        /// Why the system refused.
        cause: io::Error,
    },
    /// The operating system refused to write; nothing was left behind.
    #[error("{}: {field}: cannot write: {cause}; expected {expected}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What was being written.
        field: String,
        /// What was expected.
        expected: String,
        /// Why the system refused.
        cause: io::Error,
    },
    /// The file holds something else than it should.
    #[error("{}: {field}: {problem}; expected {expected}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, in the file's own terms, with an index where there is one.
        field: String,
        /// What is wrong with it.
        problem: String,
        /// What was expected.
        expected: String,
    },
}

impl Error {
    /// A value that is not what it should be.
    pub fn invalid(
        path: impl Into<PathBuf>,
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            path: path.into(),
            field: field.into(),
            problem: problem.into(),
            expected: expected.into(),
        }
    }

    /// A broken invariant of a scene type, found while reading `path`.
    pub fn scene(path: impl Into<PathBuf>, error: SceneError) -> Self {
        Self::invalid(path, error.field, error.problem, error.expected)
    }

    /// A name that a file of named things does not hold, among those that it holds. Names are whatever the file says: one line
    /// in any case.
    pub(crate) fn missing(path: &Path, name: &str, names: &[String], expected: &str) -> Self {
        const MOST: usize = 40;
        let mut shown: Vec<String> =
            names.iter().take(MOST).map(|name| name.escape_debug().to_string()).collect();
        if names.len() > MOST {
            shown.push(format!("{} more", names.len() - MOST));
        }
        Self::invalid(path, name, format!("missing; the file holds {}", shown.join(", ")), expected)
    }

    /// A file that could not be read.
    pub fn read(
        path: impl Into<PathBuf>,
        field: impl Into<String>,
        expected: impl Into<String>,
        cause: io::Error,
    ) -> Self {
        Self::Read { path: path.into(), field: field.into(), expected: expected.into(), cause }
    }

    /// A file that could not be written.
    pub fn write(path: impl Into<PathBuf>, field: impl Into<String>, cause: io::Error) -> Self {
        let expected = "a writable path with space left".to_owned();
        Self::Write { path: path.into(), field: field.into(), expected, cause }
    }

    /// The same error with a subject before its field ("camera line 3"), where the field alone does not say what it is about:
    /// "line 3", "pickle", "width".
    #[must_use]
    pub(crate) fn about(mut self, subject: &str) -> Self {
        let (Self::Read { field, .. } | Self::Write { field, .. } | Self::Invalid { field, .. }) = &mut self;
        if SUBJECTS.iter().any(|known| field.contains(known)) {
            return self;
        }
        // "pose[3]" of "poses".
        let one = subject.strip_suffix('s').unwrap_or(subject);
        *field = match field.strip_prefix(one).filter(|rest| rest.is_empty() || rest.starts_with('[')) {
            Some(rest) => format!("{subject}{rest}"),
            None => format!("{subject} {field}"),
        };
        self
    }

    /// The same error about a thing that is read as another: a mask is decoded as an image.
    #[must_use]
    pub(crate) fn renamed(mut self, from: &str, to: &str) -> Self {
        let (Self::Read { field, .. } | Self::Write { field, .. } | Self::Invalid { field, .. }) = &mut self;
        if let Some(rest) = field.strip_prefix(from) {
            *field = format!("{to}{rest}");
        }
        self
    }

    /// The file that the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Read { path, .. } | Self::Write { path, .. } | Self::Invalid { path, .. } => path,
        }
    }

    /// The field that the error is about.
    pub fn field(&self) -> &str {
        match self {
            Self::Read { field, .. } | Self::Write { field, .. } | Self::Invalid { field, .. } => field,
        }
    }
}

/// Reads a whole file, or an open stream to its end.
pub fn read_bytes(path: &Path, field: &str, expected: &str) -> Result<Vec<u8>, Error> {
    source::read(path).map_err(|cause| Error::read(path, field, expected, cause))
}

/// Reads a whole UTF-8 file, without the byte order mark that some editors put before it.
pub fn read_text(path: &Path, field: &str, expected: &str) -> Result<String, Error> {
    let bytes = source::read_text(path).map_err(|cause| Error::read(path, field, expected, cause))?;
    if let Some(found) = disguise(&bytes) {
        return Err(Error::invalid(path, field, found, expected));
    }
    let text = String::from_utf8(bytes);
    let text = text.map_err(|cause| Error::invalid(path, field, cause.to_string(), expected))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// What a file is that evidently is another than its name says, by how it begins.
pub(crate) fn disguise(bytes: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 7] = [
        (&[0x1f, 0x8b], "compressed by gzip"),
        (b"PK\x03\x04", "a zip archive"),
        (&[0x28, 0xb5, 0x2f, 0xfd], "compressed by zstd"),
        (b"\xfd7zXZ", "compressed by xz"),
        (&[0xff, 0xfe], "UTF-16 text"),
        (&[0xfe, 0xff], "UTF-16 text"),
        (b"version https://git-lfs", "a pointer of Git LFS, not the file (git lfs pull fetches it)"),
    ];
    KINDS.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, kind)| *kind)
}

/// Reads a JSON file into a type; the error names the place in the text. A byte order mark before it is skipped, as
/// RFC 8259 allows.
pub fn read_json<T: serde::de::DeserializeOwned>(
    path: &Path,
    field: &str,
    expected: &str,
) -> Result<T, Error> {
    let text = read_text(path, field, expected)?;
    serde_json::from_str(&text).map_err(|cause| Error::invalid(path, field, cause.to_string(), expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_says_what_it_is_about() {
        let about = |field: &str, subject: &str| {
            Error::invalid("x", field, "wrong", "right").about(subject).field().to_owned()
        };
        assert_eq!(about("line 3", "camera"), "camera line 3");
        assert_eq!(about("cameras[2].K", "camera"), "cameras[2].K");
        assert_eq!(about("pose[3]", "poses"), "poses[3]");
        assert_eq!(about("pose", "poses"), "poses");
        assert_eq!(about("body_pose", "poses"), "poses body_pose");
        assert_eq!(about("betas[1]", "poses"), "betas[1]", "a shape is no pose");
        assert_eq!(about("weights[9]", "body model"), "body model weights[9]");
        let mask = Error::invalid("x", "image size", "wrong", "right").renamed("image", "mask");
        assert_eq!(mask.field(), "mask size");
    }
}
