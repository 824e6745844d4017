//! Structural similarity (Wang et al. 2004) in the variants of the libraries that the field uses.
//!
//! With windowed means µ, variances σ² and covariance σ_ab,
//! `SSIM = (2 µa µb + C1)(2 σab + C2) / ((µa² + µb² + C1)(σa² + σb² + C2))`, `C1 = (0.01 L)²`, `C2 = (0.03 L)²` for a value
//! range L; the mean of its map is averaged over R, G and B. Variants differ in window, border, range and normalisation.

mod settings;
mod tile;
mod window;

pub use settings::{Border, Covariance, DataRange, Precision, SsimSettings, SsimVariant, WindowShape};

use super::psnr::mean;
use super::region::Rect;
use super::{MetricsError, Planes};
use rayon::prelude::*;
use skinsplat_core::scene::Image;
use std::borrow::Cow;
use tile::{Constants, Scratch, Tile};
use window::Window;

/// Columns and rows of a tile: its moments stay in a core's second-level cache.
const TILE: (usize, usize) = (128, 32);

/// The SSIM of two images of equal size.
///
/// # Errors
/// Images of different sizes, values that are not finite, images too small for the window or its padding.
pub fn ssim(a: &Image, b: &Image, variant: SsimVariant) -> Result<f64, MetricsError> {
    let (a, b) = (Planes::new(a, "render")?, Planes::new(b, "truth")?);
    ssim_of_planes(&a, &b, &variant.settings(), variant.id(), None)
}

/// The SSIM of two images by any settings; `metric` names it in errors. `weights` (one per pixel, 0 or 1) restrict the
/// mean of the map.
///
/// # Errors
/// As [`ssim`]; also settings without meaning, a value range of zero, and weights that leave no pixel of the map.
pub fn ssim_of_planes(
    a: &Planes,
    b: &Planes,
    settings: &SsimSettings,
    metric: &'static str,
    weights: Option<&[f64]>,
) -> Result<f64, MetricsError> {
    ssim_with_borders(a, b, settings, &[(settings.border, metric)], weights).remove(0)
}

/// The SSIM for each of several borders (with the name of the variant, for errors), otherwise by the same settings: the
/// part of the map that no border reaches is computed once. The values are the same bit for bit as one by one.
pub(super) fn ssim_with_borders(
    a: &Planes,
    b: &Planes,
    settings: &SsimSettings,
    borders: &[(Border, &'static str)],
    weights: Option<&[f64]>,
) -> Vec<Result<f64, MetricsError>> {
    let metric = borders.first().map_or("ssim", |border| border.1);
    match Comparison::new(a, b, settings, metric, weights) {
        Err(error) => borders.iter().map(|_| Err(error.clone())).collect(),
        Ok(comparison) => {
            let interior = comparison.sum(&[comparison.interior()], Border::Valid);
            borders.iter().map(|&(border, metric)| comparison.mean(&interior, border, metric)).collect()
        }
    }
}

/// Two images of equal size with everything that SSIM needs but the border.
struct Comparison<'a> {
    a: Cow<'a, Planes>,
    b: Cow<'a, Planes>,
    window: Window,
    constants: Constants,
    weights: Option<&'a [f64]>,
}

impl<'a> Comparison<'a> {
    fn new(
        a: &'a Planes,
        b: &'a Planes,
        settings: &SsimSettings,
        metric: &'static str,
        weights: Option<&'a [f64]>,
    ) -> Result<Self, MetricsError> {
        MetricsError::check_size("truth", (b.width(), b.height()), (a.width(), a.height()))?;
        settings.check()?;
        let bad = |field, problem, expected| Err(MetricsError::Settings { field, problem, expected });
        match weights {
            Some(_) if settings.downsample => {
                return bad("downsample", "with weights".to_owned(), "no weights, as pixels are merged");
            }
            Some(weights) if weights.len() != a.pixels() => {
                return bad("weights", format!("{} of them", weights.len()), "one per pixel");
            }
            _ => (),
        }
        let range = match settings.data_range {
            DataRange::Fixed(range) => range,
            DataRange::Extent => [a, b]
                .map(|image| image.extent())
                .map(|(low, high)| high - low)
                .into_iter()
                .fold(0.0, f64::max),
        };
        if range == 0.0 {
            return Err(MetricsError::ZeroRange { metric });
        }
        let taps = settings.window.size() as f64;
        let covariance = match settings.covariance {
            Covariance::Population => 1.0,
            Covariance::Sample => taps * taps / (taps * taps - 1.0),
        };
        let square = |x: f64| x * x;
        let constants = Constants { c1: square(0.01 * range), c2: square(0.03 * range), covariance };
        let factor = match settings.downsample {
            true => (a.width().min(a.height()) as f64 / 256.0).round_ties_even().max(1.0) as usize,
            false => 1,
        };
        let [a, b] = [a, b].map(|image| match factor {
            1 => Cow::Borrowed(image),
            _ => Cow::Owned(average_pooled(image, factor)),
        });
        Ok(Self { a, b, window: Window::new(settings.window), constants, weights })
    }

    fn width(&self) -> usize {
        self.a.width()
    }

    fn height(&self) -> usize {
        self.a.height()
    }

    /// The pixels whose window fits into the image; empty if there are none.
    fn interior(&self) -> Rect {
        let r = self.window.radius;
        let inner = |size: usize| r.min(size)..size.saturating_sub(r).max(r.min(size));
        Rect { x: inner(self.width()), y: inner(self.height()) }
    }

    /// The pixels around the interior: above, below, left and right of it.
    fn frame(&self) -> [Rect; 4] {
        let (width, height) = (self.width(), self.height());
        let Rect { x, y } = self.interior();
        [
            Rect { x: 0..width, y: 0..y.start },
            Rect { x: 0..width, y: y.end..height },
            Rect { x: 0..x.start, y: y.clone() },
            Rect { x: x.end..width, y },
        ]
    }

    /// The mean of the map for a border, given the sums over the interior.
    fn mean(&self, interior: &[f64; 3], border: Border, metric: &'static str) -> Result<f64, MetricsError> {
        let (width, height) = (self.width(), self.height());
        let minimum = border.minimum_size(self.window.radius);
        if width.min(height) < minimum {
            return Err(MetricsError::TooSmall { metric, width, height, minimum });
        }
        let (sums, pixels) = match border {
            Border::Valid => (*interior, self.pixels(&[self.interior()])),
            Border::ZeroPad | Border::Reflect => {
                let frame = self.sum(&self.frame(), border);
                let sums = std::array::from_fn(|c| interior[c] + frame[c]);
                (sums, self.pixels(&[Rect { x: 0..width, y: 0..height }]))
            }
        };
        if pixels == 0.0 {
            return Err(MetricsError::NoCoveredPixel { metric });
        }
        Ok(mean(sums.map(|sum| sum / pixels)))
    }

    /// Number of pixels, or the sum of their weights.
    fn pixels(&self, rects: &[Rect]) -> f64 {
        let rows = rects.iter().flat_map(|rect| rect.y.clone().map(|y| (y, rect.x.clone())));
        let row = |(y, x): (usize, std::ops::Range<usize>)| match self.weights {
            None => x.len() as f64,
            Some(weights) => weights[y * self.width()..][x].iter().sum::<f64>(),
        };
        rows.map(row).sum()
    }

    /// The sum of the map over rectangles, per channel. Tiles are summed in a fixed order.
    fn sum(&self, rects: &[Rect], border: Border) -> [f64; 3] {
        let tiles: Vec<Rect> = rects.iter().flat_map(tiles_of).collect();
        let jobs: Vec<(usize, &Rect)> =
            (0..3).flat_map(|c| tiles.iter().map(move |tile| (c, tile))).collect();
        let sums: Vec<f64> = jobs
            .par_iter()
            .map_init(Scratch::default, |scratch, &(c, rect)| {
                let (a, b) = (&self.a.channels()[c], &self.b.channels()[c]);
                let tile = Tile { a, b, width: self.width(), height: self.height(), border, rect };
                tile.sum(&self.window, &self.constants, self.weights, scratch)
            })
            .collect();
        std::array::from_fn(|c| sums[c * tiles.len()..(c + 1) * tiles.len()].iter().sum())
    }
}

fn tiles_of(rect: &Rect) -> Vec<Rect> {
    let cut = |range: &std::ops::Range<usize>, step: usize| -> Vec<_> {
        range.clone().step_by(step).map(|start| start..(start + step).min(range.end)).collect()
    };
    let (columns, rows) = (cut(&rect.x, TILE.0), cut(&rect.y, TILE.1));
    let row = |y: &std::ops::Range<usize>| {
        columns.iter().map(|x| Rect { x: x.clone(), y: y.clone() }).collect::<Vec<_>>()
    };
    rows.iter().flat_map(row).collect()
}

/// Means of `factor` x `factor` blocks; what is left at the right and bottom is dropped.
fn average_pooled(image: &Planes, factor: usize) -> Planes {
    let (width, height) = (image.width() / factor, image.height() / factor);
    let pool = |plane: &Vec<f64>| {
        let block = |i: usize| {
            let (x, y) = (i % width * factor, i / width * factor);
            let rows =
                (y..y + factor).map(|row| plane[row * image.width() + x..][..factor].iter().sum::<f64>());
            rows.sum::<f64>() / (factor * factor) as f64
        };
        (0..width * height).map(block).collect()
    };
    let channels = image.channels();
    Planes::with_channels(width, height, [pool(&channels[0]), pool(&channels[1]), pool(&channels[2])])
}
