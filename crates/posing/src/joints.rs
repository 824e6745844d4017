//! The motion of the joints in one pose, as the kernels read it.

use glam::DMat3;
use skinsplat_core::math::dual_quaternion::DualQuaternion;
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::math::{Matrix3, Quaternion};
use skinsplat_core::scene::PosedBody;

/// How far the entries of a joint's linear part may be from its rotation's to count as rigid: what f32 quaternions of a
/// file leave.
const RIGID: f64 = 1e-6;

/// One entry per joint.
pub(super) struct Joints {
    /// Linear parts: rotations unless the rig scales.
    pub(super) linear: Vec<Matrix3<f32>>,
    /// Translations, metres.
    pub(super) translation: Vec<[f32; 3]>,
    /// Rotations as matrices, where they are not `linear`.
    pub(super) rotation_matrix: Option<Vec<Matrix3<f32>>>,
    /// Unit quaternions: the b_j of Eq. 7, the component of largest magnitude positive.
    pub(super) rotation: Vec<Quaternion<f32>>,
    /// The same, for what decides.
    pub(super) rotation_f64: Vec<Quaternion<f64>>,
    /// Rotation and translation (scale left out).
    pub(super) motion: Vec<DualQuaternion<f32>>,
}

impl Joints {
    pub(super) fn new(body: &PosedBody<'_>) -> Self {
        let joints = &body.joints;
        let rows = |m: DMat3| m.transpose().as_mat3().to_cols_array_2d();
        let rigid = joints.iter().all(|j| j.linear.abs_diff_eq(DMat3::from_quat(j.rotation), RIGID));
        let rotation_f64: Vec<Quaternion<f64>> = joints
            .iter()
            .map(|j| [j.rotation.w, j.rotation.x, j.rotation.y, j.rotation.z])
            .map(|q| SignPolicy::LargestPositive.apply(q, q))
            .collect();
        let rotation: Vec<Quaternion<f32>> = rotation_f64.iter().map(|q| q.map(|c| c as f32)).collect();
        let translation: Vec<[f32; 3]> = joints.iter().map(|j| j.translation.as_vec3().to_array()).collect();
        let motion = rotation.iter().zip(&translation).map(|(&q, &t)| DualQuaternion::new(q, t)).collect();
        Self {
            linear: joints.iter().map(|j| rows(j.linear)).collect(),
            rotation_matrix: (!rigid)
                .then(|| joints.iter().map(|j| rows(DMat3::from_quat(j.rotation))).collect()),
            translation,
            rotation,
            rotation_f64,
            motion,
        }
    }

    /// True if every joint moves rigidly, so that the blend of linear parts is the blend of rotations.
    pub(super) fn rigid(&self) -> bool {
        self.rotation_matrix.is_none()
    }
}
