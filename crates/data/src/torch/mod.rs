//! Tensors of torch files (`.pth`, `.pt`, `.ckpt`): archives of one pickle that describes them and an entry per storage.
//!
//! The pickle goes through [`pickle`](super::pickle)'s machine with torch's few names added to its allow-list; nothing is
//! executed. A storage is read when a tensor of it is asked for, so that networks in a checkpoint cost nothing. Where a
//! tensor had been (`cuda:0`) does not matter.

mod element;

use super::npy::Array;
use super::pickle::{Field, Pickle, TensorPlace};
use super::{Error, npy, npz, source};
use element::Element;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// How deep dictionaries and lists are followed in search of tensors.
const MAX_DEPTH: usize = 12;
/// A pickle describes tensors; it holds none. The largest known one has some megabytes.
const MAX_PICKLE: u64 = 1 << 28;

/// An open torch file.
pub struct Checkpoint {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
    /// The folder of the entries in the archive, with its slash.
    root: String,
    big_endian: bool,
    pickle: Pickle,
}

impl std::fmt::Debug for Checkpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Checkpoint")
            .field("path", &self.path)
            .field("root", &self.root)
            .finish_non_exhaustive()
    }
}

/// Where the tensors of a file are, by name: keys of dictionaries joined by dots, places in lists in brackets.
#[derive(Clone, Debug, Default)]
pub struct Tensors(BTreeMap<String, TensorPlace>);

impl Checkpoint {
    /// Opens a file and reads what it says of its tensors. `what` says what it is for ("avatar").
    ///
    /// # Errors
    /// A file that is no archive of torch, or whose pickle names what is not read.
    pub fn open(path: &Path, what: &str) -> Result<Self, Error> {
        let expected = "a torch file (an archive with data.pkl)";
        let open = || ZipArchive::new(BufReader::new(source::open(path)?));
        let mut archive = open().map_err(|cause| Error::read(path, what, expected, cause.into()))?;
        npz::check_names(path, what, &archive)?;
        let described = |name: std::borrow::Cow<'_, str>| name.strip_suffix("data.pkl").map(str::to_owned);
        let root = archive.file_names().flatten().find_map(described);
        let root = root.filter(|root| root.is_empty() || root.ends_with('/'));
        let Some(root) = root else {
            return Err(Error::invalid(path, what, "an archive without data.pkl", expected));
        };
        let bytes = entry(&mut archive, path, &format!("{root}data.pkl"), MAX_PICKLE)?;
        let order = match archive.index_for_name(&format!("{root}byteorder")) {
            Some(_) => entry(&mut archive, path, &format!("{root}byteorder"), 16)?,
            None => Vec::new(),
        };
        let pickle = Pickle::of_torch(path, bytes)?;
        Ok(Self { path: path.to_owned(), archive, root, big_endian: order.starts_with(b"big"), pickle })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Every tensor.
    ///
    /// # Errors
    /// Dictionaries nested too deep.
    pub fn tensors(&self) -> Result<Tensors, Error> {
        let mut found = BTreeMap::new();
        let mut room = 1_000_000 + 64 * self.pickle.size();
        gather(&self.pickle.root(), &mut found, MAX_DEPTH, &mut room)?;
        Ok(Tensors(found))
    }

    /// The values of a tensor.
    ///
    /// # Errors
    /// No tensor of that name, a storage that is missing or too small, another type than numbers.
    pub fn array(&mut self, tensors: &Tensors, name: &str) -> Result<Array, Error> {
        let place = tensors.0.get(name).ok_or_else(|| {
            self.invalid(name, format!("missing; there are {}", tensors.shown()), "a tensor of this name")
        })?;
        let element = Element::named(place.storage)
            .ok_or_else(|| self.invalid(name, format!("a storage of type {}", place.storage), "numbers"))?;
        let count = count(&place.shape).filter(|&count| count <= place.elements.min(npy::MAX_VALUES));
        let last = place.last().filter(|&last| last < place.elements);
        let (Some(count), true) = (count, last.is_some() || count == Some(0)) else {
            let problem = format!(
                "shape {:?}, strides {:?}, offset {} in a storage of {}",
                place.shape, place.strides, place.offset, place.elements
            );
            return Err(self.invalid(name, problem, "elements that lie in the storage, each once"));
        };
        let bytes = match count {
            0 => Vec::new(),
            _ => self.storage(name, &place.key, place.elements, element.size())?,
        };
        let value = |at: usize| element.value(&bytes[at * element.size()..], self.big_endian);
        Ok(Array { shape: place.shape.clone(), values: place.places().map(value).collect() })
    }

    /// The values of a tensor of a shape; none stands for any extent.
    ///
    /// # Errors
    /// As [`Checkpoint::array`]; another shape.
    pub fn shaped(&mut self, tensors: &Tensors, name: &str, shape: &[Option<usize>]) -> Result<Array, Error> {
        let array = self.array(tensors, name)?;
        let fits = array.shape.len() == shape.len()
            && array
                .shape
                .iter()
                .zip(shape)
                .all(|(found, wanted)| wanted.is_none_or(|wanted| wanted == *found));
        if fits {
            return Ok(array);
        }
        let extent = |extent: &Option<usize>| extent.map_or("*".to_owned(), |extent| extent.to_string());
        let expected = shape.iter().map(extent).collect::<Vec<_>>().join(", ");
        Err(self.invalid(name, format!("shape {:?}", array.shape), format!("({expected})")))
    }

    /// An error about a tensor of this file.
    pub fn invalid(
        &self,
        field: impl Into<String>,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> Error {
        Error::invalid(&self.path, field, problem, expected)
    }

    /// The bytes of a storage.
    fn storage(&mut self, tensor: &str, key: &str, elements: usize, size: usize) -> Result<Vec<u8>, Error> {
        let name = format!("{}data/{key}", self.root);
        let needed = elements.saturating_mul(size);
        if self.archive.index_for_name(&name).is_none() {
            let problem = format!("its storage {} is missing", name.escape_debug());
            return Err(self.invalid(tensor, problem, "an entry of the archive"));
        }
        let bytes = entry(&mut self.archive, &self.path, &name, needed as u64)?;
        if bytes.len() < needed {
            let problem = format!("a storage of {} bytes", bytes.len());
            return Err(self.invalid(tensor, problem, format!("{needed} for {elements} elements")));
        }
        Ok(bytes)
    }
}

impl Tensors {
    /// Names, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// True if there is a tensor of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// What stands before the last part of a tensor's name, with its dot: that of the first tensor whose last part is this.
    pub fn prefix_of(&self, last: &str) -> Option<String> {
        let begins = |rest: &&str| rest.is_empty() || rest.ends_with('.');
        self.names().find_map(|name| name.strip_suffix(last).filter(begins).map(str::to_owned))
    }

    /// Calls a tensor otherwise.
    pub fn rename(&mut self, from: &str, to: &str) {
        if let Some(place) = self.0.remove(from) {
            self.0.insert(to.to_owned(), place);
        }
    }

    /// The first names, for messages.
    pub fn shown(&self) -> String {
        const MOST: usize = 8;
        let first: Vec<String> =
            self.names().take(MOST).map(|name| name.escape_debug().to_string()).collect();
        match self.0.len() {
            0 => "no tensors".to_owned(),
            n if n > MOST => format!("{} and {} more", first.join(", "), n - MOST),
            _ => first.join(", "),
        }
    }
}

/// Reads an entry of an archive; more than `most` bytes of it are not read.
fn entry(
    archive: &mut ZipArchive<BufReader<File>>,
    path: &Path,
    name: &str,
    most: u64,
) -> Result<Vec<u8>, Error> {
    let broken = |cause: String| {
        Error::invalid(
            path,
            name.escape_debug().to_string(),
            format!("cannot read: {cause}"),
            "a stored or deflated entry",
        )
    };
    let mut bytes = Vec::new();
    let entry = archive.by_name(name).map_err(|cause| broken(cause.to_string()))?;
    entry.take(most).read_to_end(&mut bytes).map_err(|cause| broken(cause.to_string()))?;
    Ok(bytes)
}

/// Collects the tensors below a value. `room` bounds the names that are made: lists may repeat one another.
fn gather(
    field: &Field<'_>,
    found: &mut BTreeMap<String, TensorPlace>,
    depth: usize,
    room: &mut usize,
) -> Result<(), Error> {
    if let Some(place) = field.tensor() {
        found.insert(field.name().to_owned(), place);
        return Ok(());
    }
    let parts = field.parts();
    let too_many = || field.invalid("values nested too deep or too often", "dictionaries of tensors");
    if !parts.is_empty() && depth == 0 {
        return Err(too_many());
    }
    for part in parts {
        *room = room.checked_sub(part.name().len() + 8).ok_or_else(too_many)?;
        gather(&part, found, depth - 1, room)?;
    }
    Ok(())
}

fn count(shape: &[usize]) -> Option<usize> {
    shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n))
}

impl TensorPlace {
    /// The place of the last element in the storage; none without elements or beyond all storages.
    fn last(&self) -> Option<usize> {
        let mut last = self.offset;
        for (&extent, &stride) in self.shape.iter().zip(&self.strides) {
            last = last.checked_add(extent.checked_sub(1)?.checked_mul(stride)?)?;
        }
        Some(last)
    }

    /// The places of the elements in C order.
    fn places(&self) -> impl Iterator<Item = usize> + '_ {
        let mut index = vec![0usize; self.shape.len()];
        let mut at = self.offset;
        let mut left = count(&self.shape).unwrap_or(0);
        std::iter::from_fn(move || {
            left = left.checked_sub(1)?;
            let place = at;
            for axis in (0..index.len()).rev() {
                index[axis] += 1;
                at += self.strides[axis];
                if index[axis] < self.shape[axis] {
                    break;
                }
                at -= self.strides[axis] * self.shape[axis];
                index[axis] = 0;
            }
            Some(place)
        })
    }
}
