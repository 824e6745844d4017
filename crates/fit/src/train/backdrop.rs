//! What is behind avatar and truth in the loss.

use crate::recipe::FitBackground;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::scene::{Image, Mask};

/// The colour behind avatar and truth.
pub(super) fn background(choice: FitBackground, seed: u64, iteration: u32) -> [f32; 3] {
    match choice {
        FitBackground::White => [1.0; 3],
        FitBackground::Black => [0.0; 3],
        FitBackground::Random => {
            let mut random =
                SplitMix64::new(!seed ^ u64::from(iteration).wrapping_mul(0xD6E8_FEB8_6659_FD93));
            random.next_u64();
            [random.unit_f32(), random.unit_f32(), random.unit_f32()]
        }
    }
}

/// Straight colours over a background, into memory that is kept.
pub(crate) fn composite(rgb: &Image, alpha: &Mask, background: [f32; 3], out: &mut Image) {
    if (out.width(), out.height()) != (rgb.width(), rgb.height()) {
        *out = Image::filled(rgb.width(), rgb.height(), background);
    }
    let pixels = rgb.pixels().iter().zip(alpha.values());
    for (out, (colour, &a)) in out.pixels_mut().iter_mut().zip(pixels) {
        *out = [0, 1, 2].map(|c| a * colour[c] + (1.0 - a) * background[c]);
    }
}
