//! Flat binary answers, little-endian: a header of fixed width, a table of blocks, numbers.
//!
//! | bytes | what |
//! |---|---|
//! | 0..8 | `SKINCONF` |
//! | 8..12 | u32: version, 1 |
//! | 12..16 | u32: number of blocks |
//! | 16..32 | the convention, ASCII, padded with zeros; empty if the file does not say |
//! | 32..36 | u32: quaternions, 0 for w x y z, 1 for x y z w |
//! | 36..40 | u32: matrices, 0 row by row, 1 column by column |
//!
//! Then a table entry of 64 bytes per block: 24 bytes of name (ASCII, padded with zeros), u32 type (1: f32, 2: f64, 3: u32),
//! u32 number of extents (0 to 4), 4 × u32 extents, u64 offset from the start of the file, u64 length in bytes.

use super::super::Error;
use super::super::convention::QuaternionOrder;
use super::layout::{self, Array};
use super::{Answer, Declared, Expected};

/// How a file begins.
pub(crate) const MAGIC: &[u8; 8] = b"SKINCONF";
/// Version of the layout.
pub(crate) const VERSION: u32 = 1;
/// Bytes before the table.
pub(crate) const HEADER: usize = 40;
/// Bytes of a table entry.
pub(crate) const BLOCK: usize = 64;

/// Codes of element types.
pub(crate) mod dtype {
    pub(crate) const F32: u32 = 1;
    pub(crate) const F64: u32 = 2;
    pub(crate) const U32: u32 = 3;
}

/// No file of more blocks is read.
const MOST_BLOCKS: u32 = 1024;

/// An entry of the table.
pub(crate) struct Block {
    pub(crate) name: String,
    pub(crate) dtype: u32,
    pub(crate) shape: Vec<usize>,
    pub(crate) offset: u64,
    pub(crate) length: u64,
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|k| bytes[at + k]))
}

fn text_at(bytes: &[u8], at: usize, width: usize) -> String {
    let text = &bytes[at..at + width];
    let text = text.split(|&b| b == 0).next().unwrap_or_default();
    text.iter().map(|&b| if b.is_ascii_graphic() { char::from(b) } else { '?' }).collect()
}

/// Reads an answer.
pub(super) fn read(bytes: &[u8], expected: &Expected) -> Result<Answer, Error> {
    let (declared, blocks) = table(bytes)?;
    let ends = blocks.iter().map(|block| block.offset.saturating_add(block.length));
    let end = ends.fold((HEADER + BLOCK * blocks.len()) as u64, u64::max);
    let mut arrays = Vec::new();
    let mut frames = None;
    let mut unread = Vec::new();
    for block in blocks {
        if layout::is_field(&block.name) {
            if arrays.iter().any(|array: &Array| array.name == block.name) {
                return Err(Error::new(block.name, "given twice", "one block of a name"));
            }
            arrays.push(Array { values: numbers(bytes, &block)?, name: block.name, shape: block.shape });
        } else if block.name == "frames" {
            frames = Some(numbers(bytes, &block)?.iter().map(|&v| v as usize).collect());
        } else if !block.name.starts_with("input.") {
            unread.push(block.name);
        }
    }
    let mut answer = layout::answer(arrays, frames, expected)?;
    answer.declared = declared;
    if let Some(more) = (bytes.len() as u64).checked_sub(end).filter(|&more| more > 0) {
        answer.notes.push(format!("not read: {more} byte(s) after the last block"));
    }
    if !unread.is_empty() {
        answer.notes.push(format!("not read: {}", unread.join(", ")));
    }
    Ok(answer)
}

fn table(bytes: &[u8]) -> Result<(Option<Declared>, Vec<Block>), Error> {
    let truncated = |needed: usize| {
        Error::new("header", format!("truncated, {} bytes", bytes.len()), format!("at least {needed}"))
    };
    if bytes.len() < HEADER {
        return Err(truncated(HEADER));
    }
    let (version, count) = (u32_at(bytes, 8), u32_at(bytes, 12));
    if version != VERSION {
        return Err(Error::new("header", format!("version {version}"), format!("{VERSION}, little-endian")));
    }
    if count > MOST_BLOCKS {
        return Err(Error::new("header", format!("{count} blocks"), format!("at most {MOST_BLOCKS}")));
    }
    let end = HEADER + BLOCK * count as usize;
    if bytes.len() < end {
        return Err(truncated(end));
    }
    let name = text_at(bytes, 16, 16);
    let quaternions = match u32_at(bytes, 32) {
        0 => QuaternionOrder::Wxyz,
        1 => QuaternionOrder::Xyzw,
        other => return Err(Error::new("header", format!("order of quaternions {other}"), "0 or 1")),
    };
    // Zeros may just not have been written; another order is said even where no name is.
    let says = !name.is_empty() || quaternions == QuaternionOrder::Xyzw;
    let declared = says.then_some(Declared { name, quaternions: Some(quaternions) });
    let blocks = (0..count as usize).map(|k| block(bytes, HEADER + BLOCK * k)).collect::<Result<_, _>>()?;
    Ok((declared, blocks))
}

fn block(bytes: &[u8], at: usize) -> Result<Block, Error> {
    let name = text_at(bytes, at, 24);
    let extents = u32_at(bytes, at + 28) as usize;
    if extents > 4 {
        return Err(Error::new(name, format!("{extents} extents"), "at most 4"));
    }
    Ok(Block {
        name,
        dtype: u32_at(bytes, at + 24),
        shape: (0..extents).map(|k| u32_at(bytes, at + 32 + 4 * k) as usize).collect(),
        offset: u64_at(bytes, at + 48),
        length: u64_at(bytes, at + 56),
    })
}

/// The numbers of a block.
fn numbers(bytes: &[u8], block: &Block) -> Result<Vec<f64>, Error> {
    let wrong = |problem: String, expected: String| Err(Error::new(&block.name, problem, expected));
    let size = match block.dtype {
        dtype::F32 | dtype::U32 => 4,
        dtype::F64 => 8,
        other => {
            return wrong(
                format!("type {other} (half floats?)"),
                "1 (32-bit floats), 2 (64-bit floats) or 3 (32-bit integers)".to_owned(),
            );
        }
    };
    let count = block.shape.iter().try_fold(1u64, |product, &n| product.checked_mul(n as u64));
    let Some(needed) = count.and_then(|count| count.checked_mul(size)) else {
        return wrong(format!("extents {:?}", block.shape), "extents of a file".to_owned());
    };
    if block.length != needed {
        let half = size == 4 && block.length.checked_mul(2) == Some(needed);
        let hint = if half { " (half floats?)" } else { "" };
        return wrong(
            format!("{} bytes{hint}", block.length),
            format!("{needed}, {size} per number of {:?}", block.shape),
        );
    }
    let whole = block.offset.checked_add(block.length).filter(|&end| end <= bytes.len() as u64);
    let Some(end) = whole else {
        let end = block.offset.saturating_add(block.length);
        return wrong(format!("truncated, {} bytes", bytes.len()), format!("a file of at least {end} bytes"));
    };
    let data = &bytes[block.offset as usize..end as usize];
    Ok(match block.dtype {
        dtype::F64 => {
            data.chunks_exact(8).map(|b| f64::from_le_bytes(std::array::from_fn(|k| b[k]))).collect()
        }
        dtype::U32 => data.chunks_exact(4).map(|b| f64::from(u32_at(b, 0))).collect(),
        _ => data.chunks_exact(4).map(|b| f64::from(f32::from_bits(u32_at(b, 0)))).collect(),
    })
}
