//! Depth maps: TIFF files of one channel of floats.

use super::{Error, source};
use skinsplat_core::scene::camera;
use std::io::Cursor;
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

/// No compressed image expands by more than this (deflate reaches 1032).
const MAX_EXPANSION: u64 = 1100;

/// What a strip may take beyond the picture, bytes.
const STRIP: usize = 1 << 20;

/// Depths of a picture, row by row, in the unit of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Depth {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// One value per pixel.
    pub values: Vec<f32>,
}

/// Loads the first page of a TIFF file: one channel of 32 or 64 bit floats or of 16 bit integers.
///
/// # Errors
/// Unreadable, truncated or absurdly large files, other pixel types, NaN.
pub fn load(path: &Path) -> Result<Depth, Error> {
    const EXPECTED: &str = "a TIFF file with one channel of floats";
    let broken = |cause: tiff::TiffError| Error::invalid(path, "depth", one_line(&cause), EXPECTED);
    let bytes = source::read(path).map_err(|cause| Error::read(path, "depth", EXPECTED, cause))?;
    let length = bytes.len() as u64;
    if claims_too_much(&bytes) {
        let problem = format!("a list that is longer than the file's {length} bytes");
        return Err(Error::invalid(path, "depth", problem, EXPECTED));
    }
    let mut decoder = Decoder::new(Cursor::new(&bytes[..])).map_err(broken)?;
    let (width, height) = decoder.dimensions().map_err(broken)?;
    camera::check_image_size(width, height).map_err(|e| Error::scene(path, e))?;
    let kind = decoder.colortype().map_err(broken)?;
    let ColorType::Gray(bits) = kind else {
        return Err(Error::invalid(path, "depth", format!("pixel type {kind:?}"), EXPECTED));
    };
    let size = u64::from(width) * u64::from(height) * u64::from(bits) / 8;
    if size > length.saturating_mul(MAX_EXPANSION) {
        let problem = format!("{width}x{height} pixels in {length} bytes");
        return Err(Error::invalid(path, "depth size", problem, "a size that the file can hold"));
    }
    // A strip may say that it is larger than the picture.
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(size).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size.saturating_add(STRIP);
    let mut decoder = decoder.with_limits(limits);
    let values: Vec<f32> = match decoder.read_image().map_err(broken)? {
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::U16(values) => values.into_iter().map(f32::from).collect(),
        _ => return Err(Error::invalid(path, "depth", format!("pixel type {kind:?}"), EXPECTED)),
    };
    let (width, height) = (width as usize, height as usize);
    if values.len() != width * height {
        let problem = format!("{} values", values.len());
        return Err(Error::invalid(path, "depth", problem, format!("{width}x{height}")));
    }
    if let Some(i) = values.iter().position(|v| v.is_nan()) {
        return Err(Error::invalid(path, format!("depth[{i}]"), "NaN", "metres"));
    }
    Ok(Depth { width, height, values })
}

/// Whether an entry of the first directory says that it is longer than the file: the decoder would ask for memory first.
/// Of a directory that is cut off, or of BigTIFF's, the decoder says what is wrong.
fn claims_too_much(bytes: &[u8]) -> bool {
    let is_big_endian = bytes.starts_with(b"MM");
    let number = |at: usize, length: usize| -> Option<u64> {
        let digits = bytes.get(at..at.checked_add(length)?)?;
        let add = |sum: u64, &digit: &u8| (sum << 8) | u64::from(digit);
        Some(if is_big_endian { digits.iter().fold(0, add) } else { digits.iter().rev().fold(0, add) })
    };
    let big = number(2, 2) == Some(43);
    let (pointer, counted, entry, width) = if big { (8, 8, 20, 8) } else { (4, 2, 12, 4) };
    let Some(start) = number(pointer, width).and_then(|at| usize::try_from(at).ok()) else { return false };
    let entries = number(start, counted).unwrap_or_default().min(bytes.len() as u64 / entry) as usize;
    (0..entries).any(|i| {
        let at = start + counted + i * entry as usize;
        number(at + 4, width).is_some_and(|count| count > bytes.len() as u64)
    })
}

fn one_line(cause: &tiff::TiffError) -> String {
    cause.to_string().replace('\n', " ")
}
