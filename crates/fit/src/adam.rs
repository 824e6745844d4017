//! Adam (Kingma and Ba 2015, algorithm 1), with bias correction.

use crate::options::Moments;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;

/// Values per unit of parallel work.
const CHUNK: usize = 1 << 14;

/// The moments of one group of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Adam {
    options: Moments,
    steps: u32,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Adam {
    /// For `len` parameters.
    pub(crate) fn new(len: usize, options: Moments) -> Self {
        Self { options, steps: 0, first: vec![0.0; len], second: vec![0.0; len] }
    }

    /// True if there are moments for so many parameters: what a checkpoint says of both may disagree.
    pub(crate) fn is_for(&self, len: usize) -> bool {
        self.first.len() == len && self.second.len() == len
    }

    /// One step against the gradient.
    ///
    /// # Panics
    /// If the lengths differ.
    pub(crate) fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f32) {
        self.step_rows(parameters, gradient, 1, |_| learning_rate);
    }

    /// One step for rows of `width` parameters whose learning rate depends on the place in the row.
    ///
    /// # Panics
    /// If the lengths differ or are no multiple of the width.
    pub(crate) fn step_rows(
        &mut self,
        parameters: &mut [f32],
        gradient: &[f32],
        width: usize,
        learning_rate: impl Fn(usize) -> f32,
    ) {
        assert_eq!(parameters.len(), self.first.len(), "one moment per parameter");
        assert_eq!(gradient.len(), self.first.len(), "one derivative per parameter");
        self.steps += 1;
        let power =
            |beta: f32| portable::powi(f64::from(beta), i32::try_from(self.steps).unwrap_or(i32::MAX));
        let Moments { beta1, beta2, epsilon } = self.options;
        let correction = (1.0 - power(beta2)).sqrt();
        let scale = (correction / (1.0 - power(beta1))) as f32;
        let epsilon = epsilon * correction as f32;
        // One row's rates, repeated so that vectors of any length can be read from them.
        let length = width * (CHUNK / width).max(1);
        assert_eq!(parameters.len() % width, 0, "whole rows");
        let rates: Vec<f32> =
            (0..length.min(parameters.len())).map(|i| scale * learning_rate(i % width)).collect();
        let moments = self.first.par_chunks_mut(length).zip(self.second.par_chunks_mut(length));
        let values = parameters.par_chunks_mut(length).zip(gradient.par_chunks(length));
        moments.zip(values).for_each(|((first, second), (parameters, gradient))| {
            skinsplat_simd::arch().dispatch(Update {
                beta1,
                beta2,
                epsilon,
                rates: &rates[..parameters.len()],
                first,
                second,
                parameters,
                gradient,
            });
        });
    }

    /// Follows a change of the parameters: row i (of `width`) takes the moments of row `sources[i]`, or none.
    pub(crate) fn rearrange(&mut self, sources: &[Option<usize>], width: usize) {
        for moments in [&mut self.first, &mut self.second] {
            let mut moved = Vec::with_capacity(sources.len() * width);
            for source in sources {
                match source {
                    Some(row) => moved.extend_from_slice(&moments[row * width..(row + 1) * width]),
                    None => moved.resize(moved.len() + width, 0.0),
                }
            }
            *moments = moved;
        }
    }

    /// Follows rows of `from` parameters that become rows of `to`; what is added starts without moments.
    pub(crate) fn widen(&mut self, from: usize, to: usize) {
        for moments in [&mut self.first, &mut self.second] {
            let mut wider = Vec::with_capacity(moments.len() / from * to);
            for row in moments.chunks(from) {
                wider.extend_from_slice(row);
                wider.resize(wider.len() + to - from, 0.0);
            }
            *moments = wider;
        }
    }
}

/// A chunk of parameters.
struct Update<'a> {
    beta1: f32,
    beta2: f32,
    epsilon: f32,
    rates: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
    parameters: &'a mut [f32],
    gradient: &'a [f32],
}

impl pulp::NullaryFnOnce for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let n = self.parameters.len();
        let (first, second) = (&mut self.first[..n], &mut self.second[..n]);
        let (parameters, gradient, rates) =
            (&mut self.parameters[..n], &self.gradient[..n], &self.rates[..n]);
        for i in 0..n {
            let g = gradient[i];
            let m = self.beta1 * first[i] + (1.0 - self.beta1) * g;
            let v = self.beta2 * second[i] + (1.0 - self.beta2) * g * g;
            first[i] = m;
            second[i] = v;
            parameters[i] -= rates[i] * m / (v.sqrt() + self.epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The algorithm as printed, in f64.
    fn reference(gradients: &[[f64; 3]], rate: f64, epsilon: f64) -> [f64; 3] {
        let (mut x, mut m, mut v) = ([1.0, -2.0, 0.5], [0.0; 3], [0.0; 3]);
        for (t, g) in gradients.iter().enumerate() {
            for i in 0..3 {
                m[i] = 0.9 * m[i] + 0.1 * g[i];
                v[i] = 0.999 * v[i] + 0.001 * g[i] * g[i];
                let (a, b) = (1.0 - 0.9f64.powi(t as i32 + 1), 1.0 - 0.999f64.powi(t as i32 + 1));
                x[i] -= rate * (m[i] / a) / ((v[i] / b).sqrt() + epsilon);
            }
        }
        x
    }

    const GRADIENTS: [[f64; 3]; 4] =
        [[0.5, -1e-3, 0.0], [-0.25, 2e-3, 1e-9], [1.0, 0.0, -1e-9], [0.1, 1e-3, 0.0]];

    #[test]
    fn steps_are_those_of_the_algorithm() {
        for epsilon in [1e-8f32, 1e-2] {
            let mut adam = Adam::new(3, Moments::with_epsilon(epsilon));
            let mut x = [1.0, -2.0, 0.5];
            for gradient in GRADIENTS {
                adam.step(&mut x, &gradient.map(|g| g as f32), 0.05);
            }
            for (found, expected) in x.iter().zip(reference(&GRADIENTS, 0.05, f64::from(epsilon))) {
                assert!((f64::from(*found) - expected).abs() < 2e-6, "{found} is not {expected}");
            }
        }
    }

    #[test]
    fn rows_have_rates_of_their_own_and_keep_their_moments() {
        let mut adam = Adam::new(4, Moments::with_epsilon(1e-8));
        let mut x = [0.0; 4];
        adam.step_rows(&mut x, &[1.0; 4], 2, |place| [0.1, 0.0][place]);
        assert_eq!(x.map(|v| (v * 1e6).round()), [-100_000.0, 0.0, -100_000.0, 0.0]);
        adam.rearrange(&[Some(1), None, Some(0)], 2);
        assert_eq!((adam.first.len(), &adam.first[2..4]), (6, &[0.0, 0.0][..]));
        adam.widen(2, 3);
        assert_eq!((adam.second.len(), adam.second[2], adam.second[3]), (9, 0.0, 0.0));
    }
}
