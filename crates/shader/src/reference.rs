//! What the shader should answer, in `f64` by `skinsplat-core`.

use super::Rotation;
use super::batch::{Batch, COEFFICIENTS};
use skinsplat_core::math::average::{Solver, Start, average, average_rotation};
use skinsplat_core::math::dual_quaternion::{self, DualQuaternion};
use skinsplat_core::math::{Matrix3, Quaternion, dot4, matrix3, rotation, sh};

/// One posed Gaussian.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// World position.
    pub mean: [f64; 3],
    /// Rotation relative to the rest pose (w, x, y, z).
    pub relative: Quaternion<f64>,
    /// Posed rotation (w, x, y, z).
    pub quaternion: Quaternion<f64>,
    /// xx, xy, xz, yy, yz, zz.
    pub covariance: [f64; 6],
    /// View direction in the frame of the rest pose.
    pub view: [f64; 3],
    /// Turned SH.
    pub turned_sh: [[f64; 3]; COEFFICIENTS],
    /// RGB, not below 0.
    pub colour: [f64; 3],
}

/// The joints of a Gaussian that count under a choice.
struct Bones {
    quats: Vec<Quaternion<f64>>,
    translations: Vec<[f64; 3]>,
    weights: Vec<f64>,
}

impl Bones {
    fn new(batch: &Batch, i: usize, choice: Rotation) -> Self {
        let kept = if choice == Rotation::TwoBones { 2 } else { usize::MAX };
        let mut bones = Self { quats: Vec::new(), translations: Vec::new(), weights: Vec::new() };
        for (joint, weight) in batch.influences(i).take(kept).filter(|(_, weight)| *weight > 0.0) {
            let (q, t) = batch.joints[joint];
            bones.quats.push(rotation::normalize(q.map(f64::from)).unwrap_or_else(rotation::identity));
            bones.translations.push(t.map(f64::from));
            bones.weights.push(f64::from(weight));
        }
        bones
    }

    /// The first of the joints of largest weight.
    fn heaviest(&self) -> Option<Quaternion<f64>> {
        let largest = self.weights.iter().copied().fold(0.0, f64::max);
        self.weights.iter().position(|&w| w == largest).map(|k| self.quats[k])
    }

    /// Eq. 6.
    fn blended_mean(&self, p: [f64; 3]) -> [f64; 3] {
        let total: f64 = self.weights.iter().sum();
        if total == 0.0 {
            return p;
        }
        let mut sum = [0.0; 3];
        for k in 0..self.weights.len() {
            let rotated = matrix3::apply(rotation::quaternion_to_matrix_raw(self.quats[k]), p);
            let moved = matrix3::add_scaled(rotated, 1.0, self.translations[k]);
            sum = matrix3::add_scaled(sum, self.weights[k] / total, moved);
        }
        sum
    }

    fn dual(&self) -> Option<DualQuaternion<f64>> {
        let motion = |k: usize| DualQuaternion::new(self.quats[k], self.translations[k]);
        let motions: Vec<_> = (0..self.quats.len()).map(motion).collect();
        dual_quaternion::blend(&motions, &self.weights)
    }

    fn motion(&self, choice: Rotation, steps: u32, p: [f64; 3]) -> ([f64; 3], Quaternion<f64>) {
        let solver = match choice {
            Rotation::TwoBones | Rotation::ClosedForm => Solver::ClosedForm,
            Rotation::Power => Solver::Power { steps, start: Start::Heaviest },
            Rotation::AlignedSum => Solver::Nlerp,
            Rotation::DualQuaternion => {
                return self
                    .dual()
                    .map_or((p, rotation::identity()), |motion| (motion.transform(p), motion.real));
            }
        };
        let relative = average_rotation(&self.quats, &self.weights, solver);
        (self.blended_mean(p), relative.unwrap_or_else(rotation::identity))
    }
}

/// What a choice makes of a Gaussian.
pub fn answer(batch: &Batch, i: usize, choice: Rotation) -> Answer {
    let gaussian = &batch.gaussians[i];
    let bones = Bones::new(batch, i, choice);
    let (mean, relative) = bones.motion(choice, batch.power_steps, gaussian.mean.map(f64::from));
    let canonical = rotation::normalize(gaussian.rotation.map(f64::from)).unwrap_or_else(rotation::identity);
    let quaternion = rotation::multiply(relative, canonical);
    let view = turned_view(mean, batch.camera.map(f64::from), relative);
    let mut turned_sh = batch.sh[i].map(|rgb| rgb.map(f64::from));
    let colour = sh::evaluate(3, &turned_sh, view).map(|c| (c + 0.5).max(0.0));
    sh::Rotation::from_quaternion(relative, 3).apply(&mut turned_sh);
    let covariance = covariance(quaternion, gaussian.scale.map(f64::from));
    Answer { mean, relative, quaternion, covariance, view, turned_sh, colour }
}

/// How well a Gaussian's average is determined: the relative gap (λ1 − λ2) / λ1 of Eq. 7 under a choice.
pub fn gap(batch: &Batch, i: usize, choice: Rotation) -> f64 {
    let bones = Bones::new(batch, i, choice);
    average(&bones.quats, &bones.weights, Solver::ClosedForm).map_or(1.0, |average| average.gap)
}

/// The length of (A / λ1)ⁿ times the heaviest joint's quaternion: what n power steps leave of it, so one over how much they magnify
/// their rounding.
pub fn left_by_steps(batch: &Batch, i: usize) -> f64 {
    let bones = Bones::new(batch, i, Rotation::Power);
    let applied = |v: Quaternion<f64>| {
        let mut sum = [0.0; 4];
        for (q, w) in bones.quats.iter().zip(&bones.weights) {
            let along = w * dot4(*q, v);
            (0..4).for_each(|k| sum[k] += along * q[k]);
        }
        sum
    };
    let Some(best) = average_rotation(&bones.quats, &bones.weights, Solver::ClosedForm) else { return 1.0 };
    let largest = dot4(best, applied(best));
    let Some(heaviest) = bones.heaviest() else { return 1.0 };
    let last = (0..batch.power_steps).fold(heaviest, |v, _| applied(v).map(|c| c / largest));
    dot4(last, last).sqrt()
}

/// The smallest |cosine| between the heaviest joint's quaternion and another one's: how sure the sign is that an aligned sum
/// gives to it.
pub fn surest_side(batch: &Batch, i: usize) -> f64 {
    let bones = Bones::new(batch, i, Rotation::AlignedSum);
    let Some(heaviest) = bones.heaviest() else { return 1.0 };
    let cosines = bones.quats.iter().map(|&q| dot4(q, heaviest).abs());
    cosines.fold(1.0, f64::min)
}

fn turned_view(mean: [f64; 3], camera: [f64; 3], relative: Quaternion<f64>) -> [f64; 3] {
    let view = matrix3::add_scaled(mean, -1.0, camera);
    let length = matrix3::dot(view, view).sqrt();
    let unit = if length == 0.0 { [0.0, 0.0, 1.0] } else { view.map(|c| c / length) };
    matrix3::apply(matrix3::transpose(rotation::quaternion_to_matrix_raw(relative)), unit)
}

fn covariance(q: Quaternion<f64>, s: [f64; 3]) -> [f64; 6] {
    let r: Matrix3<f64> = rotation::quaternion_to_matrix_raw(q);
    let entry = |i: usize, j: usize| (0..3).map(|k| r[i][k] * s[k] * s[k] * r[j][k]).sum();
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}
