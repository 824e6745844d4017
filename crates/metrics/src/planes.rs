//! The images that metrics see: three planes of f64.

use super::MetricsError;
use super::region::Rect;
use rayon::prelude::*;
use skinsplat_core::scene::{Image, Mask};

/// How close an f32 must be to k / 255 to have come from the 8-bit value k: one rounding step of f32 at 1, so that
/// both `k / 255` and `k * (1 / 255)` in f32 are recognised.
const LEVEL_TOLERANCE: f64 = 1.0 / (1 << 24) as f64;

/// An RGB image as three row-major planes of f64 sRGB values.
///
/// A value that is k / 255 rounded to f32 becomes k / 255 in f64: images from 8-bit files are then exact, and metrics of
/// nearly equal images (where the f32 rounding would show in the fifth digit of the PSNR) agree with references that
/// divide in f64.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    width: usize,
    height: usize,
    channels: [Vec<f64>; 3],
}

impl Planes {
    /// Converts an image. `field` names it in errors ("render", "truth").
    ///
    /// # Errors
    /// A NaN or an infinity, with its coordinates.
    pub fn new(image: &Image, field: &'static str) -> Result<Self, MetricsError> {
        Self::by_rows(image, field, |_, _| ())
    }

    /// Converts an image and passes each row (its number and its R, G and B values) to a function that may change it.
    ///
    /// # Errors
    /// A NaN or an infinity in the image, with its coordinates.
    pub(crate) fn by_rows(
        image: &Image,
        field: &'static str,
        change: impl Fn(usize, [&mut [f64]; 3]) + Sync,
    ) -> Result<Self, MetricsError> {
        let (width, height) = (image.width(), image.height());
        check_finite(image, field)?;
        let plane = || vec![0.0; width * height];
        let [mut red, mut green, mut blue] = [plane(), plane(), plane()];
        let rows = image.pixels().par_chunks(width).enumerate();
        let planes =
            red.par_chunks_mut(width).zip(green.par_chunks_mut(width)).zip(blue.par_chunks_mut(width));
        rows.zip(planes).for_each(|((y, pixels), ((red, green), blue))| {
            let mut row = [red, green, blue];
            for (c, values) in row.iter_mut().enumerate() {
                for (value, pixel) in values.iter_mut().zip(pixels) {
                    *value = exact_level(pixel[c]);
                }
            }
            change(y, row);
        });
        Ok(Self { width, height, channels: [red, green, blue] })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// The R, G and B planes, row-major.
    pub fn channels(&self) -> &[Vec<f64>; 3] {
        &self.channels
    }

    /// Smallest and largest value of all channels.
    pub fn extent(&self) -> (f64, f64) {
        let values = self.channels.iter().flatten();
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
    }

    /// The part inside a rectangle that lies within the image.
    pub(crate) fn crop(&self, rect: &Rect) -> Self {
        let cut = |plane: &Vec<f64>| rect.cut(plane, self.width);
        let channels = [cut(&self.channels[0]), cut(&self.channels[1]), cut(&self.channels[2])];
        Self { width: rect.x.len(), height: rect.y.len(), channels }
    }

    /// From three planes of `width * height` values.
    pub(crate) fn with_channels(width: usize, height: usize, channels: [Vec<f64>; 3]) -> Self {
        debug_assert!(channels.iter().all(|plane| plane.len() == width * height));
        Self { width, height, channels }
    }
}

/// The value as f64; if it is an 8-bit level rounded to f32, the level itself.
#[inline(always)]
pub(crate) fn exact_level(value: f32) -> f64 {
    let value = f64::from(value);
    let level = nearest(value * 255.0) / 255.0;
    if (level - value).abs() <= LEVEL_TOLERANCE { level } else { value }
}

/// The integer nearest to a value of magnitude below 2^51, ties to even: where f64 has no digits after the point, adding
/// rounds. Unlike `round`, additions are vector instructions on every machine.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const NO_FRACTION: f64 = 1.5 * (1u64 << 52) as f64;
    (value + NO_FRACTION) - NO_FRACTION
}

/// The largest integer that is not above a value of magnitude below 2^51.
#[inline(always)]
pub(crate) fn floor(value: f64) -> f64 {
    let near = nearest(value);
    if near > value { near - 1.0 } else { near }
}

fn check_finite(image: &Image, field: &'static str) -> Result<(), MetricsError> {
    // 0 * v is NaN exactly if v is not finite: one comparison per pixel in the usual case.
    let pixels = image.pixels();
    match pixels.iter().position(|rgb| !(rgb[0] * 0.0 + rgb[1] * 0.0 + rgb[2] * 0.0 == 0.0)) {
        None => Ok(()),
        Some(i) => {
            let channel = pixels[i].iter().position(|v| !v.is_finite()).unwrap_or(0);
            let (x, y) = (i % image.width(), i / image.width());
            Err(MetricsError::NotFinite { field, x, y, channel, value: pixels[i][channel] })
        }
    }
}

/// Checks a mask's size and values.
pub(crate) fn check_mask(mask: &Mask, field: &'static str, size: (usize, usize)) -> Result<(), MetricsError> {
    MetricsError::check_size(field, (mask.width(), mask.height()), size)?;
    match mask.values().iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(i) => {
            let (x, y) = (i % mask.width(), i / mask.width());
            Err(MetricsError::NotFinite { field, x, y, channel: 0, value: mask.values()[i] })
        }
    }
}
