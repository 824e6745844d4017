//! Intersection over union of two masks with values between zero and one.

/// The Tanimoto coefficient `Σ c m / Σ (c² + m² - c m)` and its derivative by every `c`. For masks of zeros and ones it
/// is the intersection over the union. Unlike `Σ c m / Σ (c + m - c m)` it reaches one for any two equal masks, soft ones
/// included, and only for those: a pixel half covered in the mask is best half covered. Zero for two empty masks.
pub(super) fn overlap(coverage: &[f64], mask: &[f32]) -> (f64, Vec<f64>) {
    let (mut common, mut either) = (0.0, 0.0);
    for (&c, &m) in coverage.iter().zip(mask) {
        let m = f64::from(m);
        common += c * m;
        either += c * c + m * m - c * m;
    }
    if either <= 0.0 {
        return (0.0, vec![0.0; coverage.len()]);
    }
    let iou = common / either;
    let derivative = |(&c, &m): (&f64, &f32)| (f64::from(m) * (1.0 + iou) - 2.0 * iou * c) / either;
    (iou, coverage.iter().zip(mask).map(derivative).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASK: [f32; 5] = [0.0, 0.25, 1.0, 0.5, 0.0];

    #[test]
    fn it_is_one_and_stationary_for_equal_masks_and_counts_pixels_of_hard_ones() {
        let (iou, derivative) = overlap(&MASK.map(f64::from), &MASK);
        assert!((iou - 1.0).abs() < 1e-15 && derivative.iter().all(|d| d.abs() < 1e-15));
        assert_eq!(overlap(&[1.0, 1.0, 1.0, 0.0], &[0.0, 1.0, 1.0, 1.0]).0, 0.5);
        assert_eq!(overlap(&[0.0; 2], &[0.0; 2]), (0.0, vec![0.0; 2]));
    }

    #[test]
    fn the_derivative_is_that_of_the_value() {
        let coverage = [0.3, 0.9, 0.4, 0.0, 0.2];
        let (_, derivative) = overlap(&coverage, &MASK);
        for k in 0..5 {
            let at = |step: f64| {
                let mut moved = coverage;
                moved[k] += step;
                overlap(&moved, &MASK).0
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            // central differences err by step² times the third derivative
            assert!((difference - derivative[k]).abs() < 1e-9, "{k}: {difference} {}", derivative[k]);
        }
    }
}
