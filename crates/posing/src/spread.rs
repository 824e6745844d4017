//! By how much a posed body is bent where its surface shows.

use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{PosedBody, RestBody};
use std::collections::BTreeSet;

/// Weight above which a joint counts as moving a face.
const LEAST_WEIGHT: f32 = 0.05;

/// Per face, the widest angle between rotations of two joints that move it, degrees, 0 to 180: joints with more than 0.05 of
/// the mean skinning weight of the face's vertices. The body must know the rotations of all joints.
pub fn face_spreads(body: &PosedBody<'_>) -> Vec<f32> {
    let rotation = |joint: usize| body.joints[joint].rotation;
    let spread = |face: &[u32; 3]| {
        let joints = moving(body.rest, face);
        let angle = |(i, &a): (usize, &usize)| {
            joints[..i].iter().map(|&b| portable::angle_between(rotation(a), rotation(b))).fold(0.0, f64::max)
        };
        joints.iter().enumerate().map(angle).fold(0.0, f64::max).to_degrees() as f32
    };
    body.rest.faces.par_iter().map(spread).collect()
}

/// The joints that move a face.
fn moving(rest: &RestBody, face: &[u32; 3]) -> Vec<usize> {
    let third = 1.0 / 3.0;
    let moved = rest.weights.mixed(&face.map(|vertex| (vertex as usize, third)));
    moved.iter().filter(|row| row.1 > LEAST_WEIGHT).map(|row| row.0).collect()
}

/// The pairs of joints that move one face of a body: those between which [`face_spreads`] takes angles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BendingJoints(Vec<[usize; 2]>);

impl BendingJoints {
    /// Those of a body.
    pub fn of(rest: &RestBody) -> Self {
        let pairs = |face: &[u32; 3]| {
            let joints = moving(rest, face);
            (0..joints.len())
                .flat_map(|i| (0..i).map(|k| [joints[k], joints[i]]).collect::<Vec<_>>())
                .collect()
        };
        let all: BTreeSet<[usize; 2]> =
            rest.faces.par_iter().flat_map_iter(|face| -> Vec<_> { pairs(face) }).collect();
        Self(all.into_iter().collect())
    }

    /// The largest of [`face_spreads`], degrees; none for a body that has no such joints. The body must know the rotations of all
    /// joints.
    pub fn widest(&self, body: &PosedBody<'_>) -> Option<f64> {
        let rotation = |joint: usize| body.joints[joint].rotation;
        let angles =
            self.0.iter().map(|&[a, b]| portable::angle_between(rotation(a), rotation(b)).to_degrees());
        angles.reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use skinsplat_core::scene::{Pose, RestBody, Skeleton, SkinWeights};

    #[test]
    fn the_widest_pair_above_the_least_weight_counts() {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let parents = vec![None, Some(0), Some(1)];
        let skeleton = Skeleton::from_joint_positions(names, parents, &[DVec3::ZERO; 3]).unwrap();
        let rows = [vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)], vec![(0, 0.5), (1, 0.38), (2, 0.12)]];
        let turns = [DVec3::ZERO, DVec3::X * 0.5, DVec3::X];
        let pose = Pose::from_axis_angles(&skeleton, &turns, DVec3::ZERO);
        let body = RestBody {
            skeleton,
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            faces: vec![[0, 0, 0], [1, 1, 1], [2, 2, 2], [1, 1, 2]],
            weights: SkinWeights::from_rows(rows, 3).unwrap(),
            uv: None,
            pose_directions: Vec::new(),
        };
        let posed = PosedBody::new(&body, &pose).unwrap();
        let spreads = face_spreads(&posed);
        let widest = BendingJoints::of(&body).widest(&posed).unwrap();
        assert!((widest - 1.5_f64.to_degrees()).abs() < 1e-9, "{widest}");
        // The third joint counts in the third face, and not in the fourth, which gives it a weight of 0.04.
        for (spread, expected) in spreads.iter().zip([0.0, 0.5, 1.5, 0.5_f32]) {
            assert!((spread - expected.to_degrees()).abs() < 1e-4, "{spreads:?}");
        }
    }
}
