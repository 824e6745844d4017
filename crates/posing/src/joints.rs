//! The motion of the joints in one pose, as the kernels read it.

use glam::{DMat3, DVec3};
use skinsplat_core::math::dual_quaternion::DualQuaternion;
use skinsplat_core::math::portable;
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::math::{Matrix3, Quaternion};
use skinsplat_core::scene::{JointTransform, PosedBody};

/// How far the entries of a joint's linear part may be from its rotation's to count as rigid: what f32 quaternions of a
/// file leave.
const RIGID: f64 = 1e-6;

/// How far a joint's size may be from 1 to count as 1: the scales of exported bones are off by their rounding.
const SCALE_NOISE: f64 = 1e-5;

/// What is left of a joint that is scaled to nothing.
const LEAST_SCALE: f64 = 1e-6;

/// How far the squares of a joint's three factors may be from one another to count as one, relative to their mean.
const SHEARED: f64 = 1e-3;

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
    /// By how much Gaussians grow on each joint; `None` if none of them scales.
    pub(super) scale: Option<Vec<f32>>,
}

/// The joints' sizes: a uniform scale where there is one, else the geometric mean of the three.
fn scales(joints: &[JointTransform]) -> Option<Vec<f32>> {
    let scales: Vec<f32> = joints.iter().map(|joint| scale(joint.linear) as f32).collect();
    scales.iter().any(|s| *s != 1.0).then_some(scales)
}

/// A joint that is scaled to nothing leaves a millionth, of which there is a logarithm; one that is flattened leaves sizes
/// alone.
fn scale(linear: DMat3) -> f64 {
    let size = portable::cbrt(linear.determinant().abs());
    if (size - 1.0).abs() <= SCALE_NOISE {
        return 1.0;
    }
    let vanishes = linear.to_cols_array().iter().all(|v| v.abs() <= LEAST_SCALE);
    if size < LEAST_SCALE && !vanishes { 1.0 } else { size.max(LEAST_SCALE) }
}

/// The first joint whose linear part is no rotation times one factor.
pub(super) fn first_sheared(joints: &[JointTransform]) -> Option<usize> {
    let sheared = |joint: &JointTransform| {
        let gram = joint.linear.transpose() * joint.linear;
        let square = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
        !gram.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(square)), SHEARED * square.max(f64::MIN_POSITIVE))
    };
    joints.iter().position(sheared)
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
            scale: if rigid { None } else { scales(joints) },
        }
    }

    /// True if every joint moves rigidly, so that the blend of linear parts is the blend of rotations.
    pub(super) fn rigid(&self) -> bool {
        self.rotation_matrix.is_none()
    }
}
