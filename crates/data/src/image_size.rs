//! The size of an image, from its header.

use super::{Error, frames, source};
use image::metadata::Orientation;
use image::{ImageDecoder, ImageReader};
use skinsplat_core::scene::camera;
use std::io::BufReader;
use std::path::Path;

/// Width and height of an image as [`frames::load_image`] would return it; only `.npy` files are read whole.
///
/// # Errors
/// As [`frames::load_image`], for what the header says.
pub(crate) fn of(path: &Path) -> Result<[u32; 2], Error> {
    const EXPECTED: &str = "a PNG, JPEG or .npy image";
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        let (image, _) = frames::load_image(path)?;
        return Ok([image.width() as u32, image.height() as u32]);
    }
    let broken = |cause: &dyn std::fmt::Display| Error::invalid(path, "image", cause.to_string(), EXPECTED);
    let file = source::open(path).map_err(|cause| Error::read(path, "image", EXPECTED, cause))?;
    let reader = ImageReader::new(BufReader::new(file)).with_guessed_format().map_err(|e| broken(&e))?;
    let mut decoder = reader.into_decoder().map_err(|e| broken(&e))?;
    let (width, height) = decoder.dimensions();
    let size = match decoder.orientation().map_err(|e| broken(&e))? {
        Orientation::Rotate90
        | Orientation::Rotate270
        | Orientation::Rotate90FlipH
        | Orientation::Rotate270FlipH => [height, width],
        _ => [width, height],
    };
    camera::check_image_size(size[0], size[1]).map_err(|e| Error::scene(path, e))?;
    Ok(size)
}
