//! The exact answer for every Gaussian of a frame, and frames drawn with other answers in its place.

use super::candidate::Candidate;
use super::{Degrees, Error};
use glam::{Mat3, Quat};
use rayon::prelude::*;
use skinsplat_core::math::average::{Solver, average};
use skinsplat_core::math::portable;
use skinsplat_core::math::{Quaternion, Real, rotation, sh};
use skinsplat_core::scene::{Camera, Gaussians, OwnedPosed, Pose, PosedBody, RestBody, SkinWeights};
use skinsplat_posing::{BoundAvatar, ColourChoice, Strategy, pose};
use std::sync::Arc;

/// The gap of the eigenvalues below which an average in f64 says more about rounding than about the pose.
const LEAST_GAP: f64 = 1e-9;

/// A body and what hangs on it.
#[derive(Debug)]
pub(super) struct Rig {
    pub(super) body: Arc<RestBody>,
    /// Weights per Gaussian.
    pub(super) weights: SkinWeights,
    /// R_c, normalised in f64.
    canonical: Vec<Quaternion<f64>>,
}

impl Rig {
    pub(super) fn new(body: Arc<RestBody>, weights: SkinWeights, gaussians: &Gaussians) -> Self {
        let unit = |q: &[f32; 4]| rotation::normalize(q.map(f64::from)).unwrap_or_else(rotation::identity);
        Self { body, weights, canonical: gaussians.rotations.iter().map(unit).collect() }
    }

    /// A Gaussian in a frame: the exact rotation times R_c.
    pub(super) fn drawn(&self, i: usize, turn: Quaternion<f64>) -> Quaternion<f64> {
        rotation::multiply(turn, self.canonical[i])
    }
}

/// The exact rotation of a Gaussian.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exact {
    pub(super) quat: Quaternion<f64>,
    /// False where the average is a choice among equals.
    pub(super) unique: bool,
}

/// One frame.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    pub(super) pose: Pose,
    pub(super) camera: Camera,
    /// Rotation of each joint relative to the rest pose.
    pub(super) joints: Vec<Quaternion<f64>>,
    /// One per Gaussian.
    pub(super) exact: Vec<Exact>,
    /// World positions, which no choice of rotation changes.
    means: Vec<glam::Vec3>,
}

impl Shot {
    pub(super) fn new(rig: &Rig, bound: &BoundAvatar, at: Pose, camera: Camera) -> Result<Self, Error> {
        let body = PosedBody::new(&rig.body, &at)?;
        let joints: Vec<Quaternion<f64>> =
            body.joints.iter().map(|j| [j.rotation.w, j.rotation.x, j.rotation.y, j.rotation.z]).collect();
        let exact = (0..rig.weights.len()).into_par_iter().map(|i| {
            let (indices, weights) = rig.weights.row(i);
            let quats: Vec<_> = indices.iter().map(|&j| joints[usize::from(j)]).collect();
            let weights: Vec<f64> = weights.iter().map(|&w| f64::from(w)).collect();
            match average(&quats, &weights, Solver::Eigen) {
                Some(average) => Exact { quat: average.quat, unique: average.gap > LEAST_GAP },
                None => Exact { quat: rotation::identity(), unique: false },
            }
        });
        let exact = exact.collect();
        let plain = Strategy { colour: ColourChoice::None, ..stock() };
        let means = pose(bound, &body, &plain)?.means;
        Ok(Self { pose: at, camera, joints, exact, means })
    }

    /// The same frame with the Gaussians elsewhere.
    pub(super) fn moved(&self, means: Vec<glam::Vec3>) -> Self {
        Self { means, ..self.clone() }
    }

    /// The same frame with every component of the joints' quaternions changed; the exact rotations stay.
    pub(super) fn with_joints(&self, change: impl Fn(f64) -> f64) -> Self {
        Self { joints: self.joints.iter().map(|q| q.map(&change)).collect(), ..self.clone() }
    }

    /// What a candidate answers for every Gaussian, computed in T, and how many have no answer (which get the identity).
    pub(super) fn answers<T: Real>(
        &self,
        weights: &SkinWeights,
        candidate: Candidate,
    ) -> (Vec<Option<Quaternion<f64>>>, usize) {
        let bones = Bones::<T>::new(&self.joints, weights);
        let answers: Vec<Option<Quaternion<f64>>> = (0..weights.len())
            .into_par_iter()
            .map(|i| bones.solve(i, candidate).map(|q| q.map(Real::to_f64)))
            .collect();
        let missing = answers.iter().filter(|a| a.is_none()).count();
        (answers, missing)
    }

    /// The Gaussians with these rotations in place of the exact ones; SH are turned by them too. A Gaussian without an
    /// answer stays as it is in the rest pose.
    pub(super) fn dressed(
        &self,
        rig: &Rig,
        gaussians: &Gaussians,
        turns: &[Option<Quaternion<f64>>],
    ) -> OwnedPosed {
        let count = gaussians.sh_count();
        let turn = |i: usize| turns[i].unwrap_or_else(rotation::identity);
        let factors = (0..self.means.len()).into_par_iter().map(|i| {
            let [w, x, y, z] = rig.drawn(i, turn(i)).map(|c| c as f32);
            Mat3::from_quat(Quat::from_xyzw(x, y, z, w).normalize())
                * Mat3::from_diagonal(gaussians.log_scales[i].map(portable::exp))
        });
        let mut coefficients = gaussians.sh.clone();
        if gaussians.sh_degree > 0 {
            coefficients.par_chunks_mut(count).enumerate().for_each(|(i, own)| {
                let turn = turn(i).map(|c| c as f32);
                sh::Rotation::from_quaternion(turn, gaussians.sh_degree).apply(own);
            });
        }
        OwnedPosed {
            means: self.means.clone(),
            factors: factors.collect(),
            opacities: gaussians.opacities(),
            sh_degree: gaussians.sh_degree,
            sh: coefficients,
            view_frames: None,
            colour_clamp: skinsplat_core::scene::ColourClamp::NonNegative,
            rotations: None,
        }
    }

    /// [`Shot::dressed`] with the exact rotations.
    pub(super) fn exactly(&self, rig: &Rig, gaussians: &Gaussians) -> OwnedPosed {
        let exact: Vec<_> = self.exact.iter().map(|exact| Some(exact.quat)).collect();
        self.dressed(rig, gaussians, &exact)
    }

    /// Angles to the exact rotations, degrees, of the Gaussians that have a unique one. No answer counts as 180.
    pub(super) fn angles(&self, answers: &[Option<Quaternion<f64>>]) -> Vec<f64> {
        let unique = self.exact.iter().zip(answers).filter(|(exact, _)| exact.unique);
        unique
            .map(|(exact, answer)| {
                answer.map_or(180.0, |q| rotation::angle_between(q, exact.quat).to_degrees())
            })
            .map(|angle| if angle.is_nan() { 180.0 } else { angle })
            .collect()
    }
}

/// The strategy that is exact: the closed form of Eq. 7, SH rotated.
pub(super) fn stock() -> Strategy {
    Strategy {
        rotation: skinsplat_posing::RotationChoice::QuaternionAverage(Solver::ClosedForm),
        covariance: skinsplat_posing::CovarianceChoice::Rotate,
        colour: ColourChoice::RotateSh,
        clamp: skinsplat_posing::ClampChoice::NonNegative,
    }
}

/// Statistics over several shots.
pub(super) fn degrees(angles: impl IntoIterator<Item = Vec<f64>>) -> Option<Degrees> {
    Degrees::of(&angles.into_iter().flatten().collect::<Vec<_>>())
}

/// Rotations and weights laid out for solvers in T.
pub(super) struct Bones<T> {
    offsets: Vec<usize>,
    quats: Vec<Quaternion<T>>,
    weights: Vec<T>,
}

impl<T: Real> Bones<T> {
    /// Weights are scaled to sum to one.
    pub(super) fn new(joints: &[Quaternion<f64>], table: &SkinWeights) -> Self {
        let mut bones = Self { offsets: vec![0], quats: Vec::new(), weights: Vec::new() };
        for i in 0..table.len() {
            let (indices, weights) = table.row(i);
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            bones.quats.extend(indices.iter().map(|&j| joints[usize::from(j)].map(T::from_f64)));
            bones.weights.extend(weights.iter().map(|&w| T::from_f64(f64::from(w) / sum)));
            bones.offsets.push(bones.quats.len());
        }
        bones
    }

    pub(super) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The answer for one Gaussian.
    #[inline]
    pub(super) fn solve(&self, i: usize, candidate: Candidate) -> Option<Quaternion<T>> {
        let range = self.offsets[i]..self.offsets[i + 1];
        candidate.rotate(&self.quats[range.clone()], &self.weights[range])
    }
}

/// The heaviest `most` influences of every row, scaled to sum to one; the first of equally heavy ones are kept.
pub(super) fn truncated(table: &SkinWeights, most: usize, joints: usize) -> Result<SkinWeights, Error> {
    let row = |i: usize| {
        let (indices, weights) = table.row(i);
        let mut order: Vec<usize> = (0..indices.len()).collect();
        order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
        order.truncate(most);
        order.sort_unstable();
        let sum: f64 = order.iter().map(|&k| f64::from(weights[k])).sum();
        let share = |k: usize| (usize::from(indices[k]), (f64::from(weights[k]) / sum) as f32);
        order.into_iter().map(share).collect::<Vec<_>>()
    };
    Ok(SkinWeights::from_rows((0..table.len()).map(row), joints)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heaviest_influences_are_kept_and_sum_to_one() {
        let table = SkinWeights::from_rows([vec![(0, 0.1), (1, 0.5), (2, 0.3), (3, 0.1)], vec![(2, 1.0)]], 4)
            .expect("sums to one");
        let two = truncated(&table, 2, 4).expect("sums to one");
        assert_eq!(two.row(0), (&[1_u16, 2][..], &[0.625_f32, 0.375][..]));
        assert_eq!(two.row(1), table.row(1));
        let three = truncated(&table, 3, 4).expect("sums to one");
        assert_eq!(three.row(0).0, [0, 1, 2], "of two equal ones the first");
    }
}
