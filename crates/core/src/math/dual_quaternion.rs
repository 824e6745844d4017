//! Dual quaternions: rigid motions blended linearly (Kavan et al. 2007, "Skinning with Dual Quaternions").

use super::rotation::{adjoint, conjugate, is_opposite, multiply, normalize, quaternion_to_matrix_raw};
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
        let [_, x, y, z] = multiply(self.dual, conjugate(self.real));
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
    let Sums { real, dual, .. } = Sums::of(motions, weights)?;
    let length = dot4(real, real).sqrt();
    let unit = normalize(real)?;
    let dual = dual.map(|c| c / length);
    let along = dot4(unit, dual);
    let orthogonal = [0, 1, 2, 3].map(|k| dual[k] - along * unit[k]);
    orthogonal.iter().all(|c| c.is_finite()).then_some(DualQuaternion { real: unit, dual: orthogonal })
}

/// The sums of a blend.
struct Sums<T> {
    /// Index of the motion with the largest weight (the first of equals), to whose side the others are brought.
    heaviest: usize,
    real: Quaternion<T>,
    dual: Quaternion<T>,
}

impl<T: Real> Sums<T> {
    fn of(motions: &[DualQuaternion<T>], weights: &[T]) -> Option<Self> {
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
        let mut sums = Self { heaviest: heaviest.1, real: [T::ZERO; 4], dual: [T::ZERO; 4] };
        for index in 0..motions.len() {
            let factor = sums.factor(motions, weights, index);
            for k in 0..4 {
                sums.real[k] += factor * motions[index].real[k];
                sums.dual[k] += factor * motions[index].dual[k];
            }
        }
        Some(sums)
    }

    /// The weight of a motion relative to the heaviest, with the sign that brings it to that one's side.
    fn factor(&self, motions: &[DualQuaternion<T>], weights: &[T], index: usize) -> T {
        let relative = weights[index] / weights[self.heaviest];
        let opposite = is_opposite(motions[index].real, motions[self.heaviest].real);
        if opposite { -relative } else { relative }
    }
}

/// [`blend`] and [`DualQuaternion::transform`] of `point` walked backwards: for each motion, by its index, the derivatives with
/// respect to a further rotation of it (its translation left where it is) and to its translation, from those with respect to
/// the transformed point and to a further rotation `torque` of the blend. Which side a motion is brought to is a constant.
pub fn blend_adjoint<T: Real>(
    motions: &[DualQuaternion<T>],
    weights: &[T],
    (point, of_point, torque): ([T; 3], [T; 3], [T; 3]),
    mut add: impl FnMut(usize, [T; 3], [T; 3]),
) {
    let Some(sums) = Sums::of(motions, weights) else { return };
    let Some(unit) = normalize(sums.real) else { return };
    let (half, two) = (T::from_f64(0.5), T::from_f64(2.0));
    let inverse = T::ONE / dot4(unit, sums.real);
    let dual = sums.dual.map(|c| c * inverse);
    // t = 2 vec(d ⊗ r*) / |r|² of the sums r and d.
    let translation = DualQuaternion { real: unit, dual }.translation();
    let rotated = matrix3::apply(quaternion_to_matrix_raw(unit), point);
    let torque = matrix3::add_scaled(torque, T::ONE, matrix3::cross(rotated, of_point));
    let of_unit = adjoint::from_torque(unit, torque);
    let [x, y, z] = of_point;
    let push = [T::ZERO, x, y, z];
    let along = two * matrix3::dot(translation, of_point);
    let (through, of_dual) = (multiply(push, dual), multiply(push, unit).map(|c| two * c * inverse));
    let of_real = [0, 1, 2, 3].map(|k: usize| (of_unit[k] - two * through[k] - along * unit[k]) * inverse);
    for (index, motion) in motions.iter().enumerate() {
        let factor = sums.factor(motions, weights, index);
        let own_dual = of_dual.map(|c| factor * c);
        // dual = ½ t ⊗ real.
        let [_, x, y, z] = multiply(own_dual, conjugate(motion.real));
        let [t0, t1, t2] = motion.translation().map(|c| -half * c);
        let through = multiply([T::ZERO, t0, t1, t2], own_dual);
        let own_real = [0, 1, 2, 3].map(|k: usize| factor * of_real[k] + through[k]);
        add(index, adjoint::to_torque(motion.real, own_real), [x * half, y * half, z * half]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::SplitMix64;
    use super::*;

    /// Against central differences of the blend.
    #[test]
    fn the_adjoint_is_that_of_the_blend() {
        let mut random = SplitMix64::new(9);
        let mut number = || f64::from(2.0 * random.unit_f32() - 1.0);
        for case in 0..100 {
            let count = 1 + case % 4;
            let turns: Vec<[f64; 4]> = (0..count)
                .map(|_| normalize([1.0 + number(), number(), number(), number()]).unwrap())
                .collect();
            let shifts: Vec<[f64; 3]> = (0..count).map(|_| [number(), number(), number()]).collect();
            let weights: Vec<f64> = (0..count).map(|_| 1.5 + number()).collect();
            let (point, of_point) = ([number(), number(), number()], [number(), number(), number()]);
            let of_turn = [
                [number(), number(), number()],
                [number(), number(), number()],
                [number(), number(), number()],
            ];
            let at = |turns: &[[f64; 4]], shifts: &[[f64; 3]]| {
                let motions: Vec<_> =
                    turns.iter().zip(shifts).map(|(q, t)| DualQuaternion::new(*q, *t)).collect();
                (blend(&motions, &weights).unwrap(), motions)
            };
            let loss = |turns: &[[f64; 4]], shifts: &[[f64; 3]]| {
                let (blend, _) = at(turns, shifts);
                let r = quaternion_to_matrix_raw(blend.real);
                let turned: f64 = (0..3).map(|row| matrix3::dot(r[row], of_turn[row])).sum();
                matrix3::dot(blend.transform(point), of_point) + turned
            };
            let (blended, motions) = at(&turns, &shifts);
            let torque = adjoint::matrix_to_torque(&quaternion_to_matrix_raw(blended.real), &of_turn);
            let mut found = vec![[0.0; 6]; count];
            blend_adjoint(&motions, &weights, (point, of_point, torque), |k, turn, shift| {
                found[k][..3].copy_from_slice(&turn);
                found[k][3..].copy_from_slice(&shift);
            });
            for k in 0..count {
                for entry in 0..6 {
                    let moved = |step: f64| {
                        let (mut turns, mut shifts) = (turns.clone(), shifts.clone());
                        if entry < 3 {
                            let mut turn = [1.0, 0.0, 0.0, 0.0];
                            turn[1 + entry] = step / 2.0;
                            turns[k] = normalize(multiply(turn, turns[k])).unwrap();
                        } else {
                            shifts[k][entry - 3] += step;
                        }
                        loss(&turns, &shifts)
                    };
                    let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                    assert!(
                        (found[k][entry] - expected).abs() < 1e-7 * (1.0 + expected.abs()),
                        "{k}, {entry}"
                    );
                }
            }
        }
    }
}
