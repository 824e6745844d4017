//! Dual quaternions: rigid motions blended linearly (Kavan et al. 2007, "Skinning with Dual Quaternions").

use super::rotation::{is_opposite, multiply, normalize, quaternion_to_matrix_raw};
use super::{Quaternion, Real, dot4, matrix3};

/// A unit dual quaternion `real + ε dual`: x' = R(real) x + t with dual = ½ t ⊗ real.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualQuaternion<T> {
    /// The rotation, of unit length.
    pub real: Quaternion<T>,
    /// Half the translation times the rotation; orthogonal to `real`.
    pub dual: Quaternion<T>,
}

impl<T: Real> DualQuaternion<T> {
    /// The motion x' = R(rotation) x + translation; `rotation` of unit length.
    pub fn new(rotation: Quaternion<T>, translation: [T; 3]) -> Self {
        let half = T::from_f64(0.5);
        let [x, y, z] = translation.map(|c| c * half);
        Self { real: rotation, dual: multiply([T::ZERO, x, y, z], rotation) }
    }

    /// The translation.
    pub fn translation(&self) -> [T; 3] {
        let two = T::from_f64(2.0);
        let [_, x, y, z] = multiply(self.dual, super::rotation::conjugate(self.real));
        [two * x, two * y, two * z]
    }

    /// R(real) p + translation.
    pub fn transform(&self, point: [T; 3]) -> [T; 3] {
        let rotated = matrix3::apply(quaternion_to_matrix_raw(self.real), point);
        matrix3::add_scaled(rotated, T::ONE, self.translation())
    }
}

/// The dual-quaternion linear blend of rigid motions: Σ w q̂, each q̂ brought to the side of the one with the largest
/// weight (the first of equals), divided by the length of its real part (Kavan's Eq. 6; the dual part is also made
/// orthogonal to the real one, which does not change the motion). Weights are non-negative and need not sum to one.
///
/// `None` where there is no blend: slices of different length, no positive weight, a weight that is negative or not
/// finite, a sum that is not finite.
pub fn blend<T: Real>(motions: &[DualQuaternion<T>], weights: &[T]) -> Option<DualQuaternion<T>> {
    let mut heaviest = (T::ZERO, 0);
    for (index, &weight) in weights.iter().enumerate() {
        if !weight.is_finite() || weight < T::ZERO {
            return None;
        }
        if weight > heaviest.0 {
            heaviest = (weight, index);
        }
    }
    if heaviest.0 == T::ZERO || motions.len() != weights.len() {
        return None;
    }
    let reference = motions[heaviest.1].real;
    let (mut real, mut dual) = ([T::ZERO; 4], [T::ZERO; 4]);
    for (motion, &weight) in motions.iter().zip(weights) {
        let relative = weight / heaviest.0;
        let factor = if is_opposite(motion.real, reference) { -relative } else { relative };
        for k in 0..4 {
            real[k] += factor * motion.real[k];
            dual[k] += factor * motion.dual[k];
        }
    }
    let length = dot4(real, real).sqrt();
    let unit = normalize(real)?;
    let dual = dual.map(|c| c / length);
    let along = dot4(unit, dual);
    let orthogonal = [0, 1, 2, 3].map(|k| dual[k] - along * unit[k]);
    orthogonal.iter().all(|c| c.is_finite()).then_some(DualQuaternion { real: unit, dual: orthogonal })
}
