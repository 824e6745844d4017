//! Smooth offsets from free parameters.

use crate::fill::Neighbours;
use rayon::prelude::*;

/// A linear map that averages every value with its neighbours' again and again. Offsets are its image of the parameters
/// that are stepped on: a pull on the few vertices of an outline moves their surroundings along, as the inverse of a
/// Laplacian does in "Large Steps in Inverse Rendering of Geometry" (Nicolet et al. 2021), of which these are the first
/// terms.
pub(super) struct Diffusion {
    neighbours: Neighbours,
    passes: usize,
}

impl Diffusion {
    pub(super) fn new(vertices: usize, faces: &[[u32; 3]], passes: usize) -> Self {
        Self { neighbours: Neighbours::of_vertices(vertices, faces), passes }
    }

    /// The offsets of parameters.
    pub(super) fn apply(&self, parameters: &[f32]) -> Vec<f64> {
        self.repeated(parameters.iter().map(|&p| f64::from(p)).collect(), |values, i, around| {
            let sum: f64 = around.iter().map(|&j| values[j as usize]).sum();
            0.5 * (values[i] + sum / around.len() as f64)
        })
    }

    /// The derivative by the parameters from that by the offsets.
    pub(super) fn pulled_back(&self, gradient: Vec<f64>) -> Vec<f32> {
        let share =
            |&j: &u32, values: &[f64]| values[j as usize] / self.neighbours.of(j as usize).len() as f64;
        let pulled = self.repeated(gradient, |values, i, around| {
            let sum: f64 = around.iter().map(|j| share(j, values)).sum();
            0.5 * (values[i] + sum)
        });
        pulled.into_iter().map(|g| g as f32).collect()
    }

    fn repeated(
        &self,
        mut values: Vec<f64>,
        mixed: impl Fn(&[f64], usize, &[u32]) -> f64 + Sync,
    ) -> Vec<f64> {
        let mut next = vec![0.0; values.len()];
        for _ in 0..self.passes {
            next.par_iter_mut().enumerate().with_min_len(4096).for_each(|(i, out)| {
                let around = self.neighbours.of(i);
                *out = if around.is_empty() { values[i] } else { mixed(&values, i, around) };
            });
            std::mem::swap(&mut values, &mut next);
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fan with a flap, and a vertex without a face.
    const FACES: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 4, 5]];

    #[test]
    fn constants_stay_and_bumps_flatten() {
        let diffusion = Diffusion::new(7, &FACES, 3);
        assert!(diffusion.apply(&[0.5; 7]).iter().all(|v| (v - 0.5).abs() < 1e-15));
        let bump = diffusion.apply(&[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert!(bump[..6].iter().all(|&v| v > 0.0 && v < 0.5) && bump[6] == 1.0, "{bump:?}");
    }

    #[test]
    fn the_derivative_is_the_adjoint() {
        let diffusion = Diffusion::new(7, &FACES, 4);
        let (x, g) = ([0.3, -0.2, 0.9, 0.1, 0.0, 0.7, 0.4], vec![1.0, 0.5, -0.3, 0.2, 0.8, -0.6, 0.1]);
        let forward: f64 = diffusion.apply(&x).iter().zip(&g).map(|(a, b)| a * b).sum();
        let back = diffusion.pulled_back(g);
        let backward: f64 = back.iter().zip(x).map(|(&a, b)| f64::from(a) * f64::from(b)).sum();
        assert!((forward - backward).abs() < 1e-7, "{forward} {backward}");
    }
}
