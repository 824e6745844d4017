//! Numeric arrays of HDF5 files, whole or a row at a time.
//!
//! The format itself is read by the `hdf5-pure` crate: old and new groups, contiguous, compact and chunked arrays, the filters
//! deflate, shuffle, fletcher32 and LZF. What is checked here first is that a file can hold what it declares, so that no
//! count of a damaged file becomes memory.

mod superblock;

use super::npy::{Array, MAX_VALUES};
use super::{Error, source};
use hdf5_pure::{ChunkCacheConfig, DType, Dataset, File, FileAccessProperties, Layout};
use std::path::{Path, PathBuf};

/// What a compressed byte can expand to: deflate reaches 1032, LZF 88.
const MAX_EXPANSION: u64 = 1100;

/// How much of a chunked array stays decoded between rows, bytes. A chunk of masks spans some forty frames.
const CACHE: usize = 128 << 20;

/// The filters that are undone, by their number in the file format.
const FILTERS: [(u16, &str); 4] = [(1, "deflate"), (2, "shuffle"), (3, "fletcher32"), (32000, "LZF")];

/// An open file.
pub struct Hdf5 {
    path: PathBuf,
    file: File,
}

impl std::fmt::Debug for Hdf5 {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hdf5").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Hdf5 {
    /// Opens a file. `what` says what it is for ("masks", "poses").
    ///
    /// # Errors
    /// A file that cannot be read, is no HDF5 file, or ends before it says.
    pub fn open(path: &Path, what: &str) -> Result<Self, Error> {
        let unreadable = |cause| Error::read(path, what, "an HDF5 file", cause);
        let opened = source::open(path).map_err(unreadable)?;
        let length = opened.metadata().map_err(unreadable)?.len();
        if let Some(fault) = superblock::cut_short(opened, length) {
            return Err(Error::invalid(path, what, fault, "a whole HDF5 file: copy or download it again"));
        }
        let cache = ChunkCacheConfig::default().with_max_bytes(CACHE);
        let properties = FileAccessProperties::new().with_chunk_cache(cache);
        let file = File::open_streaming_with_options(path, properties)
            .map_err(|cause| Error::invalid(path, what, one_line(&cause), "an HDF5 file"))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Names of the arrays, those of groups of the first level included.
    pub fn names(&self) -> Vec<String> {
        let root = self.file.root();
        let mut names = root.datasets().unwrap_or_default();
        for group in root.groups().unwrap_or_default() {
            let inner = self.file.group(&group).and_then(|inner| inner.datasets()).unwrap_or_default();
            names.extend(inner.into_iter().map(|name| format!("{group}/{name}")));
        }
        names
    }

    /// An array of numbers, at any depth ("group/name").
    ///
    /// # Errors
    /// If there is none of that name, it holds something else than integers or floats, uses another filter than deflate,
    /// shuffle, fletcher32 and LZF, or declares more than its stored bytes can hold.
    pub fn rows(&self, name: &str) -> Result<Rows, Error> {
        let invalid = |problem: String, expected: &str| Error::invalid(&self.path, name, problem, expected);
        let data = self.file.dataset(name).map_err(|cause| {
            let names = self.file.root().datasets().unwrap_or_default().join(", ").escape_debug().to_string();
            invalid(format!("{}; the file holds {names}", one_line(&cause)), "an array")
        })?;
        let broken = |cause: hdf5_pure::Error| invalid(one_line(&cause), "an array of numbers");
        let kind = data.dtype().map_err(broken)?;
        let width = data.element_size().map_err(broken)?;
        let plain = [DType::F32, DType::F64, DType::I8, DType::I16, DType::I32, DType::I64]
            .into_iter()
            .chain([DType::U8, DType::U16, DType::U32, DType::U64])
            .any(|known| known == kind);
        if !(plain || matches!(kind, DType::Enum(_)) && width == 1) {
            return Err(invalid(format!("type {kind}"), "integers or floats of up to 64 bits"));
        }
        if let Some(filter) =
            data.filters().into_iter().find(|id| FILTERS.iter().all(|(known, _)| known != id))
        {
            let known: Vec<&str> = FILTERS.iter().map(|(_, name)| *name).collect();
            return Err(invalid(format!("filter {filter}"), &format!("none, or {}", known.join(", "))));
        }
        let shape: Vec<usize> = data
            .shape()
            .map_err(broken)?
            .into_iter()
            .map(|extent| usize::try_from(extent).unwrap_or(usize::MAX))
            .collect();
        let rows = Rows { path: self.path.clone(), name: name.to_owned(), data, shape };
        rows.check_declared(width)?;
        Ok(rows)
    }

    /// A whole array.
    ///
    /// # Errors
    /// As [`Hdf5::rows`]; another shape than `shape`, where 0 stands for any extent; values that are not finite.
    pub fn array(&self, name: &str, shape: &[usize]) -> Result<Array, Error> {
        let rows = self.rows(name)?;
        let fits = rows.shape.len() == shape.len()
            && rows.shape.iter().zip(shape).all(|(own, wanted)| *wanted == 0 || own == wanted);
        if !fits {
            let expected: Vec<String> =
                shape.iter().map(|n| if *n == 0 { "N".to_owned() } else { n.to_string() }).collect();
            let problem = format!("shape {:?}", rows.shape);
            return Err(Error::invalid(&self.path, name, problem, format!("({})", expected.join(", "))));
        }
        if rows.shape.iter().try_fold(1usize, |size, &n| size.checked_mul(n)).is_none_or(|n| n > MAX_VALUES) {
            return Err(
                rows.invalid(format!("shape {:?}", rows.shape), format!("at most {MAX_VALUES} values"))
            );
        }
        let values = rows.data.read_f64().map_err(|cause| rows.broken(&cause))?;
        if values.len() != rows.shape.iter().product::<usize>() {
            return Err(rows.invalid(format!("{} values", values.len()), format!("shape {:?}", rows.shape)));
        }
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(Error::invalid(
                &self.path,
                format!("{name}[{i}]"),
                "NaN or infinite",
                "finite values",
            ));
        }
        Ok(Array { shape: rows.shape, values })
    }
}

/// An array of an [`Hdf5`] file that is read a row at a time: element `i` of its first axis.
pub struct Rows {
    path: PathBuf,
    name: String,
    data: Dataset,
    shape: Vec<usize>,
}

impl std::fmt::Debug for Rows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rows")
            .field("path", &self.path)
            .field("name", &self.name)
            .field("shape", &self.shape)
            .finish_non_exhaustive()
    }
}

impl Rows {
    /// Extent of each axis.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The values of a row, the last axis running fastest.
    ///
    /// # Errors
    /// A row that is not there, bytes that cannot be decoded.
    pub fn row(&self, row: usize) -> Result<Vec<f64>, Error> {
        let Some((_, extents)) = self.shape.split_first().filter(|(count, _)| row < **count) else {
            let expected = format!("a row below {}", self.shape.first().copied().unwrap_or_default());
            return Err(Error::invalid(&self.path, format!("{}[{row}]", self.name), "not there", expected));
        };
        let values = self.data.read_f64_rows(row as u64, 1).map_err(|cause| self.broken(&cause))?;
        let expected: usize = extents.iter().product();
        if values.len() != expected {
            return Err(self.invalid(format!("row {row} of {} values", values.len()), expected.to_string()));
        }
        Ok(values)
    }

    /// Refuses an array whose declared size its stored bytes cannot hold, or a single chunk of which could not.
    fn check_declared(&self, width: u64) -> Result<(), Error> {
        let product = |extents: &[u64]| extents.iter().try_fold(width, |size, &n| size.checked_mul(n));
        let shape: Vec<u64> = self.shape.iter().map(|&n| n as u64).collect();
        let too_large = || {
            let expected = "a size that the file can hold";
            self.invalid(format!("shape {:?}", self.shape), expected)
        };
        let total = product(&shape).ok_or_else(too_large)?;
        let layout = self.data.layout().map_err(|cause| self.broken(&cause))?;
        // What a chunk says of itself is no more than the file has.
        let length = std::fs::metadata(&self.path).map_or(0, |file| file.len());
        let Layout::Chunked { chunk_shape, .. } = layout else {
            return if total <= length { Ok(()) } else { Err(too_large()) };
        };
        let chunk = product(&chunk_shape).ok_or_else(too_large)?;
        let chunks = self.data.chunks().map_err(|cause| self.broken(&cause))?;
        if chunks.iter().any(|chunk| chunk.storage_size > length) {
            return Err(too_large());
        }
        let stored =
            chunks.iter().fold(0u64, |sum, chunk| sum.saturating_add(chunk.storage_size)).min(length);
        let smallest = chunks.iter().map(|chunk| chunk.storage_size).min().unwrap_or_default();
        let plausible = total / MAX_EXPANSION <= stored && chunk / MAX_EXPANSION <= smallest;
        if plausible { Ok(()) } else { Err(too_large()) }
    }

    fn broken(&self, cause: &hdf5_pure::Error) -> Error {
        self.invalid(one_line(cause), "an array of numbers")
    }

    fn invalid(&self, problem: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::invalid(&self.path, &self.name, problem, expected)
    }
}

/// An error of the library as part of a line.
fn one_line(cause: &hdf5_pure::Error) -> String {
    cause.to_string().replace('\n', " ")
}
