//! Images and masks as files: PNG and JPEG, `.npy` arrays.

mod array;
mod decode;

use super::{Error, atomic, error, npy};
pub(crate) use array::PLAUSIBLE;
use decode::decode;
use skinsplat_core::scene::{Image, Mask, SceneError};
use std::path::Path;

const IMAGE: &str = "a PNG, JPEG or .npy image";

/// Loads an image, and its alpha channel if it has one. Colours are as stored: straight (un-premultiplied) sRGB values,
/// 8-bit v / 255, 16-bit v / 65535; grey is repeated, palettes are looked up, an Exif orientation is applied. An `.npy`
/// image has shape (H, W, 3) or (H, W, 4): unsigned integers of 8 or 16 bits count as in a PNG, floats are read as they are.
///
/// # Errors
/// Unreadable, truncated, damaged or absurdly large files, other pixel types, values that are not finite, floats that
/// evidently run to 255.
pub fn load_image(path: &Path) -> Result<(Image, Option<Mask>), Error> {
    if is_npy(path) {
        return array::image(path)?.into_image(path);
    }
    image_from_bytes(path, &error::read_bytes(path, "image", IMAGE)?)
}

/// As [`load_image`], from the bytes of a PNG or JPEG file inside `path`.
pub(super) fn image_from_bytes(path: &Path, bytes: &[u8]) -> Result<(Image, Option<Mask>), Error> {
    decode(path, bytes)?.into_image(path)
}

/// Loads a mask with values in \[0, 1\]: a grey PNG or JPEG, or an `.npy` array (H, W) or (H, W, 1) of booleans, of 0 to 1 or of 0 to
/// 255. Integers that are only 0 and 1 count as 0 and 1. A colour image is a mask if its channels are equal. Of grey and alpha the one
/// that is not the same everywhere is the mask.
///
/// # Errors
/// As [`load_image`], for images of several colours, whose grey and alpha are two masks, and for label maps: integers of which the
/// largest is small.
pub fn load_mask(path: &Path) -> Result<Mask, Error> {
    let channels = match is_npy(path) {
        true => array::mask(path)?,
        false => {
            decode(path, &error::read_bytes(path, "mask", IMAGE)?).map_err(|e| e.renamed("image", "mask"))?
        }
    };
    let Channels { width, height, count, values, step } = channels;
    let coloured = |p: &[f32]| count >= 3 && (p[0] != p[1] || p[1] != p[2]);
    if let Some(i) = values.chunks_exact(count).position(coloured) {
        let field = format!("pixel ({}, {})", i % width, i / width);
        return Err(Error::invalid(path, field, "a colour", "a grey mask"));
    }
    let mut values = grey_or_alpha(path, &values, count)?;
    zero_and_one(path, &mut values, step)?;
    Mask::new(width, height, values).map_err(|e| Error::scene(path, e))
}

/// The grey values of a mask, or its alpha if only that says something.
fn grey_or_alpha(path: &Path, values: &[f32], count: usize) -> Result<Vec<f32>, Error> {
    let channel = |c: usize| -> Vec<f32> { values.chunks_exact(count).map(|p| p[c]).collect() };
    let same = |values: &[f32]| values.iter().all(|v| Some(v) == values.first());
    let grey = channel(0);
    if count == 1 || count == 3 {
        return Ok(grey);
    }
    let alpha = channel(count - 1);
    if same(&alpha) {
        return Ok(grey);
    }
    if same(&grey) {
        return Ok(alpha);
    }
    let differ = grey.iter().zip(&alpha).filter(|(g, a)| (**g > 0.5) != (**a > 0.5)).count();
    match differ * 100 <= grey.len() {
        true => Ok(grey),
        false => Err(Error::invalid(path, "mask", "grey and alpha are two masks", "one of them alone")),
    }
}

/// Integers of at most this are labels, not coverages.
const LARGEST_LABEL: f32 = 31.0;
/// In 16 bits those of 8 are, too.
const LARGEST_LABEL_OF_16_BITS: f32 = 255.0;

/// Masks of 0 and 1 in integers of which the smallest is stored as `step` and the largest possible as 1.
fn zero_and_one(path: &Path, values: &mut [f32], step: f32) -> Result<(), Error> {
    let high = values.iter().fold(0.0_f32, |high, &v| high.max(v));
    let integer = (high / step).round();
    let largest = if step < 1e-3 { LARGEST_LABEL_OF_16_BITS } else { LARGEST_LABEL };
    if step >= 1.0 || integer == 0.0 || integer > largest || high == 1.0 {
        return Ok(());
    }
    if integer > 1.0 {
        let problem = format!("the largest value is {integer} of {}: a map of labels?", (1.0 / step).round());
        let expected = "the highest value where the person is, or 0 and 1 only";
        return Err(Error::invalid(path, "mask", problem, expected));
    }
    values.iter_mut().for_each(|v| *v = (*v / step).round());
    Ok(())
}

/// What a mask holds, as it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredRange {
    /// The largest integer.
    pub largest: f32,
    /// The largest that its type can hold.
    pub full: f32,
}

/// The range of a mask in an image; none for arrays.
///
/// # Errors
/// As [`load_image`].
pub fn stored_range(path: &Path) -> Result<Option<StoredRange>, Error> {
    if is_npy(path) {
        return Ok(None);
    }
    let Channels { values, step, count, .. } = decode(path, &error::read_bytes(path, "mask", IMAGE)?)?;
    let high = values.chunks_exact(count).fold(0.0_f32, |high, pixel| high.max(pixel[0]));
    Ok(Some(StoredRange { largest: (high / step).round(), full: (1.0 / step).round() }))
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// Writes an 8-bit RGB PNG. Values are clamped to \[0, 1\] and rounded to the nearest 1/255, halves up; NaN becomes 0.
///
/// # Errors
/// If the file cannot be written.
pub fn save_png(path: &Path, image: &Image) -> Result<(), Error> {
    let bytes: Vec<u8> = image.pixels().as_flattened().iter().map(|&v| quantised(v)).collect();
    encode(path, &bytes, image.width(), image.height(), image::ExtendedColorType::Rgb8)
}

/// Writes an 8-bit RGBA PNG with straight alpha, rounded as by [`save_png`].
///
/// # Errors
/// If the sizes differ or the file cannot be written.
pub fn save_png_with_alpha(path: &Path, image: &Image, alpha: &Mask) -> Result<(), Error> {
    let (width, height) = (image.width(), image.height());
    if (alpha.width(), alpha.height()) != (width, height) {
        let problem = format!("{}x{}", alpha.width(), alpha.height());
        return Err(Error::invalid(path, "alpha", problem, format!("the image's {width}x{height}")));
    }
    let pixels = image.pixels().iter().zip(alpha.values());
    let bytes: Vec<u8> = pixels.flat_map(|(&[r, g, b], &a)| [r, g, b, a].map(quantised)).collect();
    encode(path, &bytes, width, height, image::ExtendedColorType::Rgba8)
}

/// Writes a mask as an 8-bit grey PNG, rounded as by [`save_png`].
///
/// # Errors
/// If the file cannot be written.
pub fn save_mask_png(path: &Path, mask: &Mask) -> Result<(), Error> {
    let bytes: Vec<u8> = mask.values().iter().map(|&v| quantised(v)).collect();
    encode(path, &bytes, mask.width(), mask.height(), image::ExtendedColorType::L8)
}

/// Writes an image as a little-endian `f32` array (H, W, 3), unclamped.
///
/// # Errors
/// If the file cannot be written.
pub fn save_npy(path: &Path, image: &Image) -> Result<(), Error> {
    let values = image.pixels().as_flattened().iter().copied();
    npy::write_f32(path, &[image.height(), image.width(), 3], values)
}

fn quantised(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

fn encode(
    path: &Path,
    bytes: &[u8],
    width: usize,
    height: usize,
    colour: image::ExtendedColorType,
) -> Result<(), Error> {
    use image::ImageEncoder;
    atomic::write(path, |w| {
        image::codecs::png::PngEncoder::new(w)
            .write_image(bytes, width as u32, height as u32, colour)
            .map_err(|e| match e {
                image::ImageError::IoError(cause) => cause,
                other => std::io::Error::other(other),
            })
    })
}

/// Interleaved channels: 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
struct Channels {
    width: usize,
    height: usize,
    count: usize,
    values: Vec<f32>,
    /// What the integer 1 became: 1/255 for 8 bits, 1 for floats and booleans.
    step: f32,
}

impl Channels {
    fn into_image(self, path: &Path) -> Result<(Image, Option<Mask>), Error> {
        let Self { width, height, count, values, step } = self;
        let pixel = |p: &[f32]| if count < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] };
        let pixels = values.chunks_exact(count).map(pixel).collect();
        let scene = |e: SceneError| Error::scene(path, e);
        let image = Image::new(width, height, pixels).map_err(scene)?;
        let has_alpha = count == 2 || count == 4;
        let alpha: Option<Vec<f32>> =
            has_alpha.then(|| values.chunks_exact(count).map(|p| p[count - 1]).collect());
        // As masks: 0 and 1 of integers are no cover and full cover.
        let alpha = alpha.map(|mut alpha| {
            if step < 1.0 && alpha.iter().all(|a| *a <= step) {
                alpha.iter_mut().for_each(|a| *a = (*a / step).round());
            }
            alpha
        });
        let alpha = alpha.map(|values| Mask::new(width, height, values)).transpose().map_err(scene)?;
        Ok((image, alpha))
    }
}

fn is_npy(path: &Path) -> bool {
    has_extension(path, &["npy"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_grey_and_alpha_the_one_that_says_something_is_the_mask() {
        let read = |pairs: &[f32]| grey_or_alpha(Path::new("mask.png"), pairs, 2);
        assert_eq!(read(&[1.0, 0.0, 1.0, 1.0]).unwrap(), [0.0, 1.0], "alpha");
        assert_eq!(read(&[0.0, 1.0, 1.0, 1.0]).unwrap(), [0.0, 1.0], "grey");
        assert_eq!(read(&[0.0, 0.1, 1.0, 0.9]).unwrap(), [0.0, 1.0], "both, alike");
        assert!(read(&[0.0, 1.0, 1.0, 0.0]).unwrap_err().to_string().contains("two masks"));
    }

    #[test]
    fn labels_are_no_coverage() {
        let read = |values: &[f32], step: f32| {
            let mut values: Vec<f32> = values.iter().map(|v| v * step).collect();
            zero_and_one(Path::new("mask.png"), &mut values, step).map(|()| values)
        };
        let eight = 1.0 / 255.0;
        assert_eq!(read(&[0.0, 1.0], eight).unwrap(), [0.0, 1.0]);
        assert_eq!(read(&[0.0, 1.0], 1.0 / 65535.0).unwrap(), [0.0, 1.0]);
        assert_eq!(read(&[0.0, 1.0], 1.0 / 15.0).unwrap(), [0.0, 1.0]);
        assert_eq!(read(&[0.0, 64.0], eight).unwrap(), [0.0, 64.0 * eight]);
        assert_eq!(read(&[0.0, 0.0], eight).unwrap(), [0.0, 0.0]);
        assert_eq!(read(&[0.0, 0.3], 1.0).unwrap(), [0.0, 0.3]);
        assert!(read(&[0.0, 255.0], 1.0 / 65535.0).unwrap_err().to_string().contains("255 of 65535"));
        assert!(read(&[0.0, 3.0, 19.0], eight).unwrap_err().to_string().contains("19 of 255"));
    }
}
