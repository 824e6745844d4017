//! NumPy `.npz` archives: named arrays, read one at a time and checked against the shape that is expected of them.

use super::npy::{self, Array, Header};
use super::shapes::Extents;
use super::{Error, listing, source};
use skinsplat_core::scene::SceneError;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// An open archive.
pub struct Archive {
    path: PathBuf,
    inner: ZipArchive<BufReader<File>>,
    extents: Extents,
}

impl std::fmt::Debug for Archive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Archive")
            .field("path", &self.path)
            .field("extents", &self.extents)
            .finish_non_exhaustive()
    }
}

/// That no name in an archive leads out of it: whoever unpacks such a one writes where its author likes.
///
/// # Errors
/// Names the first that does.
pub(crate) fn check_names<R: Read + Seek>(
    path: &Path,
    what: &str,
    archive: &ZipArchive<R>,
) -> Result<(), Error> {
    match archive.file_names().flatten().find(|name| !listing::stays_inside(name, 0)) {
        None => Ok(()),
        Some(name) => {
            let expected = "an archive whose names stay inside it";
            Err(Error::invalid(path, what, format!("an entry named `{name}`"), expected))
        }
    }
}

impl Archive {
    /// Opens an archive and reads its directory. `what` says what the file is for ("body", "poses").
    ///
    /// # Errors
    /// A file that cannot be read or is no zip archive; names that lead out of it.
    pub fn open(path: &Path, what: &str) -> Result<Self, Error> {
        let open = || ZipArchive::new(BufReader::new(source::open(path)?));
        let inner =
            open().map_err(|cause| Error::read(path, what, "a .npz archive of arrays", cause.into()))?;
        check_names(path, what, &inner)?;
        Ok(Self { path: path.to_owned(), inner, extents: Extents::default() })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        let array = |name: std::borrow::Cow<'_, str>| name.strip_suffix(SUFFIX).map(str::to_owned);
        let mut names: Vec<String> = self.inner.file_names().flatten().filter_map(array).collect();
        names.sort();
        names
    }

    /// True if the archive holds the array.
    pub fn contains(&self, name: &str) -> bool {
        self.inner.index_for_name(&file_name(name)).is_some()
    }

    /// Type and shape of an array, without its values.
    ///
    /// # Errors
    /// If it is missing or its header is broken.
    pub fn header(&mut self, name: &str) -> Result<Header, Error> {
        self.entry(name, |mut reader, _| npy::read_header(&mut reader, name))?
            .ok_or_else(|| self.missing(name, "an array"))
    }

    /// An array of any shape; `None` if there is none of that name.
    ///
    /// # Errors
    /// Broken or truncated data, or another type than numbers.
    pub fn array(&mut self, name: &str) -> Result<Option<Array>, Error> {
        self.entry(name, |reader, length| npy::read_array(reader, expanded(length), name))
    }

    /// An array of strings; `None` if there is none of that name.
    ///
    /// # Errors
    /// Broken or truncated data, or another type than strings.
    pub fn text(&mut self, name: &str) -> Result<Option<Vec<String>>, Error> {
        self.entry(name, |reader, _| npy::read_text(reader, name))
    }

    /// An array of finite numbers whose shape fits `pattern`, such as `"V,3"`. A letter stands for any extent when it
    /// is first met and for the same extent in every later array of this archive; `*` for any extent.
    ///
    /// # Errors
    /// A missing array, another shape, NaN or infinite values.
    pub fn require(&mut self, name: &str, pattern: &str) -> Result<Array, Error> {
        self.optional(name, pattern)?.ok_or_else(|| self.missing(name, &format!("an array ({pattern})")))
    }

    /// As [`Archive::require`]; `None` if there is no array of that name.
    ///
    /// # Errors
    /// Another shape, NaN or infinite values.
    pub fn optional(&mut self, name: &str, pattern: &str) -> Result<Option<Array>, Error> {
        let Some(array) = self.array(name)? else { return Ok(None) };
        self.extents.check(&self.path, name, array, pattern).map(Some)
    }

    /// An array whose shape fits one of several patterns, whatever its values are; `None` if there is none of that name.
    ///
    /// # Errors
    /// Another shape (the last pattern is named), broken or truncated data.
    pub fn any_of(&mut self, name: &str, patterns: &[&str]) -> Result<Option<Array>, Error> {
        let Some(array) = self.array(name)? else { return Ok(None) };
        let mut fits = Ok(());
        for pattern in patterns {
            fits = self.extents.check_shape(&self.path, name, &array.shape, pattern);
            if fits.is_ok() {
                break;
            }
        }
        fits.map(|()| Some(array))
    }

    /// An error about a field of this archive.
    pub fn invalid(
        &self,
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        Error::invalid(&self.path, field, problem, expected)
    }

    fn missing(&self, name: &str, expected: &str) -> Error {
        Error::missing(&self.path, name, &self.names(), expected)
    }

    /// Reads an array of the archive, given how long it is there.
    fn entry<T>(
        &mut self,
        name: &str,
        read: impl FnOnce(&mut dyn Read, u64) -> Result<T, SceneError>,
    ) -> Result<Option<T>, Error> {
        let Some(index) = self.inner.index_for_name(&file_name(name)) else { return Ok(None) };
        let mut entry = self.inner.by_index(index).map_err(|cause| {
            Error::invalid(&self.path, name, format!("cannot read: {cause}"), "a stored or deflated array")
        })?;
        let length = entry.compressed_size();
        read(&mut entry, length).map(Some).map_err(|e| Error::scene(&self.path, e))
    }
}

/// The bytes that may come of so many compressed ones: what deflate can expand them to, and 64 MB for narrower types that become
/// `f64`.
fn expanded(compressed: u64) -> u64 {
    /// A byte of deflate stands for at most so many.
    const DEFLATE: u64 = 1032;
    compressed.saturating_mul(DEFLATE).saturating_add(1 << 26)
}

/// What numpy appends to the name of an array.
const SUFFIX: &str = ".npy";

fn file_name(array: &str) -> String {
    format!("{array}{SUFFIX}")
}
