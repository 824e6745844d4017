//! A body in a pose: forward kinematics and linear blend skinning.

use super::body::vertex_normals;
use super::{LocalTransform, Pose, RestBody, SceneError};
use crate::math::rotation::unique_nearest_rotation;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use std::sync::OnceLock;

/// The motion of one joint relative to the rest pose: `x' = linear x + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTransform {
    /// Linear part (a rotation for SMPL; may carry scale in glTF).
    pub linear: DMat3,
    /// The rotation of `linear`: the b_j of Eq. 7. Its polar factor; where that is not unique (a joint scaled to nothing,
    /// or mirrored), the chain of rotations without scales.
    pub rotation: DQuat,
    /// Metres.
    pub translation: DVec3,
}

/// A body in a pose. The mesh is skinned when first asked for.
#[derive(Debug)]
pub struct PosedBody<'a> {
    /// The body in its rest pose.
    pub rest: &'a RestBody,
    /// One per deforming joint, [`Pose::translation`] included.
    pub joints: Vec<JointTransform>,
    pub(super) blend_shape_rotations: Option<Vec<DQuat>>,
    mesh: OnceLock<PosedMesh>,
}

/// Skinned vertices and their normals.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedMesh {
    /// World positions, metres.
    pub vertices: Vec<Vec3>,
    /// Area-weighted unit normals; zero where all incident faces are degenerate.
    pub normals: Vec<Vec3>,
}

impl<'a> PosedBody<'a> {
    /// Forward kinematics.
    ///
    /// # Errors
    /// A pose of another number of nodes, or with values that are not finite.
    pub fn new(rest: &'a RestBody, pose: &Pose) -> Result<Self, SceneError> {
        Self::with_rotations(rest, pose, |_| true)
    }

    /// [`PosedBody::new`] for a reader of some joints' rotations only: those of the others are left the identity, which
    /// saves a polar decomposition each. Means and meshes do not read rotations.
    ///
    /// # Errors
    /// As [`PosedBody::new`].
    pub fn with_rotations(
        rest: &'a RestBody,
        pose: &Pose,
        reads: impl Fn(usize) -> bool,
    ) -> Result<Self, SceneError> {
        let skeleton = &rest.skeleton;
        if pose.locals.len() != skeleton.len() {
            let problem = format!("{} joints", pose.locals.len());
            return Err(SceneError::new("pose", problem, format!("the body's {}", skeleton.len())));
        }
        let finite =
            |l: &LocalTransform| l.translation.is_finite() && l.rotation.is_finite() && l.scale.is_finite();
        if let Some(i) = pose.locals.iter().position(|l| !finite(l)) {
            return Err(SceneError::new(format!("pose[{i}]"), "NaN or infinite", "finite values"));
        }
        if !pose.translation.is_finite() {
            return Err(SceneError::new("transl", "NaN or infinite", "finite metres"));
        }
        let world = skeleton.world_transforms(&pose.locals);
        let rotations = std::cell::OnceCell::new();
        let joint = |(index, (world, bind)): (usize, (&DAffine3, &DAffine3))| {
            let skin = *world * *bind;
            let chained = || rotations.get_or_init(|| skeleton.rotations_from_rest(&pose.locals))[index];
            let rotation = || unique_nearest_rotation(skin.matrix3).unwrap_or_else(chained);
            JointTransform {
                linear: skin.matrix3,
                rotation: if reads(index) { rotation() } else { DQuat::IDENTITY },
                translation: skin.translation + pose.translation,
            }
        };
        let joints = world.iter().zip(&skeleton.inverse_binds).enumerate().map(joint).collect();
        Ok(Self {
            rest,
            joints,
            blend_shape_rotations: pose.blend_shape_rotations.clone(),
            mesh: OnceLock::new(),
        })
    }

    /// The skinned mesh (Eq. 6), computed in f64 on first use.
    pub fn mesh(&self) -> &PosedMesh {
        self.mesh.get_or_init(|| {
            let vertices = self.vertices();
            let normals = vertex_normals(&vertices, &self.rest.faces);
            PosedMesh {
                vertices: vertices.iter().map(|v| v.as_vec3()).collect(),
                normals: normals.iter().map(|n| n.as_vec3()).collect(),
            }
        })
    }

    /// World positions of the skinned vertices, metres.
    pub(super) fn vertices(&self) -> Vec<DVec3> {
        let rest = self.posed_rest_vertices();
        (0..rest.len()).map(|i| self.skinned(i, rest[i])).collect()
    }

    fn skinned(&self, vertex: usize, position: DVec3) -> DVec3 {
        let (joints, weights) = self.rest.weights.row(vertex);
        let moved = |(&j, &w): (&u16, &f32)| {
            let joint = &self.joints[usize::from(j)];
            (joint.linear * position + joint.translation) * f64::from(w)
        };
        joints.iter().zip(weights).map(moved).sum()
    }

    /// The vertices before skinning, with the shapes that the pose drives.
    pub(super) fn posed_rest_vertices(&self) -> std::borrow::Cow<'_, [DVec3]> {
        let Some(rotations) =
            self.blend_shape_rotations.as_ref().filter(|_| !self.rest.pose_directions.is_empty())
        else {
            return std::borrow::Cow::Borrowed(&self.rest.vertices);
        };
        let mut vertices = self.rest.vertices.clone();
        let features = rotations.iter().skip(1).flat_map(|&q| {
            let m = DMat3::from_quat(q) - DMat3::IDENTITY;
            (0..9).map(move |k| m.row(k / 3)[k % 3])
        });
        for (feature, direction) in features.zip(&self.rest.pose_directions) {
            if feature != 0.0 {
                for (vertex, offset) in vertices.iter_mut().zip(direction) {
                    *vertex += offset.as_dvec3() * feature;
                }
            }
        }
        std::borrow::Cow::Owned(vertices)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Skeleton, SkinWeights};
    use super::*;

    fn arm() -> RestBody {
        let names = vec!["shoulder".into(), "elbow".into()];
        let skeleton =
            Skeleton::from_joint_positions(names, vec![None, Some(0)], &[DVec3::ZERO, DVec3::X]).unwrap();
        RestBody {
            skeleton,
            vertices: vec![DVec3::X * 2.0, DVec3::X * 0.5, DVec3::Y],
            faces: vec![[0, 1, 2]],
            weights: SkinWeights::from_rows([vec![(1, 1.0)], vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)]], 2)
                .unwrap(),
            uv: None,
            pose_directions: Vec::new(),
        }
    }

    #[test]
    fn a_bent_elbow_moves_the_hand_only() {
        let body = arm();
        body.validate().unwrap();
        let quarter = DVec3::Z * std::f64::consts::FRAC_PI_2;
        let pose = Pose::from_axis_angles(&body.skeleton, &[DVec3::ZERO, quarter], DVec3::new(0.0, 0.0, 3.0));
        let posed = PosedBody::new(&body, &pose).unwrap();
        let mesh = posed.mesh();
        assert!((mesh.vertices[0] - Vec3::new(1.0, 1.0, 3.0)).length() < 1e-6);
        assert!((mesh.vertices[1] - Vec3::new(0.5, 0.0, 3.0)).length() < 1e-6);
        assert!(posed.joints[1].rotation.angle_between(DQuat::from_rotation_z(quarter.z)) < 1e-7);
    }

    #[test]
    fn joints_that_vanish_or_mirror_keep_the_rotation_of_their_chain() {
        let body = arm();
        let world = DQuat::from_scaled_axis(DVec3::new(0.3, -1.2, 0.5));
        let elbow = DQuat::from_scaled_axis(DVec3::new(-0.7, 0.2, 1.9));
        for scale in [DVec3::ZERO, DVec3::new(1.0, 1.0, -1.0), -DVec3::ONE, DVec3::ONE] {
            let mut pose = Pose::rest(&body.skeleton);
            pose.locals[0].rotation = world;
            (pose.locals[1].rotation, pose.locals[1].scale) = (elbow, scale);
            let posed = PosedBody::new(&body, &pose).unwrap();
            let off = posed.joints[1].rotation.angle_between(world * elbow);
            assert!(off < 1e-7, "{scale}: {off}");
        }
    }

    #[test]
    fn the_rest_pose_moves_nothing() {
        let body = arm();
        let posed = PosedBody::new(&body, &Pose::rest(&body.skeleton)).unwrap();
        for (posed, rest) in posed.mesh().vertices.iter().zip(&body.vertices) {
            assert!((*posed - rest.as_vec3()).length() < 1e-7);
        }
    }
}
