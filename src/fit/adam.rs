//! Adam (Kingma and Ba 2015, Algorithm 1), for one group of parameters.

use serde::{Deserialize, Serialize};

/// Moments of the gradients of one group of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Adam {
    /// Decay of the first moment per step.
    pub(crate) beta1: f64,
    /// Decay of the second moment per step.
    pub(crate) beta2: f64,
    /// Added to the root of the second moment.
    pub(crate) epsilon: f64,
    steps: u64,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Adam {
    /// No step taken yet, the defaults of the paper: betas 0.9 and 0.999, epsilon 1e-8.
    pub(crate) fn new(len: usize) -> Self {
        Self {
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            steps: 0,
            first: vec![0.0; len],
            second: vec![0.0; len],
        }
    }

    /// One step against a gradient, both moments corrected for their start at zero. Arrays of another length than the
    /// group's are a programming error; what is too long is left alone.
    pub(crate) fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f32) {
        debug_assert!(parameters.len() == self.first.len() && gradient.len() == self.first.len());
        self.steps += 1;
        let corrected = |beta: f64| 1.0 - beta.powf(self.steps as f64);
        let (beta1, beta2) = (self.beta1 as f32, self.beta2 as f32);
        // 1 - beta in f64: 1 - 0.999f32 is off by 1e-5 of itself
        let (fresh1, fresh2) = ((1.0 - self.beta1) as f32, (1.0 - self.beta2) as f32);
        let rate = (f64::from(learning_rate) / corrected(self.beta1)) as f32;
        let scale = (1.0 / corrected(self.beta2).sqrt()) as f32;
        let epsilon = self.epsilon as f32;
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((parameter, &g), (m, v)) in parameters.iter_mut().zip(gradient).zip(moments) {
            *m = beta1 * *m + fresh1 * g;
            *v = beta2 * *v + fresh2 * g * g;
            *parameter -= rate * *m / (v.sqrt() * scale + epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_by_hand() {
        let mut adam = Adam::new(2);
        let mut x = [1.0f32, 1.0];
        // first step: the corrected moments are g and g², so the step is the sign of the gradient
        adam.step(&mut x, &[2.0, -0.5], 0.1);
        assert!((x[0] - 0.9).abs() < 1e-6 && (x[1] - 1.1).abs() < 1e-6, "{x:?}");
        // second step with g = 1: m = (0.9 * 0.2 + 0.1) / 0.19, v = (0.999 * 0.004 + 0.001) / 0.001999
        adam.step(&mut x, &[1.0, -0.5], 0.1);
        let step = 0.1 * (0.28 / 0.19) / (0.004_996f64 / 0.001_999).sqrt();
        assert!((f64::from(x[0]) - (0.9 - step)).abs() < 1e-6, "{x:?}");
        assert!((x[1] - 1.2).abs() < 1e-6, "a constant gradient keeps its pace: {x:?}");
    }

    #[test]
    fn epsilon_holds_small_gradients_back_and_zero_ones_move_nothing() {
        let mut adam = Adam { epsilon: 1.0, ..Adam::new(2) };
        let mut x = [0.0f32; 2];
        adam.step(&mut x, &[1e-3, 0.0], 1.0);
        assert!((f64::from(x[0]) + 1e-3 / 1.001).abs() < 1e-8 && x[1] == 0.0, "{x:?}");
    }

    #[test]
    fn it_goes_on_from_its_serialised_state() {
        let gradient = |k: i32| [(k as f32).sin(), 0.3];
        let (mut whole, mut x) = (Adam::new(2), [0.5f32, 0.5]);
        let (mut resumed, mut y) = (Adam::new(2), x);
        for k in 0..6 {
            whole.step(&mut x, &gradient(k), 0.01);
            resumed.step(&mut y, &gradient(k), 0.01);
            let text = serde_json::to_string(&resumed).unwrap();
            resumed = serde_json::from_str(&text).unwrap();
        }
        assert_eq!((x, whole), (y, resumed));
    }
}
