//! The body that strategies are tried on, and Gaussians on it.

use glam::{DQuat, DVec3, Vec3};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, Pose, RestBody, SceneError, SkinWeights};
use skinsplat_posing::{ColourChoice, CovarianceChoice, PRESETS, RotationChoice, Strategy};
use skinsplat_synthetic::{ArmShape, Parameters, Rig, Subject};
use std::sync::Arc;

/// Bones of the arm.
pub(super) const BONES: usize = 4;

/// Length of the arm, metres.
pub(super) const LENGTH: f64 = 0.8;

/// Radius of the arm, metres.
pub(super) const RADIUS: f64 = 0.06;

/// A tube of four bones along +X.
///
/// # Errors
/// None: the parameters are in range.
pub(super) fn body() -> Result<Arc<RestBody>, SceneError> {
    let shape =
        ArmShape { bones: BONES as u32, length: LENGTH, radius: RADIUS, edge: 0.015, ..ArmShape::default() };
    Ok(Arc::clone(Subject::new(&Parameters { rig: Rig::Arm(shape), ..Parameters::default() })?.body()))
}

/// A pose from the axis-angle vectors of the joints, radians.
pub(super) fn bent(body: &RestBody, angles: &[DVec3]) -> Pose {
    Pose::from_axis_angles(&body.skeleton, angles, DVec3::ZERO)
}

/// The pose followed by the world motion x' = Q x + t.
pub(super) fn moved(pose: &Pose, rotation: DQuat, translation: DVec3) -> Pose {
    let mut moved = pose.clone();
    moved.locals[0].rotation = rotation * pose.locals[0].rotation;
    moved.locals[0].translation = rotation * pose.locals[0].translation;
    moved.translation = rotation * pose.translation + translation;
    moved
}

/// Where the first joint is that moves, in the rest pose.
pub(super) fn moving_joint(body: &RestBody) -> DVec3 {
    -body.skeleton.inverse_binds[1].translation
}

/// What the probes hang on: shares of the joints.
pub(super) const PROBES: [(&str, &[(usize, f32)]); 6] = [
    ("equal pair", &[(0, 0.5), (1, 0.5)]),
    ("55:45 pair", &[(0, 0.55), (1, 0.45)]),
    ("80:20 pair", &[(0, 0.8), (1, 0.2)]),
    ("ends of the chain", &[(0, 0.5), (3, 0.5)]),
    ("four equal", &[(0, 0.25), (1, 0.25), (2, 0.25), (3, 0.25)]),
    ("four unequal", &[(0, 0.4), (1, 0.3), (2, 0.2), (3, 0.1)]),
];

/// A Gaussian per row of [`PROBES`], on the surface around the first moving joint, canonical rotation the identity.
///
/// # Errors
/// None: the rows sum to one.
pub(super) fn probes(body: &RestBody) -> Result<Avatar, SceneError> {
    let n = PROBES.len();
    let joint = moving_joint(body).x as f32;
    let place = |i: usize| {
        let (sin, cos) = portable::sin_cos(i as f32);
        Vec3::new(joint, RADIUS as f32 * cos, RADIUS as f32 * sin)
    };
    let rows = PROBES.map(|(_, row)| row.to_vec());
    let gaussians = Gaussians {
        means: (0..n).map(place).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![Vec3::splat(-4.0); n],
        opacity_logits: vec![0.0; n],
        sh_degree: 0,
        sh: vec![[0.5; 3]; n],
    };
    Ok(Avatar { gaussians, binding: Binding::Vertex(SkinWeights::from_rows(rows, BONES)?) })
}

/// A flat, long Gaussian per vertex of the body, along the arm, in stripes around it: what a wrong rotation shows on.
pub(super) fn surface(body: &RestBody) -> Avatar {
    let normals = skinsplat_core::scene::body::vertex_normals(&body.vertices, &body.faces);
    let n = body.vertices.len();
    let frame = |normal: &DVec3| {
        let across = normal.cross(DVec3::X).normalize_or(DVec3::Y);
        let along = across.cross(*normal).normalize_or(DVec3::X);
        let q = DQuat::from_mat3(&glam::DMat3::from_cols(along, across, along.cross(across)));
        [q.w as f32, q.x as f32, q.y as f32, q.z as f32]
    };
    let colour = |vertex: &DVec3| {
        let stripe =
            (6.0 * portable::atan2(vertex.z, vertex.y) / std::f64::consts::TAU).rem_euclid(1.0) < 0.5;
        let ring = (vertex.x / 0.1).rem_euclid(1.0) < 0.5;
        match (stripe, ring) {
            (true, true) => [1.2, -0.9, -1.2],
            (true, false) => [1.4, 0.6, -1.2],
            (false, true) => [-1.2, -0.2, 1.2],
            (false, false) => [0.9, 1.2, 1.4],
        }
    };
    let gaussians = Gaussians {
        means: body.vertices.iter().map(|v| v.as_vec3()).collect(),
        rotations: normals.iter().map(frame).collect(),
        log_scales: vec![Vec3::new(0.012, 0.005, 0.002).map(portable::ln); n],
        opacity_logits: vec![3.0; n],
        sh_degree: 0,
        sh: body.vertices.iter().map(colour).collect(),
    };
    Avatar { gaussians, binding: Binding::Vertex(body.weights.clone()) }
}

/// The rotation choices that are tried, each in the place of the quaternion average's: all that exist, and the solvers
/// that people use.
pub(super) fn rotations() -> Vec<RotationChoice> {
    let solvers = ["closed-form", "eigen", "polar", "power-15", "power-15-ones", "squaring-4", "nlerp"];
    let solvers =
        solvers.iter().filter_map(|id| id.parse::<Solver>().ok()).map(RotationChoice::QuaternionAverage);
    solvers.chain(RotationChoice::named()).collect()
}

/// A rotation choice with covariances rotated and colours left alone.
pub(super) fn plain(rotation: RotationChoice) -> Strategy {
    let base = PRESETS[0].strategy;
    Strategy { rotation, covariance: CovarianceChoice::Rotate, colour: ColourChoice::None, ..base }
}
