//! Entries of the run's folder of avatars: files that were written together, under a content key, with their checksums
//! beside them. An entry that is not whole is made again.

use super::Error;
use skinsplat_data::atomic;
use skinsplat_data::avatar::file_digest;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Files `FOLDER/KEY.EXTENSION` that belong together, and `FOLDER/KEY.sha256`, which `sha256sum -c` can check. That one is
/// written last: without it nothing in the entry counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    folder: PathBuf,
    key: String,
    extensions: Vec<&'static str>,
}

impl Entry {
    /// The entry of this key, whose files have these extensions.
    pub fn new(folder: &Path, key: &str, extensions: &[&'static str]) -> Self {
        Self { folder: folder.to_owned(), key: key.to_owned(), extensions: extensions.to_vec() }
    }

    /// The file of an extension.
    pub fn path(&self, extension: &str) -> PathBuf {
        self.folder.join(format!("{}.{extension}", self.key))
    }

    /// Makes the entry unless it is there and whole. `say` is told of one that was damaged.
    ///
    /// # Errors
    /// As `make`; a file that cannot be removed or written.
    pub fn ensure(
        &self,
        mut say: impl FnMut(String) -> Result<(), Error>,
        make: impl FnOnce() -> Result<(), Error>,
    ) -> Result<(), Error> {
        match self.damage() {
            None => return Ok(()),
            // Nothing is removed: another process may be making the same entry, bit for bit, and each file is replaced at once.
            Some(damage) if self.is_there() => {
                say(format!("{}: {damage}; made again", self.path(self.extensions[0]).display()))?;
            }
            Some(_) => {}
        }
        make()?;
        self.seal()
    }

    /// What is wrong with the entry, if anything is.
    fn damage(&self) -> Option<String> {
        let Ok(sums) = skinsplat_data::source::read_to_string(&self.path(SUMS)) else {
            return Some("no checksum".to_owned());
        };
        let differs = |extension: &&&str| {
            let line = self.line(extension).unwrap_or_default();
            !sums.lines().any(|known| known == line)
        };
        let extension = self.extensions.iter().find(differs)?;
        Some(format!("{}.{extension} is damaged", self.key))
    }

    /// Writes the checksums.
    fn seal(&self) -> Result<(), Error> {
        let mut sums = String::new();
        for extension in &self.extensions {
            let _ = writeln!(sums, "{}", self.line(extension)?);
        }
        Ok(atomic::write(&self.path(SUMS), |w| w.write_all(sums.as_bytes()))?)
    }

    /// The line of a file: digest, two spaces, name.
    fn line(&self, extension: &str) -> Result<String, Error> {
        Ok(format!("{}  {}.{extension}", file_digest(&self.path(extension))?, self.key))
    }

    /// True if there is something of the entry.
    fn is_there(&self) -> bool {
        self.extensions.iter().chain(&[SUMS]).any(|extension| self.path(extension).exists())
    }
}

/// Removes the entries of some keys, but for the reports of fits (`KEY.json`), which say how an avatar was made. Their checksums
/// go first: what is left of an entry when this is interrupted does not count.
///
/// # Errors
/// A file that cannot be removed.
pub fn remove_entries<'a>(folder: &Path, keys: impl IntoIterator<Item = &'a str>) -> Result<(), Error> {
    for key in keys {
        for extension in [SUMS].iter().chain(&PARTS) {
            remove(&folder.join(format!("{key}.{extension}")))?;
        }
    }
    Ok(())
}

/// Extensions of what an avatar consists of, but for the report of a fit.
const PARTS: [&str; 5] = ["ply", "npy", "vertices.npy", "texture.png", "poses.json"];

/// Extension of the checksums.
const SUMS: &str = "sha256";

/// Removes a file; false if there is none.
pub(super) fn remove(path: &Path) -> Result<bool, Error> {
    match std::fs::remove_file(path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(source) => Err(Error::File { path: path.to_owned(), action: "remove", source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_whole_is_made_again_and_said() {
        let folder = tempfile::tempdir().unwrap();
        let entry = Entry::new(folder.path(), "key", &["ply", "json"]);
        let mut said: Vec<String> = Vec::new();
        let mut made = 0;
        let mut ensure = || {
            let say = |text| {
                said.push(text);
                Ok(())
            };
            let make = || {
                made += 1;
                for extension in ["ply", "json"] {
                    std::fs::write(entry.path(extension), extension).unwrap();
                }
                Ok(())
            };
            entry.ensure(say, make).unwrap();
            (made, said.len())
        };
        assert_eq!((ensure(), ensure()), ((1, 0), (1, 0)), "made once");
        std::fs::write(entry.path("ply"), "").unwrap();
        assert_eq!(ensure(), (2, 1), "an empty file");
        std::fs::write(entry.path("json"), "{}").unwrap();
        assert_eq!(ensure(), (3, 2), "another content");
        std::fs::remove_file(entry.path("json")).unwrap();
        assert_eq!(ensure(), (4, 3), "a file that is gone");
        std::fs::remove_file(entry.path(SUMS)).unwrap();
        assert_eq!(ensure(), (5, 4), "no checksums: written by an older program, or killed before");
        assert_eq!(ensure(), (5, 4));
        assert!(said[0].contains("key.ply") && said[3].contains("no checksum"), "{said:?}");
    }
}
