//! Named arrays, whichever container holds them: an `.npz` archive or a pickled dictionary.

use super::error::disguise;
use super::npy::{self, Array};
use super::npz::Archive;
use super::pickle::{self, Pickle, Rows};
use super::shapes::Extents;
use super::{Error, source};
use std::io::Read;
use std::path::Path;

/// An open file of named arrays. Arrays are read one at a time and checked against the shape that is expected of them.
#[derive(Debug)]
pub struct Arrays {
    container: Container,
    extents: Extents,
}

#[derive(Debug)]
enum Container {
    Archive(Archive),
    Pickle(Pickle),
}

impl Arrays {
    /// Opens an `.npz` archive or a pickled dictionary (also one in an `.npy` file), told apart by content. `what` says what the file is for.
    ///
    /// # Errors
    /// A file that cannot be read or is neither; a pickle that names a class that is not read.
    pub fn open(path: &Path, what: &str) -> Result<Self, Error> {
        let mut start = Vec::new();
        let expected = "a .npz archive of arrays, or a pickled dictionary of them";
        let opened = source::open(path).and_then(|file| file.take(64).read_to_end(&mut start));
        opened.map_err(|cause| Error::read(path, what, expected, cause))?;
        // NumPy saves a dictionary as an array of one pickled object.
        let container = match pickle::is_pickle_file(path, &start) || start.starts_with(npy::MAGIC) {
            true => Container::Pickle(Pickle::read(path, what)?),
            false => {
                if let Some(found) = disguise(&start).filter(|_| !start.starts_with(b"PK")) {
                    return Err(Error::invalid(path, what, found, expected));
                }
                Container::Archive(Archive::open(path, what)?)
            }
        };
        Ok(Self { container, extents: Extents::default() })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        match &self.container {
            Container::Archive(archive) => archive.path(),
            Container::Pickle(pickle) => pickle.path(),
        }
    }

    /// Names of everything in it.
    pub fn names(&self) -> Vec<String> {
        match &self.container {
            Container::Archive(archive) => archive.names(),
            Container::Pickle(pickle) => pickle.root().keys().unwrap_or_default(),
        }
    }

    /// The root of the dictionary, if the file is a pickle.
    pub fn pickled(&self) -> Option<pickle::Field<'_>> {
        match &self.container {
            Container::Archive(_) => None,
            Container::Pickle(pickle) => Some(pickle.root()),
        }
    }

    /// True if there is something of this name.
    pub fn contains(&self, name: &str) -> bool {
        match &self.container {
            Container::Archive(archive) => archive.contains(name),
            Container::Pickle(pickle) => pickle.root().contains(name),
        }
    }

    /// What the file is, in words.
    pub fn kind(&self) -> &'static str {
        match &self.container {
            Container::Archive(_) => "npz archive",
            Container::Pickle(_) => "pickled dictionary",
        }
    }

    /// Shape and type of something in the file, in words.
    ///
    /// # Errors
    /// If there is nothing of that name, or its header is broken.
    pub fn describe(&mut self, name: &str) -> Result<String, Error> {
        match &mut self.container {
            Container::Archive(archive) => {
                let header = archive.header(name)?;
                Ok(format!("{:?} {}", header.shape, header.descr))
            }
            Container::Pickle(pickle) => {
                Ok(pickle.root().optional(name)?.map_or("None".to_owned(), |f| f.describe()))
            }
        }
    }

    /// An array of any shape; `None` if there is none of that name.
    ///
    /// # Errors
    /// Broken or truncated data, or something else than numbers.
    pub fn array(&mut self, name: &str) -> Result<Option<Array>, Error> {
        match &mut self.container {
            Container::Archive(archive) => archive.array(name),
            Container::Pickle(pickle) => pickle.root().optional(name)?.map(|field| field.array()).transpose(),
        }
    }

    /// An array of strings, flat; `None` if there is none of that name.
    ///
    /// # Errors
    /// Broken or truncated data, or something else than strings.
    pub fn text(&mut self, name: &str) -> Result<Option<Vec<String>>, Error> {
        match &mut self.container {
            Container::Archive(archive) => archive.text(name),
            Container::Pickle(pickle) => {
                let Some(field) = pickle.root().optional(name)? else { return Ok(None) };
                field.text().map(|text| vec![text]).or_else(|_| field.texts()).map(Some)
            }
        }
    }

    /// An array of finite numbers whose shape fits a pattern: see [`Archive::require`].
    ///
    /// # Errors
    /// A missing array, another shape, NaN or infinite values.
    pub fn require(&mut self, name: &str, pattern: &str) -> Result<Array, Error> {
        self.optional(name, pattern)?.ok_or_else(|| self.missing(name, &format!("an array ({pattern})")))
    }

    /// As [`Arrays::require`]; `None` if there is no array of that name.
    ///
    /// # Errors
    /// Another shape, NaN or infinite values.
    pub fn optional(&mut self, name: &str, pattern: &str) -> Result<Option<Array>, Error> {
        let Some(array) = self.array(name)? else { return Ok(None) };
        let path = self.path().to_owned();
        self.extents.check(&path, name, array, pattern).map(Some)
    }

    /// A matrix by its rows, dense or sparse in the file, with the extents that a pattern of two letters or numbers
    /// asks for; `None` if there is none of that name.
    ///
    /// # Errors
    /// As [`Arrays::optional`].
    pub fn rows(&mut self, name: &str, pattern: &str) -> Result<Option<Rows>, Error> {
        let stored = match &mut self.container {
            Container::Archive(archive) => archive.array(name)?.map(Stored::Dense),
            Container::Pickle(pickle) => match pickle.root().optional(name)? {
                Some(field) => Some(Stored::Rows(field.rows()?)),
                None => None,
            },
        };
        let path = self.path().to_owned();
        let rows = match stored {
            None => return Ok(None),
            Some(Stored::Rows(rows)) => {
                // Only the extents are left to be checked.
                let extents = Array { shape: rows.shape.to_vec(), values: Vec::new() };
                self.extents.check(&path, name, extents, pattern)?;
                Some(rows)
            }
            Some(Stored::Dense(array)) => Rows::dense(&self.extents.check(&path, name, array, pattern)?),
        };
        rows.map(Some).ok_or_else(|| self.invalid(name, "no matrix", format!("an array ({pattern})")))
    }

    /// An error about a field of this file.
    pub fn invalid(
        &self,
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        Error::invalid(self.path(), field, problem, expected)
    }

    /// An error about a field that is not there.
    pub(crate) fn missing(&self, name: &str, expected: &str) -> Error {
        Error::missing(self.path(), name, &self.names(), expected)
    }
}

enum Stored {
    Dense(Array),
    Rows(Rows),
}
