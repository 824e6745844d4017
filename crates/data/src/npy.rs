//! NumPy `.npy` arrays of numbers, in either byte order and either memory order.
//!
//! Parsed here and not by the `npyz` crate, which the tests compare with: that one allocates the header length that a file
//! claims, overflows on the product of an absurd shape and recurses as deep as the header's brackets nest.

use super::{Error, atomic, source};
use skinsplat_core::scene::SceneError;
use std::io::{BufReader, Read, Write};
use std::path::Path;

/// No array of more values than this is read (1 GiB as `f64`); the largest known body model has 15 million.
pub const MAX_VALUES: usize = 1 << 27;

pub(super) const MAGIC: &[u8; 6] = b"\x93NUMPY";
const MAX_HEADER: usize = 1 << 16;

/// An array in C order (the last index runs fastest), whatever the order in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Extent of each axis; empty for a scalar.
    pub shape: Vec<usize>,
    /// All values.
    pub values: Vec<f64>,
}

/// What a header says of an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Element type as NumPy writes it, such as `<f4`.
    pub descr: String,
    /// Extent of each axis; empty for a scalar.
    pub shape: Vec<usize>,
    fortran_order: bool,
}

/// Reads an `.npy` file of real numbers, integers or booleans.
///
/// # Errors
/// A file that is not `.npy`, is truncated, or holds another type.
pub fn read(path: &Path) -> Result<Array, Error> {
    read_with_header(path).map(|(_, array)| array)
}

/// True if the array holds Python objects: a pickle, which [`Pickle`](crate::pickle::Pickle) reads.
///
/// # Errors
/// A file that cannot be read or is not `.npy`.
pub fn holds_objects(path: &Path) -> Result<bool, Error> {
    let mut file = source::open(path).map_err(|cause| Error::read(path, "file", "a .npy array", cause))?;
    let header = read_header(&mut file, "array").map_err(|e| Error::scene(path, e))?;
    Ok(header.descr.contains('O'))
}

/// As [`read`], with what the header says: the type of the numbers as they are stored.
///
/// # Errors
/// As [`read`].
pub fn read_with_header(path: &Path) -> Result<(Header, Array), Error> {
    let file = source::open(path).map_err(|cause| Error::read(path, "file", "a .npy array", cause))?;
    let mut reader = BufReader::new(file);
    let scene = |e: SceneError| Error::scene(path, e);
    let header = read_header(&mut reader, "array").map_err(scene)?;
    let array = read_values(reader, &header, "array").map_err(scene)?;
    Ok((header, array))
}

/// Writes `f32` values as a little-endian `.npy` file of the given shape.
///
/// # Errors
/// If the file cannot be written.
pub fn write_f32(path: &Path, shape: &[usize], values: impl IntoIterator<Item = f32>) -> Result<(), Error> {
    let extents: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({extents}), }}");
    // Magic (6), version (2), length (2), text and newline together fill a multiple of 64 bytes.
    let padded = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    atomic::write(path, |w| {
        w.write_all(MAGIC)?;
        w.write_all(&[1, 0])?;
        w.write_all(&(padded as u16).to_le_bytes())?;
        w.write_all(format!("{dict:<width$}\n", width = padded - 1).as_bytes())?;
        values.into_iter().try_for_each(|v| w.write_all(&v.to_le_bytes()))
    })
}

/// Reads an array of numbers that takes `most` bytes as `f64` at most; errors name `field`.
pub(super) fn read_array(mut reader: impl Read, most: u64, field: &str) -> Result<Array, SceneError> {
    let header = read_header(&mut reader, field)?;
    // Another order of the axes needs a second copy.
    let copies = if header.fortran_order { 2 } else { 1 };
    let bytes = count(&header, field)? as u64 * 8 * copies;
    if bytes > most {
        let expected = format!("at most {most} bytes in memory for a compressed array of its length");
        return Err(SceneError::new(field, format!("shape {:?}, {bytes} bytes", header.shape), expected));
    }
    read_values(reader, &header, field)
}

/// The numbers of an array whose elements are `bytes`, in memory order. Bytes beyond its shape are not looked at.
pub(super) fn from_bytes(
    descr: &str,
    shape: &[usize],
    fortran_order: bool,
    bytes: &[u8],
    field: &str,
) -> Result<Array, SceneError> {
    read_values(bytes, &Header { descr: descr.to_owned(), shape: shape.to_vec(), fortran_order }, field)
}

/// The numbers after a header.
fn read_values(reader: impl Read, header: &Header, field: &str) -> Result<Array, SceneError> {
    let (big_endian, kind, size) = element(&header.descr, field)?;
    let convert: fn(&[u8]) -> f64 = match (kind, size) {
        ('f', 2) => |b| f64::from(half::f16::from_le_bytes(sized(b))),
        ('f', 4) => |b| f64::from(f32::from_le_bytes(sized(b))),
        ('f', 8) => |b| f64::from_le_bytes(sized(b)),
        ('i', 1) => |b| f64::from(b[0] as i8),
        ('i', 2) => |b| f64::from(i16::from_le_bytes(sized(b))),
        ('i', 4) => |b| f64::from(i32::from_le_bytes(sized(b))),
        ('i', 8) => |b| i64::from_le_bytes(sized(b)) as f64,
        ('u' | 'b', 1) => |b| f64::from(b[0]),
        ('u', 2) => |b| f64::from(u16::from_le_bytes(sized(b))),
        ('u', 4) => |b| f64::from(u32::from_le_bytes(sized(b))),
        ('u', 8) => |b| u64::from_le_bytes(sized(b)) as f64,
        _ => return Err(type_error(&header.descr, field)),
    };
    let mut values: Vec<f64> = Vec::new();
    read_elements(reader, header, size, field, |bytes| {
        if big_endian {
            bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        values.extend(bytes.chunks_exact(size).map(convert));
    })?;
    if header.fortran_order {
        values = to_c_order(&values, &header.shape);
    }
    Ok(Array { shape: header.shape.clone(), values })
}

/// Reads an array of `U` (UTF-32) or `S` (bytes) strings, flat.
pub(super) fn read_text(mut reader: impl Read, field: &str) -> Result<Vec<String>, SceneError> {
    let header = read_header(&mut reader, field)?;
    read_strings(reader, &header, field)
}

/// As [`from_bytes`], of strings.
pub(super) fn text_from_bytes(
    descr: &str,
    shape: &[usize],
    bytes: &[u8],
    field: &str,
) -> Result<Vec<String>, SceneError> {
    read_strings(
        bytes,
        &Header { descr: descr.to_owned(), shape: shape.to_vec(), fortran_order: false },
        field,
    )
}

fn read_strings(reader: impl Read, header: &Header, field: &str) -> Result<Vec<String>, SceneError> {
    let (big_endian, kind, width) = element(&header.descr, field)?;
    let size = match kind {
        'U' => width.checked_mul(4),
        'S' => Some(width),
        _ => None,
    };
    let Some(size) = size.filter(|&s| s > 0) else {
        return Err(SceneError::new(field, format!("type {}", header.descr), "strings (U or S)"));
    };
    let string = |element: &[u8]| -> String {
        let unit =
            |b: &[u8]| if big_endian { u32::from_be_bytes(sized(b)) } else { u32::from_le_bytes(sized(b)) };
        let character = |code: u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
        let text: String = match kind {
            'U' => element.chunks_exact(4).map(|b| character(unit(b))).collect(),
            _ => String::from_utf8_lossy(element).into_owned(),
        };
        text.trim_end_matches('\0').to_owned()
    };
    let mut strings = Vec::new();
    read_elements(reader, header, size, field, |bytes| strings.extend(bytes.chunks_exact(size).map(string)))?;
    Ok(strings)
}

/// Reads the header and leaves the reader at the first element.
pub(super) fn read_header(reader: &mut impl Read, field: &str) -> Result<Header, SceneError> {
    let broken = |problem: &str| SceneError::new(field, problem, "a NumPy .npy header");
    let mut fixed = [0; 10];
    reader.read_exact(&mut fixed).map_err(|e| broken(&e.to_string()))?;
    if &fixed[..6] != MAGIC {
        return Err(broken("no .npy magic at its start"));
    }
    let mut length = usize::from(u16::from_le_bytes([fixed[8], fixed[9]]));
    if fixed[6] >= 2 {
        let mut high = [0; 2];
        reader.read_exact(&mut high).map_err(|e| broken(&e.to_string()))?;
        length |= usize::from(u16::from_le_bytes(high)) << 16;
    }
    if !(1..=3).contains(&fixed[6]) || length > MAX_HEADER {
        return Err(broken(&format!("version {} with a header of {length} bytes", fixed[6])));
    }
    let mut text = vec![0; length];
    reader.read_exact(&mut text).map_err(|e| broken(&e.to_string()))?;
    let text = String::from_utf8_lossy(&text);
    parse_dict(&text).ok_or_else(|| broken(&format!("header {:?}", text.trim_end())))
}

/// The three keys of the header's Python dictionary. Structured types (a list after `descr`) are not read.
fn parse_dict(text: &str) -> Option<Header> {
    let after = |key: &str| -> Option<&str> {
        let rest = &text[text.find(&format!("'{key}'"))? + key.len() + 2..];
        Some(rest.trim_start().strip_prefix(':')?.trim_start())
    };
    let descr = after("descr")?.strip_prefix('\'')?.split_once('\'')?.0.to_owned();
    let order = after("fortran_order")?;
    let fortran_order = order.starts_with("True");
    if !(fortran_order || order.starts_with("False")) {
        return None;
    }
    let extents = after("shape")?.strip_prefix('(')?.split_once(')')?.0;
    let shape = extents
        .split(',')
        .map(str::trim)
        .filter(|extent| !extent.is_empty())
        .map(|extent| extent.trim_end_matches('L').parse().ok())
        .collect::<Option<Vec<usize>>>()?;
    Some(Header { descr, shape, fortran_order })
}

/// Splits `<f4` into (big endian, kind, size).
fn element(descr: &str, field: &str) -> Result<(bool, char, usize), SceneError> {
    let mut characters = descr.chars();
    let order = characters.next().filter(|c| "<>|=".contains(*c));
    let (kind, size) = (characters.next(), characters.as_str().parse().ok());
    match (order, kind, size) {
        (Some(order), Some(kind), Some(size)) => Ok((order == '>', kind, size)),
        _ => Err(type_error(descr, field)),
    }
}

fn type_error(descr: &str, field: &str) -> SceneError {
    let hint = if descr.contains('O') { " (a pickled Python object)" } else { "" };
    let expected = "16, 32 or 64 bit floats, integers or booleans";
    SceneError::new(field, format!("type {descr}{hint}"), expected)
}

/// How many elements the shape announces.
fn count(header: &Header, field: &str) -> Result<usize, SceneError> {
    let count = header.shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n));
    count.filter(|&n| n <= MAX_VALUES).ok_or_else(|| {
        SceneError::new(field, format!("shape {:?}", header.shape), format!("at most {MAX_VALUES} values"))
    })
}

/// Bytes that are read at a time, about.
const CHUNK: usize = 1 << 20;

/// Reads exactly the elements that the shape announces and hands them on, whole ones at a time: memory grows with what arrives, not
/// with what is announced.
fn read_elements(
    mut reader: impl Read,
    header: &Header,
    size: usize,
    field: &str,
    mut take: impl FnMut(&mut [u8]),
) -> Result<(), SceneError> {
    let total =
        count(header, field)?.checked_mul(size).filter(|&n| n <= MAX_VALUES * 8).ok_or_else(|| {
            let expected = format!("at most {} bytes", MAX_VALUES * 8);
            SceneError::new(field, format!("shape {:?} of {size} bytes each", header.shape), expected)
        })?;
    let whole = (CHUNK / size).max(1) * size;
    let mut bytes = Vec::new();
    let mut done = 0;
    while done < total {
        bytes.clear();
        let wanted = whole.min(total - done);
        reader.by_ref().take(wanted as u64).read_to_end(&mut bytes).map_err(|cause| {
            SceneError::new(field, format!("cannot read: {cause}"), format!("{total} bytes of array data"))
        })?;
        if bytes.len() < wanted {
            let expected = format!("{total} for shape {:?}", header.shape);
            let problem = format!("truncated, {} bytes", done + bytes.len());
            return Err(SceneError::new(field, problem, expected));
        }
        done += wanted;
        take(&mut bytes);
    }
    Ok(())
}

fn sized<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes[i])
}

fn to_c_order(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = vec![1; shape.len()];
    for axis in 1..shape.len() {
        strides[axis] = strides[axis - 1] * shape[axis - 1];
    }
    let mut index = vec![0; shape.len()];
    let mut offset = 0;
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        ordered.push(values[offset]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            offset += strides[axis];
            if index[axis] < shape[axis] {
                break;
            }
            offset -= strides[axis] * shape[axis];
            index[axis] = 0;
        }
    }
    ordered
}
