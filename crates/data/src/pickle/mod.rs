//! Python pickles, protocols 0 to 5, without running anything.
//!
//! A pickle is a program for a small stack machine whose instructions may name and call any function. This reader knows the
//! instructions and an allow-list of names: NumPy arrays, scalars and types, `scipy.sparse` matrices (csc, csr, coo),
//! chumpy's constants (`chumpy.ch.Ch`: its `x`) and selections of them, joblib's arrays, and plain Python values. A file that
//! names anything else is refused by that name; nothing is imported, called or executed. Memory is bounded by the length of
//! the file: every instruction takes at least a byte of it, and copies are accounted for.
//!
//! [`Pickle::read`] also takes `.npy` files of Python objects (`numpy.save` of a dictionary). Values are asked for by name
//! through [`Field`]s, whose errors name the file and the place in it:
//!
//! ```no_run
//! # fn main() -> Result<(), skinsplat_data::Error> {
//! use skinsplat_data::pickle::Pickle;
//! let camera = Pickle::read("camera.pkl".as_ref(), "camera")?;
//! let focal = camera.get("camera_f")?.numbers("2")?; // finite, two values
//! let width = camera.get("width")?.count()?;
//! let poses = Pickle::read("smpl_output.pkl".as_ref(), "poses")?.get("1")?.get("pose")?.array()?; // a list of rows
//! # Ok(())
//! # }
//! ```

mod class;
mod construct;
mod field;
mod input;
mod machine;
mod numpy;
mod sparse;
mod value;

pub use field::Field;
pub use sparse::Rows;

use super::npy::{self, Array};
use super::{Error, error};
use skinsplat_core::scene::SceneError;
use std::path::{Path, PathBuf};
use value::{Heap, Value};

pub(crate) use value::TensorPlace;

/// The values of a file.
#[derive(Debug)]
pub struct Pickle {
    path: PathBuf,
    heap: Heap,
    root: Value,
}

impl Pickle {
    /// Reads a file: a pickle, joblib's kind of it (uncompressed), or a `.npy` array of Python objects. `what` says what it is
    /// for ("body", "poses").
    ///
    /// # Errors
    /// A file that cannot be read or is no pickle, a compressed one, a truncated one, one that names a class that is not read.
    pub fn read(path: &Path, what: &str) -> Result<Self, Error> {
        let file = error::read_bytes(path, what, "a Python pickle")?;
        Self::from_bytes(path, file)
    }

    /// As [`Pickle::read`], of bytes in memory; `path` is what errors name.
    ///
    /// # Errors
    /// As [`Pickle::read`].
    pub fn from_bytes(path: &Path, file: Vec<u8>) -> Result<Self, Error> {
        let start = start(&file).map_err(|e| Error::scene(path, e))?;
        let (heap, root) = machine::run(file, start, false).map_err(|e| Error::scene(path, e))?;
        Ok(Self { path: path.to_owned(), heap, root })
    }

    /// As [`Pickle::from_bytes`], of the pickle in a file of torch: its tensors are places in storages that lie outside of it.
    pub(crate) fn of_torch(path: &Path, file: Vec<u8>) -> Result<Self, Error> {
        let (heap, root) = machine::run(file, 0, true).map_err(|e| Error::scene(path, e))?;
        Ok(Self { path: path.to_owned(), heap, root })
    }

    /// Bytes of the pickle.
    pub(crate) fn size(&self) -> usize {
        self.heap.file.len()
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The value of the whole file.
    pub fn root(&self) -> Field<'_> {
        Field::new(self, String::new(), self.root)
    }

    /// An entry of the dictionary that the file is.
    ///
    /// # Errors
    /// If it is none, or has no such entry.
    pub fn get(&self, key: &str) -> Result<Field<'_>, Error> {
        self.root().get(key)
    }
}

/// Where the program starts.
fn start(file: &[u8]) -> Result<usize, SceneError> {
    let compressed = [
        (&b"x\x01"[..], "zlib"),
        (b"x\x5e", "zlib"),
        (b"x\x9c", "zlib"),
        (b"x\xda", "zlib"),
        (b"ZF", "zlib, by an old joblib"),
        (b"\x1f\x8b", "gzip"),
        (b"BZh", "bzip2"),
        (b"\xfd7zXZ", "xz"),
        (b"\x5d\x00", "lzma"),
        (b"\x04\x22\x4d\x18", "lz4"),
    ];
    if let Some((_, name)) = compressed.iter().find(|(magic, _)| file.starts_with(magic)) {
        let problem = format!("a pickle compressed with {name}, which is not read");
        return Err(SceneError::new("pickle", problem, "an uncompressed one (joblib.dump(..., compress=0))"));
    }
    if let Some(found) = error::disguise(file) {
        return Err(SceneError::new("pickle", found, "a Python pickle"));
    }
    if !file.starts_with(npy::MAGIC) {
        return Ok(0);
    }
    let mut rest = file;
    let header = npy::read_header(&mut rest, "array")?;
    if !header.descr.contains('O') {
        return Err(SceneError::new(
            "array",
            format!("type {}", header.descr),
            "a .npy file of Python objects",
        ));
    }
    Ok(file.len() - rest.len())
}

/// True if a file is a pickle by its first bytes, or by its name (compressed ones, which are refused as what they are).
pub(crate) fn is_pickle_file(path: &Path, start: &[u8]) -> bool {
    let named = |extension: &std::ffi::OsStr| {
        ["pkl", "pickle", "joblib"].iter().any(|name| extension.eq_ignore_ascii_case(name))
    };
    is_pickle(start) || path.extension().is_some_and(named)
}

/// True if a file starts as pickles do: with a protocol number, or with the first instructions of protocol 0 or 1.
pub fn is_pickle(start: &[u8]) -> bool {
    match start {
        [0x80, 0..=5, ..] | [b'}' | b']', b'q' | b'.', ..] => true,
        [b'(', b'd' | b'l' | b't' | b'i' | b'c', ..] => true,
        [b'c', rest @ ..] => {
            let line = rest.split(|&b| b == b'\n').next().unwrap_or_default();
            !line.is_empty()
                && line.len() < rest.len()
                && line.iter().all(|b| b.is_ascii_alphanumeric() || b"._".contains(b))
        }
        _ => false,
    }
}
