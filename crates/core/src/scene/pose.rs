//! A pose: one local transform per skeleton node, and a translation of the whole body.

use super::{LocalTransform, Skeleton};
use crate::math::portable;
use glam::{DQuat, DVec3};

/// The state of a skeleton in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// One per skeleton node, replacing the node's rest transform (SMPL: rest offset and `exp(theta_j)`).
    pub locals: Vec<LocalTransform>,
    /// Added to every vertex after skinning, metres (SMPL `transl`).
    pub translation: DVec3,
    /// Per node, `R(theta_j) - I` drives the pose blend shapes; `None` for rigs that have none.
    pub blend_shape_rotations: Option<Vec<DQuat>>,
}

impl Pose {
    /// The rest pose of a skeleton.
    pub fn rest(skeleton: &Skeleton) -> Self {
        Self { locals: skeleton.rest_locals.clone(), translation: DVec3::ZERO, blend_shape_rotations: None }
    }

    /// A pose of an SMPL-style skeleton (identity rest rotations) from axis-angle vectors, radians, one per joint.
    /// Missing joints keep their rest transform.
    pub fn from_axis_angles(skeleton: &Skeleton, axis_angles: &[DVec3], translation: DVec3) -> Self {
        let rotations: Vec<DQuat> = axis_angles.iter().map(|&r| portable::from_scaled_axis(r)).collect();
        let mut locals = skeleton.rest_locals.clone();
        for (local, rotation) in locals.iter_mut().zip(&rotations) {
            local.rotation = *rotation;
        }
        Self { locals, translation, blend_shape_rotations: Some(rotations) }
    }

    /// The pose with a further rotation of every node, `exp(ω) R` about the axes of its parent (ω is axis times angle,
    /// radians), and moved by a translation, metres. What drives blend shapes turns along. Vectors beyond the nodes are left
    /// out, as nodes beyond the vectors stay.
    #[must_use]
    pub fn turned(&self, rotations: &[DVec3], translation: DVec3) -> Self {
        let mut turned = self.clone();
        turned.translation += translation;
        for (node, &vector) in rotations.iter().enumerate().filter(|(_, vector)| **vector != DVec3::ZERO) {
            let further = portable::from_scaled_axis(vector);
            let turn = |rotation: &mut DQuat| *rotation = (further * *rotation).normalize();
            turned.locals.get_mut(node).map(|local| &mut local.rotation).into_iter().for_each(turn);
            let shapes = turned.blend_shape_rotations.as_mut();
            shapes.and_then(|rotations| rotations.get_mut(node)).into_iter().for_each(turn);
        }
        turned
    }
}
