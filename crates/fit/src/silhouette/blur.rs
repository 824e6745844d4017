//! A Gaussian filter over a window of pixels.

use skinsplat_core::math::portable;

/// A separable, truncated Gaussian that sums to one; outside of the window everything is zero, so that the filter is a
/// symmetric matrix and its own adjoint.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blur {
    /// Weights of the pixel itself, the next on either side, and so on.
    weights: Vec<f64>,
}

impl Blur {
    /// A filter of a standard deviation in pixels, cut off beyond `reach` of them; zero changes nothing.
    pub(crate) fn new(sigma: f64, reach: f64) -> Self {
        let reach = (reach * sigma).ceil() as usize;
        let bell = |x: f64| portable::exp(-0.5 * (x * x));
        let at = |k: usize| if k == 0 { 1.0 } else { bell(k as f64 / sigma) };
        let weights: Vec<f64> = (0..=reach).map(at).collect();
        let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
        Self { weights: weights.iter().map(|w| w / sum).collect() }
    }

    /// How many pixels far the filter reaches.
    pub(crate) fn reach(&self) -> usize {
        self.weights.len() - 1
    }

    /// Filters an image of the given width.
    pub(crate) fn apply(&self, values: &mut [f64], width: usize) {
        if self.reach() == 0 {
            return;
        }
        let mut filtered = vec![0.0; values.len()];
        for (row, out) in values.chunks_exact(width).zip(filtered.chunks_exact_mut(width)) {
            self.add_shifted(row, out, 1);
        }
        values.fill(0.0);
        self.add_shifted(&filtered, values, width);
    }

    /// Adds to `out` the weighted sum of `values` shifted by multiples of `step`.
    fn add_shifted(&self, values: &[f64], out: &mut [f64], step: usize) {
        let count = values.len();
        for (k, &weight) in self.weights.iter().enumerate() {
            let shift = (k * step).min(count);
            for (o, v) in out[shift..].iter_mut().zip(values) {
                *o += weight * v;
            }
            if k > 0 {
                for (o, v) in out.iter_mut().zip(&values[shift..]) {
                    *o += weight * v;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(seed: u64) -> Vec<f64> {
        (0..11 * 7).map(|i| ((i * i + seed * 31 * i) % 17) as f64 / 17.0).collect()
    }

    #[test]
    fn a_point_becomes_a_gaussian_of_the_same_sum() {
        let blur = Blur::new(0.8, 3.0);
        let mut values = vec![0.0; 11 * 7];
        values[3 * 11 + 5] = 1.0;
        blur.apply(&mut values, 11);
        assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let at = |x: usize, y: usize| values[y * 11 + x];
        assert!((at(6, 3) / at(5, 3) - (-0.5f64 / 0.64).exp()).abs() < 1e-12);
        assert_eq!((at(6, 3), at(4, 3)), (at(5, 4), at(5, 2)));
        assert_eq!(Blur::new(0.0, 3.0).reach(), 0);
    }

    #[test]
    fn it_is_its_own_adjoint_also_at_the_border() {
        let blur = Blur::new(1.7, 3.0);
        let (a, b) = (image(1), image(2));
        let (mut blurred_a, mut blurred_b) = (a.clone(), b.clone());
        blur.apply(&mut blurred_a, 11);
        blur.apply(&mut blurred_b, 11);
        let dot = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(x, y)| x * y).sum::<f64>();
        assert!((dot(&blurred_a, &b) - dot(&a, &blurred_b)).abs() < 1e-12);
    }
}
