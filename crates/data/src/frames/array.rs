//! Images and masks as `.npy` arrays.

use super::Channels;
use crate::{Error, npy};
use skinsplat_core::scene::camera;
use std::ops::RangeInclusive;
use std::path::Path;

/// Floats beyond these are no colours in \[0, 1\], not even those of an unclamped render.
pub(crate) const PLAUSIBLE: RangeInclusive<f64> = -0.5..=8.0;

/// (H, W, 3) or (H, W, 4).
pub(super) fn image(path: &Path) -> Result<Channels, Error> {
    let Stored { shape, values, full } = Stored::read(path)?;
    let &[height, width, count @ (3 | 4)] = &shape[..] else {
        let problem = format!("shape {shape:?}");
        return Err(Error::invalid(path, "array", problem, "(H, W, 3) or (H, W, 4)"));
    };
    check_size(path, width, height)?;
    let (low, high) = range(&values);
    if full.is_none() && !(PLAUSIBLE.contains(&low) && PLAUSIBLE.contains(&high)) {
        let problem = format!("floats from {low} to {high}");
        return Err(Error::invalid(
            path,
            "array",
            problem,
            "sRGB values in [0, 1], or integers of 8 or 16 bits",
        ));
    }
    Ok(Channels { width, height, count, values: scaled(&values, full.unwrap_or(1.0)), step: 1.0 })
}

/// (H, W) or (H, W, 1), 0 to 1 or 0 to the integers' largest.
pub(super) fn mask(path: &Path) -> Result<Channels, Error> {
    let Stored { shape, values, full } = Stored::read(path)?;
    let (&[height, width] | &[height, width, 1]) = &shape[..] else {
        return Err(Error::invalid(path, "array", format!("shape {shape:?}"), "(H, W) or (H, W, 1)"));
    };
    check_size(path, width, height)?;
    let (low, high) = range(&values);
    let full = full.unwrap_or(if high > 1.0 { 255.0 } else { 1.0 });
    if low < 0.0 || high > full {
        return Err(Error::invalid(path, "array", format!("values {low} to {high}"), "0 to 1 or 0 to 255"));
    }
    Ok(Channels { width, height, count: 1, values: scaled(&values, full), step: (1.0 / full) as f32 })
}

/// An array of finite numbers.
struct Stored {
    shape: Vec<usize>,
    values: Vec<f64>,
    /// The integers' largest value; none for floats and booleans.
    full: Option<f64>,
}

impl Stored {
    fn read(path: &Path) -> Result<Self, Error> {
        let (header, array) = npy::read_with_header(path)?;
        let full = match header.descr.get(1..).unwrap_or_default() {
            "u1" => Some(255.0),
            "u2" => match range(&array.values).1 {
                // Black, or the 8 bits of another type.
                high if high > 1.0 && high <= 255.0 => {
                    let problem = format!("type {}, values up to {high}", header.descr);
                    let expected = "values up to 65535, or 8 bits as |u1";
                    return Err(Error::invalid(path, "array", problem, expected));
                }
                _ => Some(65535.0),
            },
            kind if kind.starts_with('u') || kind.starts_with('i') => match range(&array.values) {
                // Wider integers hold what 8 bits hold.
                (low, high) if low >= 0.0 && high <= 255.0 => Some(255.0),
                (low, high) => {
                    let problem = format!("type {}, values {low} to {high}", header.descr);
                    return Err(Error::invalid(path, "array", problem, "integers from 0 to 255, or floats"));
                }
            },
            _ => None,
        };
        if let Some(i) = array.values.iter().position(|v| !v.is_finite()) {
            return Err(Error::invalid(path, format!("value {i}"), "NaN or infinite", "finite values"));
        }
        Ok(Self { shape: array.shape, values: array.values, full })
    }
}

fn check_size(path: &Path, width: usize, height: usize) -> Result<(), Error> {
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    camera::check_image_size(side(width), side(height)).map_err(|refused| Error::scene(path, refused))
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((0.0, 0.0), |(low, high), &v| (v.min(low), v.max(high)))
}

/// The values over the largest, rounded as those of a PNG are.
fn scaled(values: &[f64], full: f64) -> Vec<f32> {
    values.iter().map(|&v| v as f32 / full as f32).collect()
}
