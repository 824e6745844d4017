//! The derivatives against differences of the metric in `f64`, on images that fill the frame and that do not.

use super::*;
use skinsplat_metrics::{SsimVariant, ssim};

/// A smooth blob of the given size and place over a background, with texture.
fn blob(width: usize, height: usize, centre: [f32; 2], radius: f32, phase: f32) -> (Image, Mask) {
    let mut image = Image::filled(width, height, [0.7, 0.2, 0.4]);
    let mut alpha = Mask::filled(width, height, 0.0);
    for y in 0..height {
        for x in 0..width {
            let (dx, dy) = (x as f32 - centre[0], y as f32 - centre[1]);
            let a = (radius - (dx * dx + dy * dy).sqrt()).clamp(0.0, 1.0);
            let colour = [0, 1, 2].map(|c| 0.5 + 0.4 * (phase + 0.9 * dx + (c as f32) * dy).sin());
            alpha.values_mut()[y * width + x] = a;
            let pixel = &mut image.pixels_mut()[y * width + x];
            for c in 0..3 {
                pixel[c] = a * colour[c] + (1.0 - a) * pixel[c];
            }
        }
    }
    (image, alpha)
}

fn zero_padded(a: &Image, b: &Image) -> f64 {
    ssim(a, b, SsimVariant::ZeroPad).expect("images of one size")
}

fn total(a: &Image, b: &Image, weights: &Weights) -> f64 {
    let n = 3.0 * (a.width() * a.height()) as f64;
    let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    let l1: f64 = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / n;
    let share = f64::from(weights.ssim);
    (1.0 - share) * l1 + share * (1.0 - zero_padded(a, b))
}

#[test]
fn values_and_derivatives_are_those_of_the_metric() {
    for (radius, centre) in [(9.0, [17.0, 15.0]), (40.0, [12.0, 10.0]), (6.0, [3.0, 30.0])] {
        let (mut image, alpha) = blob(37, 41, centre, radius, 0.3);
        let (truth, true_alpha) = blob(37, 41, [centre[0] + 1.5, centre[1]], radius, 0.9);
        let weights = Weights { ssim: 0.6, silhouette: 0.5 };
        let mut gradient = RenderedGradient { image: Image::filled(1, 1, [0.0; 3]), alpha: None };
        let mut losses = Losses::default();
        let loss = losses.frame((&image, &alpha), (&truth, &true_alpha), &weights, &mut gradient);
        let expected = zero_padded(&image, &truth);
        assert!((loss.ssim - expected).abs() < 1e-6, "{} is not {expected}", loss.ssim);
        let colour = loss.total - 0.5 * loss.silhouette;
        assert!((colour - total(&image, &truth, &weights)).abs() < 1e-6);
        let step = 1e-3;
        for pixel in (0..37 * 41).step_by(23).filter(|&i| alpha.values()[i] > 0.0) {
            let before = image.pixels()[pixel];
            let mut at = |value: f32| {
                image.pixels_mut()[pixel][1] = value;
                (total(&image, &truth, &weights), f64::from(image.pixels()[pixel][1]))
            };
            let ((high, up), (low, down)) = (at(before[1] + step), at(before[1] - step));
            image.pixels_mut()[pixel] = before;
            let found = f64::from(gradient.image.pixels()[pixel][1]);
            let expected = (high - low) / (up - down);
            assert!((found - expected).abs() < 2e-6, "pixel {pixel}: {found} is not {expected}");
        }
    }
}

#[test]
fn frames_without_a_subject_cost_nothing() {
    let image = Image::filled(20, 10, [0.25; 3]);
    let none = Mask::filled(20, 10, 0.0);
    let weights = Weights { ssim: 0.2, silhouette: 1.0 };
    let mut gradient = RenderedGradient { image: Image::filled(1, 1, [1.0; 3]), alpha: None };
    let loss = Losses::default().frame((&image, &none), (&image, &none), &weights, &mut gradient);
    assert_eq!((loss.total, loss.ssim), (0.0, 1.0));
    assert!(gradient.image.pixels().iter().all(|p| *p == [0.0; 3]));
}

#[test]
fn the_silhouette_term_is_the_mean_distance_of_alpha() {
    let (image, alpha) = blob(30, 30, [15.0, 15.0], 8.0, 0.0);
    let (truth, true_alpha) = blob(30, 30, [15.0, 15.0], 10.0, 0.0);
    let weights = Weights { ssim: 0.0, silhouette: 2.0 };
    let mut gradient = RenderedGradient { image: Image::filled(1, 1, [0.0; 3]), alpha: None };
    let loss = Losses::default().frame((&image, &alpha), (&truth, &true_alpha), &weights, &mut gradient);
    let pairs = alpha.values().iter().zip(true_alpha.values());
    let expected: f64 = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / 900.0;
    assert!((loss.silhouette - expected).abs() < 1e-9);
    let slope = gradient.alpha.as_ref().map(|g| g.at(15, 6));
    assert_eq!(slope, Some(-(2.0f64 / 900.0) as f32));
}
