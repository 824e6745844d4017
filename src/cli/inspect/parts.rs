//! Files that are parts of a subject: arrays, depth maps, HDF5, text. What they mean is said of their folder.

use super::{arrays_text, image_text, line, listed, spread};
use anyhow::Result;
use skinsplat_data::entries::Reach;
use skinsplat_data::hdf5::{Hdf5, Rows};
use skinsplat_data::layouts::{Reader, readers};
use skinsplat_data::select::evenly_spaced;
use skinsplat_data::{depth, error, frames, npy};
use std::path::Path;

/// Whose meaning a part has.
const WHOLE: &str = "see its subject's folder: reproduce inspect FOLDER";

/// An `.npy` file: an image if it has three axes, a dictionary if it holds a Python object.
pub(super) fn array_text(path: &Path) -> Result<String> {
    if npy::holds_objects(path)? {
        return arrays_text(path);
    }
    let (header, array) = npy::read_with_header(path)?;
    if array.shape.len() == 3 {
        return Ok(image_text(&frames::load_image(path)?));
    }
    let mut text = line("kind", "array") + &line("type", header.descr.escape_debug());
    text += &line("shape", format!("{:?}", array.shape));
    text += &line("values", spread(array.values.iter().map(|&value| value as f32)));
    Ok(text + &readers_text(path, &[]))
}

/// A TIFF file of depths.
pub(super) fn depth_text(path: &Path) -> Result<String> {
    let depth = depth::load(path)?;
    let mut text = line("kind", "depth map") + &line("size", format!("{}x{}", depth.width, depth.height));
    text += &line("depths", spread(depth.values));
    Ok(text + &readers_text(path, &[]))
}

/// The arrays of an HDF5 file.
pub(super) fn hdf5_text(path: &Path) -> Result<String> {
    let file = Hdf5::open(path, "arrays")?;
    let mut text = line("kind", "HDF5");
    let names = file.names();
    for name in &names {
        let what = file.rows(name).and_then(|rows| Ok(format!("{:?}{}", rows.shape(), reach_text(&rows)?)));
        let what = what.unwrap_or_else(|problem| format!("not read: {problem}"));
        text += &line(&name.escape_debug().to_string(), what);
    }
    Ok(text + &readers_text(path, &names))
}

/// Rows of an array that are looked at: masks of a video take gigabytes.
const ROWS: usize = 16;

/// How far the numbers of an array reach.
fn reach_text(rows: &Rows) -> Result<String, skinsplat_data::Error> {
    let Some(&count) = rows.shape().first() else { return Ok(String::new()) };
    let long = rows.shape().len() > 1 && count > ROWS;
    let looked = evenly_spaced(&(0..count).collect::<Vec<_>>(), long.then_some(ROWS));
    let values = looked.iter().map(|&row| rows.row(row)).collect::<Result<Vec<_>, _>>()?;
    let of = if long { format!(" in {ROWS} of {count} rows") } else { String::new() };
    Ok(Reach::of(values.into_iter().flatten()).map_or(String::new(), |reach| format!(", {reach}{of}")))
}

/// A text file.
pub(super) fn text_text(path: &Path) -> Result<String> {
    let text = error::read_text(path, "text", "a text file")?;
    let first: String = text.lines().next().unwrap_or_default().chars().take(60).collect();
    let text = line("kind", "text") + &line("lines", text.lines().count());
    Ok(text + &line("first line", first.escape_debug()) + &readers_text(path, &[]))
}

/// Which layouts read the file, and which of its arrays they leave; where none does, where to look.
fn readers_text(path: &Path, arrays: &[String]) -> String {
    let found = readers(path);
    if found.is_empty() {
        return line("what it is", WHOLE);
    }
    read_by(&found, arrays)
}

/// Which layouts read a file, and which of its arrays they leave.
pub(super) fn read_by(readers: &[Reader], arrays: &[String]) -> String {
    let by = |reader: &Reader| line("read by", format!("layout {}: {}", reader.layout.id, reader.part.what));
    let text: String = readers.iter().map(by).collect();
    let own = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let is_left = |name: &&String| {
        let leaves = |reader: &Reader| {
            !reader.part.arrays.is_empty() && !reader.part.arrays.contains(&own(name).as_str())
        };
        !readers.is_empty() && readers.iter().all(leaves)
    };
    let left: Vec<String> = arrays.iter().filter(is_left).cloned().collect();
    if left.is_empty() { text } else { text + &line("not read", listed(&left)) }
}
