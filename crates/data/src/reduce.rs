//! Smaller images by exact area averages, of straight colours under their alpha.

use super::Truth;
use skinsplat_core::scene::{Image, Mask};

/// The truth at another, not larger, size: each new pixel averages the area that it covers, colours weighted by alpha
/// unless they are those of a whole picture. Equal to what a camera with larger box-shaped pixels would have seen.
pub(super) fn reduced(truth: &Truth, width: usize, height: usize) -> Truth {
    let Truth { rgb, alpha, background } = truth;
    let whole = Mask::filled(rgb.width(), rgb.height(), 1.0);
    let (straight, alphas) = averaged(rgb, alpha, width, height);
    let Some(background) = background else { return Truth::new(straight, alphas) };
    let picture = |image: &Image| averaged(image, &whole, width, height).0;
    Truth { rgb: picture(rgb), alpha: alphas, background: Some(picture(background)) }
}

/// Averages of colours, weighted by alpha, and of alpha.
fn averaged(rgb: &Image, alpha: &Mask, width: usize, height: usize) -> (Image, Mask) {
    let columns = spans(rgb.width(), width);
    let rows = spans(rgb.height(), height);
    let (mut pixels, mut alphas) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
    for row in &rows {
        for column in &columns {
            let (mut colour, mut covered_area, mut area) = ([0.0f64; 3], 0.0f64, 0.0f64);
            for &(y, row_weight) in row {
                for &(x, column_weight) in column {
                    let weight = row_weight * column_weight;
                    let covered = weight * f64::from(alpha.at(x, y));
                    let rgb = rgb.at(x, y);
                    (0..3).for_each(|c| colour[c] += covered * f64::from(rgb[c]));
                    covered_area += covered;
                    area += weight;
                }
            }
            pixels.push(colour.map(|sum| if covered_area > 0.0 { (sum / covered_area) as f32 } else { 0.0 }));
            alphas.push((covered_area / area) as f32);
        }
    }
    let image = Image::new(width, height, pixels).expect("one pixel per row and column");
    (image, Mask::new(width, height, alphas).expect("one value per row and column"))
}

/// For each new pixel, the old pixels under it and the share of each that it covers.
fn spans(old: usize, new: usize) -> Vec<Vec<(usize, f64)>> {
    let ratio = old as f64 / new as f64;
    let span = |i: usize| {
        let (start, end) = (i as f64 * ratio, ((i + 1) as f64 * ratio).min(old as f64));
        let first = start.floor() as usize;
        let last = (end.ceil() as usize).clamp(first + 1, old);
        let share = |x: usize| (x, ((x + 1) as f64).min(end) - (x as f64).max(start));
        (first..last).map(share).filter(|(_, share)| *share > 1e-9).collect()
    };
    (0..new).map(span).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_averaged_and_colours_weighted_by_alpha() {
        let rgb = Image::new(4, 1, vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2; 3], [0.6; 3]]).unwrap();
        let alpha = Mask::new(4, 1, vec![1.0, 0.0, 0.5, 0.5]).unwrap();
        let half = reduced(&Truth::new(rgb, alpha), 2, 1);
        assert_eq!(half.alpha.values(), [0.5, 0.5]);
        assert_eq!(half.rgb.at(0, 0), [1.0, 0.0, 0.0], "what alpha hides does not bleed in");
        assert!((half.rgb.at(1, 0)[0] - 0.4).abs() < 1e-6);
    }

    #[test]
    fn odd_ratios_keep_the_mean() {
        let values: Vec<f32> = (0..35).map(|i| (i * i % 17) as f32 / 17.0).collect();
        let rgb = Image::new(7, 5, values.iter().map(|&v| [v, 1.0 - v, 0.5]).collect()).unwrap();
        let small = reduced(&Truth::new(rgb, Mask::filled(7, 5, 1.0)), 3, 2);
        let mean = small.rgb.pixels().iter().map(|p| p[0]).sum::<f32>() / 6.0;
        assert!((mean - values.iter().sum::<f32>() / 35.0).abs() < 1e-6);
        assert!(small.alpha.values().iter().all(|&a| (a - 1.0).abs() < 1e-6));
    }
}
