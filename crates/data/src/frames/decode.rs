//! PNG and JPEG files as channels.

use super::{Channels, Error, IMAGE, error};
use crate::jpeg_scan;
use image::codecs::png::PngDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageDecoder, RgbImage};
use skinsplat_core::scene::camera;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// No compressed image expands by more than this (deflate reaches 1032): a larger claim is refused before the pixels
/// are allocated.
const MAX_EXPANSION: u64 = 1100;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const JPEG: &[u8] = b"\xFF\xD8\xFF";

/// Decodes a PNG or JPEG file, told apart by content.
///
/// # Errors
/// Whatever is wrong with the file, once, in one line.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    match bytes {
        _ if bytes.starts_with(PNG) => png(path, bytes),
        _ if bytes.starts_with(JPEG) => jpeg(path, bytes),
        [] => Err(broken(path, "an empty file")),
        _ => Err(broken(path, error::disguise(bytes).unwrap_or("neither PNG nor JPEG"))),
    }
}

fn broken(path: &Path, cause: impl std::fmt::Display) -> Error {
    Error::invalid(path, "image", cause.to_string(), IMAGE)
}

/// Pixels of an image of whatever length.
const PIXELS: u64 = 1 << 24;
/// Pixels beyond those per byte of the file: photographs have less than twenty, drawings and masks are rarely so large.
const PIXELS_PER_BYTE: u64 = 64;

/// Of an image whose pixels become one value (grey) or three; alpha does not count.
fn check_size(path: &Path, width: u32, height: u32, values: u64, length: usize) -> Result<(), Error> {
    camera::check_image_size(width, height).map_err(|refused| {
        Error::invalid(path, "image", format!("{}: {}", refused.field, refused.problem), refused.expected)
    })?;
    // Grey takes a third of the memory.
    let pixels = (PIXELS + PIXELS_PER_BYTE * length as u64) * 3 / values;
    if u64::from(width) * u64::from(height) > pixels {
        let problem = format!("{width}x{height} pixels in {length} bytes");
        let expected = format!(
            "at most {PIXELS} pixels, and {PIXELS_PER_BYTE} more per byte of the file; of grey three times as many"
        );
        return Err(Error::invalid(path, "image size", problem, expected));
    }
    Ok(())
}

fn png(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    let mut decoder = PngDecoder::new(Cursor::new(bytes)).map_err(|e| broken(path, e))?;
    let (width, height) = decoder.dimensions();
    let Stored { bits, samples, values } = Stored::of(bytes).ok_or_else(|| broken(path, "no header"))?;
    check_size(path, width, height, values, bytes.len())?;
    let row = (u64::from(width) * u64::from(bits) * u64::from(samples)).div_ceil(8) + 1;
    if row * u64::from(height) > (bytes.len() as u64).saturating_mul(MAX_EXPANSION) {
        let problem = format!("{width}x{height} pixels in {} bytes", bytes.len());
        return Err(Error::invalid(path, "image size", problem, "a size that the file can hold"));
    }
    let orientation = decoder.orientation().map_err(|e| broken(path, e))?;
    let image = undisturbed(path, || DynamicImage::from_decoder(decoder).map_err(|e| broken(path, e)))?;
    // Grey of fewer than 8 bits is stretched over 8.
    let depth = if bits < 8 && samples == 1 { 1.0 / f32::from((1_u16 << bits) - 1) } else { 1.0 / 255.0 };
    channels(path, image, orientation, depth)
}

/// A decoder's answer, and an error where it panics: some are known to, on damaged palettes.
fn undisturbed<T>(path: &Path, decode: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|panic| {
        drop(panic);
        Err(broken(path, "no decoder can read it"))
    })
}

/// How a PNG stores its pixels.
struct Stored {
    /// Bits per sample.
    bits: u8,
    /// Samples per pixel.
    samples: u8,
    /// Values per pixel that they become, without alpha.
    values: u64,
}

impl Stored {
    /// From the header, the first chunk of every PNG.
    fn of(bytes: &[u8]) -> Option<Self> {
        let (samples, values) = match bytes.get(25)? {
            0 => (1, 1),
            3 => (1, 3),
            2 => (3, 3),
            4 => (2, 1),
            6 => (4, 3),
            _ => return None,
        };
        Some(Self { bits: *bytes.get(24)?, samples, values })
    }
}

/// Strict: a damaged or truncated scan is no picture.
fn jpeg(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    let options = DecoderOptions::default().set_strict_mode(true);
    let options = options.set_max_width(usize::from(u16::MAX)).set_max_height(usize::from(u16::MAX));
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| broken(path, e))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| broken(path, "no size"))?;
    let (width, height) = (width as u32, height as u32);
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    check_size(path, width, height, if grey { 1 } else { 3 }, bytes.len())?;
    let colours = if grey { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(colours));
    let pixels = undisturbed(path, || decoder.decode().map_err(|e| broken(path, e)))?;
    if !ends(bytes) {
        return Err(broken(path, "truncated: no end of the image"));
    }
    // Decoders put grey where a damaged scan says nothing.
    jpeg_scan::check(bytes).map_err(|damage| broken(path, damage))?;
    let orientation = decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif));
    let image = match grey {
        true => GrayImage::from_raw(width, height, pixels).map(DynamicImage::from),
        false => RgbImage::from_raw(width, height, pixels).map(DynamicImage::from),
    };
    let image = image.ok_or_else(|| broken(path, "fewer pixels than its size"))?;
    channels(path, image, orientation.unwrap_or(Orientation::NoTransforms), 1.0 / 255.0)
}

/// Whether an end-of-image marker follows the last scan (ITU T.81, B.1.1.2): inside a scan, 0xFF is followed by 0x00.
fn ends(jpeg: &[u8]) -> bool {
    let scan = jpeg.windows(2).rposition(|marker| marker == [0xFF, 0xDA]).unwrap_or(0);
    jpeg[scan..].windows(2).any(|marker| marker == [0xFF, 0xD9])
}

fn channels(
    path: &Path,
    mut image: DynamicImage,
    turned: Orientation,
    grey_step: f32,
) -> Result<Channels, Error> {
    image.apply_orientation(turned);
    let count = usize::from(image.color().channel_count());
    let (width, height) = (image.width() as usize, image.height() as usize);
    let eight = |values: &[u8]| (values.iter().map(|&v| f32::from(v) / 255.0).collect(), grey_step);
    let sixteen = |values: &[u16]| (values.iter().map(|&v| f32::from(v) / 65535.0).collect(), 1.0 / 65535.0);
    let (values, step) = match &image {
        DynamicImage::ImageLuma8(i) => eight(i.as_raw()),
        DynamicImage::ImageLumaA8(i) => eight(i.as_raw()),
        DynamicImage::ImageRgb8(i) => eight(i.as_raw()),
        DynamicImage::ImageRgba8(i) => eight(i.as_raw()),
        DynamicImage::ImageLuma16(i) => sixteen(i.as_raw()),
        DynamicImage::ImageLumaA16(i) => sixteen(i.as_raw()),
        DynamicImage::ImageRgb16(i) => sixteen(i.as_raw()),
        DynamicImage::ImageRgba16(i) => sixteen(i.as_raw()),
        other => return Err(broken(path, format!("pixel type {:?}", other.color()))),
    };
    Ok(Channels { width, height, count, values, step })
}
