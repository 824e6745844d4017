//! Files that are parts of a subject: arrays, depth maps, HDF5, text. What they mean is said of their folder.

use super::{image_text, line, spread};
use anyhow::Result;
use skinsplat_data::hdf5::Hdf5;
use skinsplat_data::{depth, error, frames, npy};
use std::path::Path;

/// Whose meaning a part has.
const WHOLE: &str = "see its subject's folder: reproduce inspect FOLDER";

/// An `.npy` file: an image if it has three axes.
pub(super) fn array_text(path: &Path) -> Result<String> {
    let (header, array) = npy::read_with_header(path)?;
    if array.shape.len() == 3 {
        return Ok(image_text(&frames::load_image(path)?));
    }
    let mut text = line("kind", "array") + &line("type", header.descr.escape_debug());
    text += &line("shape", format!("{:?}", array.shape));
    text += &line("values", spread(array.values.iter().map(|&value| value as f32)));
    Ok(text + &line("what it is", WHOLE))
}

/// A TIFF file of depths.
pub(super) fn depth_text(path: &Path) -> Result<String> {
    let depth = depth::load(path)?;
    let mut text = line("kind", "depth map") + &line("size", format!("{}x{}", depth.width, depth.height));
    text += &line("depths", spread(depth.values));
    Ok(text + &line("what it is", WHOLE))
}

/// The arrays of an HDF5 file.
pub(super) fn hdf5_text(path: &Path) -> Result<String> {
    let file = Hdf5::open(path, "arrays")?;
    let mut text = line("kind", "HDF5");
    for name in file.names() {
        let shape = match file.rows(&name) {
            Ok(rows) => format!("{:?}", rows.shape()),
            Err(problem) => format!("not read: {problem}"),
        };
        text += &line(&name.escape_debug().to_string(), shape);
    }
    Ok(text + &line("what it is", WHOLE))
}

/// A text file.
pub(super) fn text_text(path: &Path) -> Result<String> {
    let text = error::read_text(path, "text", "a text file")?;
    let first: String = text.lines().next().unwrap_or_default().chars().take(60).collect();
    let text = line("kind", "text") + &line("lines", text.lines().count());
    Ok(text + &line("first line", first.escape_debug()) + &line("what it is", WHOLE))
}
