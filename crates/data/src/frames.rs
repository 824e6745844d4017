//! Images and masks as files: PNG and JPEG through the `image` crate, `.npy` for `f32` values.

use super::npy::{self, Array};
use super::{Error, atomic, error};
use image::{DynamicImage, ImageDecoder, ImageReader};
use skinsplat_core::scene::{Image, Mask, SceneError, camera};
use std::io::Cursor;
use std::path::Path;

const IMAGE: &str = "a PNG, JPEG or .npy image";

/// No compressed image expands by more than this (deflate reaches 1032): a larger claim is refused before the pixels
/// are allocated.
const MAX_EXPANSION: u64 = 1100;

/// Loads an image, and its alpha channel if it has one. Colours are as stored: straight (un-premultiplied) sRGB values,
/// 8-bit v / 255, 16-bit v / 65535; grey is repeated, palettes are looked up, an Exif orientation is applied. An `.npy` image has shape (H, W, 3) or
/// (H, W, 4) and is read as it is.
///
/// # Errors
/// Unreadable, truncated or absurdly large files, other pixel types, values that are not finite.
pub fn load_image(path: &Path) -> Result<(Image, Option<Mask>), Error> {
    if is_npy(path) {
        return from_array(path)?.into_image(path);
    }
    image_from_bytes(path, &error::read_bytes(path, "image", IMAGE)?)
}

/// As [`load_image`], from the bytes of a PNG or JPEG file inside `path`.
pub(super) fn image_from_bytes(path: &Path, bytes: &[u8]) -> Result<(Image, Option<Mask>), Error> {
    decode(path, bytes)?.into_image(path)
}
/// Loads a mask with values in \[0, 1\]: a grey PNG or JPEG, or an `.npy` array (H, W) of booleans, 0 and 1, or 0 to
/// 255. A colour image is a mask if its channels are equal; an alpha channel is ignored.
///
/// # Errors
/// As [`load_image`], and for images of several colours.
pub fn load_mask(path: &Path) -> Result<Mask, Error> {
    let channels = if is_npy(path) {
        mask_from_array(path)?
    } else {
        decode(path, &error::read_bytes(path, "mask", IMAGE)?)?
    };
    let Channels { width, height, count, values } = channels;
    let coloured = |p: &[f32]| count >= 3 && (p[0] != p[1] || p[1] != p[2]);
    if let Some(i) = values.chunks_exact(count).position(coloured) {
        let field = format!("pixel ({}, {})", i % width, i / width);
        return Err(Error::invalid(path, field, "a colour", "a grey mask"));
    }
    let values = values.chunks_exact(count).map(|p| p[0]).collect();
    Mask::new(width, height, values).map_err(|e| Error::scene(path, e))
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
}

impl Channels {
    fn into_image(self, path: &Path) -> Result<(Image, Option<Mask>), Error> {
        let Self { width, height, count, values } = self;
        let pixel = |p: &[f32]| if count < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] };
        let pixels = values.chunks_exact(count).map(pixel).collect();
        let scene = |e: SceneError| Error::scene(path, e);
        let image = Image::new(width, height, pixels).map_err(scene)?;
        let has_alpha = count == 2 || count == 4;
        let alpha = has_alpha.then(|| values.chunks_exact(count).map(|p| p[count - 1]).collect());
        let alpha = alpha.map(|values| Mask::new(width, height, values)).transpose().map_err(scene)?;
        Ok((image, alpha))
    }
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    let broken = |cause: &dyn std::fmt::Display| Error::invalid(path, "image", cause.to_string(), IMAGE);
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| broken(&e))?;
    let mut decoder = reader.into_decoder().map_err(|e| broken(&e))?;
    let (width, height) = decoder.dimensions();
    camera::check_image_size(width, height).map_err(|refused| {
        Error::invalid(path, "image", format!("{}: {}", refused.field, refused.problem), refused.expected)
    })?;
    if decoder.total_bytes() > (bytes.len() as u64).saturating_mul(MAX_EXPANSION) {
        let problem = format!("{width}x{height} pixels in {} bytes", bytes.len());
        return Err(Error::invalid(path, "image size", problem, "a size that the file can hold"));
    }
    let orientation = decoder.orientation().map_err(|e| broken(&e))?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(|e| broken(&e))?;
    image.apply_orientation(orientation);
    let count = usize::from(image.color().channel_count());
    let values = match &image {
        DynamicImage::ImageLuma8(i) => from_u8(i.as_raw()),
        DynamicImage::ImageLumaA8(i) => from_u8(i.as_raw()),
        DynamicImage::ImageRgb8(i) => from_u8(i.as_raw()),
        DynamicImage::ImageRgba8(i) => from_u8(i.as_raw()),
        DynamicImage::ImageLuma16(i) => from_u16(i.as_raw()),
        DynamicImage::ImageLumaA16(i) => from_u16(i.as_raw()),
        DynamicImage::ImageRgb16(i) => from_u16(i.as_raw()),
        DynamicImage::ImageRgba16(i) => from_u16(i.as_raw()),
        other => return Err(broken(&format!("pixel type {:?}", other.color()))),
    };
    Ok(Channels { width: image.width() as usize, height: image.height() as usize, count, values })
}

fn from_u8(values: &[u8]) -> Vec<f32> {
    values.iter().map(|&v| f32::from(v) / 255.0).collect()
}

fn from_u16(values: &[u16]) -> Vec<f32> {
    values.iter().map(|&v| f32::from(v) / 65535.0).collect()
}

fn is_npy(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"))
}

fn from_array(path: &Path) -> Result<Channels, Error> {
    let array = finite(path, npy::read(path)?)?;
    let &[height, width, count @ (3 | 4)] = &array.shape[..] else {
        return Err(Error::invalid(
            path,
            "array",
            format!("shape {:?}", array.shape),
            "(H, W, 3) or (H, W, 4)",
        ));
    };
    Ok(Channels { width, height, count, values: array.values.iter().map(|&v| v as f32).collect() })
}

fn mask_from_array(path: &Path) -> Result<Channels, Error> {
    let array = finite(path, npy::read(path)?)?;
    let &[height, width] = &array.shape[..] else {
        return Err(Error::invalid(path, "array", format!("shape {:?}", array.shape), "(H, W)"));
    };
    let (low, high) = array.values.iter().fold((0.0f64, 0.0f64), |(l, h), &v| (l.min(v), h.max(v)));
    if low < 0.0 || high > 255.0 {
        return Err(Error::invalid(path, "array", format!("values {low} to {high}"), "0 to 1 or 0 to 255"));
    }
    let scale = if high > 1.0 { 255.0 } else { 1.0 };
    Ok(Channels {
        width,
        height,
        count: 1,
        values: array.values.iter().map(|&v| (v / scale) as f32).collect(),
    })
}

fn finite(path: &Path, array: Array) -> Result<Array, Error> {
    match array.values.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(Error::invalid(path, format!("value {i}"), "NaN or infinite", "finite values")),
        None => Ok(array),
    }
}
