//! What tells formats apart: how a file starts, and what an archive lists.

use super::super::{Error, source};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Bytes that are looked at.
const LENGTH: u64 = 512;

/// A file and its beginning.
pub(super) struct Start {
    pub(super) path: PathBuf,
    /// None of a pipe, which can be read only once.
    pub(super) bytes: Vec<u8>,
    pub(super) is_file: bool,
    /// Names of the entries, if it is a zip archive that can be opened.
    pub(super) entries: Vec<String>,
}

impl Start {
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn of(path: &Path) -> Result<Self, Error> {
        let unreadable = |cause| Error::read(path, "avatar", super::EXPECTED, cause);
        let mut bytes = Vec::new();
        let file = source::open(path).map_err(unreadable)?;
        let is_file = file.metadata().map_err(unreadable)?.is_file();
        if is_file {
            file.take(LENGTH).read_to_end(&mut bytes).map_err(unreadable)?;
        }
        let entries = if bytes.starts_with(b"PK") { entries(path) } else { Vec::new() };
        Ok(Self { path: path.to_owned(), bytes, is_file, entries })
    }

    /// The end of the file's name, in lower case.
    pub(super) fn extension(&self) -> String {
        self.path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
    }

    /// True for a zip archive.
    pub(super) fn is_archive(&self) -> bool {
        self.bytes.starts_with(b"PK")
    }

    /// True if an entry of the archive is called so, in whatever folder.
    pub(super) fn has_entry(&self, name: &str) -> bool {
        self.entries.iter().any(|entry| entry.rsplit('/').next() == Some(name))
    }
}

fn entries(path: &Path) -> Vec<String> {
    let open = || ZipArchive::new(BufReader::new(source::open(path)?));
    let names = |archive: ZipArchive<BufReader<File>>| {
        archive.file_names().flatten().map(std::borrow::Cow::into_owned).collect()
    };
    open().map(names).unwrap_or_default()
}
