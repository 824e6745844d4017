//! A perceptual colour scale for errors: light rises evenly from black through purple and orange to a pale yellow, so that it reads in
//! grey and by people who do not tell red from green.

use maud::{Markup, html};

/// From no error to an error of `most` and more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    most: f32,
}

/// Colours at equal steps (8-bit sRGB), after the scale "inferno" of matplotlib (CC0).
const STOPS: [[f32; 3]; 9] = [
    [0.0, 0.0, 4.0],
    [32.0, 12.0, 74.0],
    [87.0, 16.0, 110.0],
    [138.0, 34.0, 106.0],
    [188.0, 55.0, 84.0],
    [227.0, 89.0, 51.0],
    [249.0, 140.0, 10.0],
    [249.0, 201.0, 50.0],
    [252.0, 255.0, 164.0],
];

impl Scale {
    /// A scale that ends at this error.
    pub fn to(most: f32) -> Self {
        Self { most }
    }

    /// The colour of an error, 8-bit sRGB.
    pub fn colour(self, error: f32) -> [u8; 3] {
        let error = if error.is_nan() { 0.0 } else { error };
        let place = (error / self.most).clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
        let below = (place as usize).min(STOPS.len() - 2);
        let t = place - below as f32;
        std::array::from_fn(|c| (STOPS[below][c] * (1.0 - t) + STOPS[below + 1][c] * t + 0.5) as u8)
    }

    /// The scale with its ends named.
    pub(super) fn legend(self) -> Markup {
        let stop = |[r, g, b]: [f32; 3]| format!("rgb({r},{g},{b})");
        let gradient = STOPS.map(stop).join(",");
        html! {
            div.scale {
                span { "error 0" }
                span.bar style={ "background:linear-gradient(to right," (gradient) ")" } role="img" aria-label="Colour scale of errors: dark is none, bright is the most" {}
                span { (format!("{} and more", self.most)) }
                span.what { "mean absolute difference of the colours, of 1" }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_rises_with_the_error() {
        let scale = Scale::to(0.25);
        let light = |error: f32| {
            let [r, g, b] = scale.colour(error).map(f32::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let steps: Vec<f32> = (0..=50).map(|i| light(i as f32 * 0.005)).collect();
        assert!(steps.windows(2).all(|pair| pair[1] >= pair[0]), "{steps:?}");
        assert_eq!((scale.colour(9.0), scale.colour(0.0)), ([252, 255, 164], [0, 0, 4]));
        assert_eq!(scale.colour(f32::NAN), [0, 0, 4]);
    }
}
