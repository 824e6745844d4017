//! Errors in numbers that a person can weigh: degrees and decibels.

use super::Error;
use serde::{Serialize, Serializer};
use skinsplat_core::math::portable;
use skinsplat_core::scene::Image;
use skinsplat_metrics::{ErrorSums, Planes, psnr::mean};

/// The distribution of angles between what a choice answers and the exact rotations, degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Degrees {
    /// Median.
    pub median: f64,
    /// 95 % of the Gaussians are no further off (nearest rank).
    pub p95: f64,
    /// The worst.
    pub max: f64,
}

impl Degrees {
    /// The statistics of some angles in degrees; none of none.
    pub fn of(angles: &[f64]) -> Option<Self> {
        let mut sorted = angles.to_vec();
        sorted.sort_by(f64::total_cmp);
        // Nearest rank: the least value that at least the share p of all values does not exceed.
        let rank = |p: f64| ((p * sorted.len() as f64).ceil() as usize).saturating_sub(1);
        let max = *sorted.last()?;
        Some(Self { median: sorted[rank(0.5)], p95: sorted[rank(0.95)], max })
    }
}

/// How like the exact images the images of a choice are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fidelity {
    /// Not one bit differs.
    Exact,
    /// PSNR of the mean squared error over all frames, dB.
    Decibels(f64),
}

impl Fidelity {
    /// From a mean squared error.
    pub fn of(mean_squared_error: f64) -> Self {
        if mean_squared_error == 0.0 {
            Self::Exact
        } else {
            Self::Decibels(-10.0 * portable::log10(mean_squared_error))
        }
    }

    /// Compares images pairwise, all pixels of all pairs counting equally.
    ///
    /// # Errors
    /// Images of different sizes or with values that are not finite.
    pub fn between<'a>(pairs: impl IntoIterator<Item = (&'a Image, &'a Image)>) -> Result<Self, Error> {
        let (mut squared, mut pixels) = (0.0, 0.0);
        for (image, exact) in pairs {
            let sums = ErrorSums::new(&Planes::new(image, "image")?, &Planes::new(exact, "exact")?, None)?;
            squared += mean(sums.squared);
            pixels += sums.pixels;
        }
        Ok(Self::of(squared / f64::max(pixels, 1.0)))
    }

    /// dB, infinite if exact.
    pub fn decibels(self) -> f64 {
        match self {
            Self::Exact => f64::INFINITY,
            Self::Decibels(value) => value,
        }
    }
}

impl Serialize for Fidelity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Exact => serializer.serialize_str("exact"),
            Self::Decibels(value) => serializer.serialize_f64(*value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occur() {
        let angles: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(Degrees::of(&angles), Some(Degrees { median: 50.0, p95: 95.0, max: 100.0 }));
        assert_eq!(Degrees::of(&[2.0, 1.0]), Some(Degrees { median: 1.0, p95: 2.0, max: 2.0 }));
        assert_eq!(Degrees::of(&[3.0]), Some(Degrees { median: 3.0, p95: 3.0, max: 3.0 }));
        assert_eq!(Degrees::of(&[]), None);
    }

    #[test]
    fn equal_images_are_exact_and_known_errors_have_known_decibels() {
        let (a, b) = (Image::filled(4, 3, [0.5; 3]), Image::filled(4, 3, [0.6, 0.5, 0.5]));
        assert_eq!(Fidelity::between([(&a, &a), (&b, &b)]).unwrap(), Fidelity::Exact);
        let Fidelity::Decibels(value) = Fidelity::between([(&a, &b), (&a, &a)]).unwrap() else {
            panic!("they differ");
        };
        // One channel of three, one image of two: an MSE of 0.01 / 6.
        assert!((value - -10.0 * (0.01_f64 / 6.0).log10()).abs() < 1e-5, "{value}");
        assert_eq!(Fidelity::Exact.decibels(), f64::INFINITY);
        assert_eq!(serde_json::to_string(&Fidelity::Exact).unwrap(), "\"exact\"");
    }

    #[test]
    fn images_of_other_sizes_are_refused() {
        let (a, b) = (Image::filled(4, 3, [0.5; 3]), Image::filled(3, 4, [0.5; 3]));
        assert!(Fidelity::between([(&a, &b)]).is_err());
    }
}
