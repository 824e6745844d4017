//! Strategies against reference values: Eq. 6-9 end to end with every wrong variant (`gs_math/skinned_end_to_end.json`),
//! and the frames and blends of the stock methods (`goldens/goldens.json`).
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use serde_json::Value;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{
    Avatar, Binding, ColourClamp, Gaussians, LocalTransform, OwnedPosed, Pose, PosedBody, RestBody, Skeleton,
    SkinWeights,
};
use skinsplat_posing::{BoundAvatar, FaceFrame, Strategy, face_frame, pose};

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn vec3(value: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(value))
}

fn quat(value: &Value) -> DQuat {
    let q = numbers(value);
    DQuat::from_xyzw(q[1], q[2], q[3], q[0])
}

/// From nine numbers or three rows, row-major.
fn mat3(value: &Value) -> DMat3 {
    DMat3::from_cols_slice(&numbers(value)).transpose()
}

/// A body whose joints are free roots at the origin, so that a pose gives any joint any motion.
fn free_joints(n: usize) -> RestBody {
    let skeleton =
        Skeleton::from_joint_positions(vec![String::new(); n], vec![None; n], &vec![DVec3::ZERO; n]).unwrap();
    let weights = SkinWeights::from_rows([[(0, 1.0f32)]; 3], n).unwrap();
    RestBody {
        skeleton,
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        faces: vec![[0, 1, 2]],
        weights,
        uv: None,
        pose_directions: Vec::new(),
    }
}

fn free_pose(motions: &[(DQuat, DVec3)]) -> Pose {
    let local =
        |&(rotation, translation)| LocalTransform { rotation, translation, ..LocalTransform::IDENTITY };
    Pose {
        locals: motions.iter().map(local).collect(),
        translation: DVec3::ZERO,
        blend_shape_rotations: None,
    }
}

/// One Gaussian of a fixture case, ready to pose.
struct Case {
    body: RestBody,
    pose: Pose,
    bound: BoundAvatar,
}

impl Case {
    fn new(
        motions: &[(DQuat, DVec3)],
        weights: &[f64],
        mean: DVec3,
        rotation: DQuat,
        scale: DVec3,
        sh: &[f64],
    ) -> Self {
        let body = free_joints(motions.len());
        let DQuat { w, x, y, z } = rotation;
        let coefficients: Vec<[f32; 3]> =
            sh.chunks(3).map(|c| [c[0] as f32, c[1] as f32, c[2] as f32]).collect();
        let degree = (coefficients.len() as f64).sqrt() as usize - 1;
        let gaussians = Gaussians {
            means: vec![mean.as_vec3()],
            rotations: vec![[w, x, y, z].map(|c| c as f32)],
            log_scales: vec![scale.map(f64::ln).as_vec3()],
            opacity_logits: vec![0.0],
            sh_degree: degree,
            sh: coefficients,
        };
        let row: Vec<(usize, f32)> = weights.iter().map(|&w| w as f32).enumerate().collect();
        let weights = SkinWeights::from_rows([row], motions.len()).unwrap();
        let avatar = Avatar { gaussians, binding: Binding::Vertex(weights) };
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        Self { pose: free_pose(motions), body, bound }
    }

    fn posed(&self, strategy: &str) -> OwnedPosed {
        let body = PosedBody::new(&self.body, &self.pose).unwrap();
        pose(&self.bound, &body, &strategy.parse::<Strategy>().unwrap()).unwrap()
    }
}

fn covariance(posed: &OwnedPosed) -> DMat3 {
    let m = posed.factors[0].as_dmat3();
    m * m.transpose()
}

/// What a renderer reads: SH along the view direction (through the frame, if any), plus 0.5, clamped.
fn colour(posed: &OwnedPosed, camera: DVec3) -> [f64; 3] {
    let direction = (posed.means[0].as_dvec3() - camera).normalize();
    let frame = posed.view_frames.as_ref().map_or(DMat3::IDENTITY, |frames| frames[0].as_dmat3());
    let direction = (frame * direction).normalize();
    let coefficients: Vec<[f64; 3]> = posed.sh.iter().map(|c| c.map(f64::from)).collect();
    let rgb = sh::evaluate(posed.sh_degree, &coefficients, direction.to_array());
    let top = if posed.colour_clamp == ColourClamp::Unit { 1.0 } else { f64::INFINITY };
    rgb.map(|c| (c + 0.5).clamp(0.0, top))
}

/// Upper triangle xx, xy, xz, yy, yz, zz.
fn assert_covariance(posed: &OwnedPosed, expected: &Value, scale: DVec3, tolerance: f64, what: &str) {
    let e = numbers(expected);
    let expected = if e.len() == 6 {
        DMat3::from_cols_array(&[e[0], e[1], e[2], e[1], e[3], e[4], e[2], e[4], e[5]])
    } else {
        DMat3::from_cols_slice(&e)
    };
    let error = (covariance(posed) - expected).abs();
    let largest = error.x_axis.max(error.y_axis).max(error.z_axis).max_element();
    let allowed = tolerance * scale.max_element().powi(2);
    assert!(largest <= allowed, "{what}: {largest:e} > {allowed:e}");
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance, "{what}[{k}]: {f} instead of {e}, off by {:e}", (f - e).abs());
    }
}

fn assert_same_rotation(found: [f32; 4], expected: &Value, tolerance: f64, what: &str) {
    let found = found.map(f64::from);
    let expected = numbers(expected);
    let dot: f64 = found.iter().zip(&expected).map(|(a, b)| a * b).sum();
    let signed: Vec<f64> = expected.iter().map(|c| c * dot.signum()).collect();
    assert_close(&found, &signed, tolerance, what);
}

#[test]
fn equations_6_to_9_end_to_end() {
    let cases = support::json("gs_math/skinned_end_to_end.json");
    let cases = cases.as_array().unwrap();
    assert_eq!(cases.len(), 30);
    for (index, case) in cases.iter().enumerate() {
        let bones = case["bone_quats_wxyz"].as_array().unwrap();
        let translations = case["bone_trans"].as_array().unwrap();
        let motions: Vec<(DQuat, DVec3)> =
            bones.iter().zip(translations).map(|(q, t)| (quat(q), vec3(t))).collect();
        let scale = vec3(&case["scale"]);
        let gaussian = Case::new(
            &motions,
            &numbers(&case["weights"]),
            vec3(&case["mean"]),
            quat(&case["quat_wxyz"]),
            scale,
            &numbers(&case["sh_16x3"]),
        );
        let camera = vec3(&case["cam_pos"]);
        let what = |field: &str| format!("case {index}, {field}");
        // Inputs are rounded to f32, and an error e in the blend moves the average by e / gap.
        let gap = case["eig_gap"].as_f64().unwrap();
        let tolerance = 2e-6_f64.max(6e-7 / gap);

        let skinned = gaussian.posed("quaternion-average");
        let mean = skinned.means[0].as_dvec3();
        assert_close(&mean.to_array(), &numbers(&case["posed_mean_eq6"]), 1e-6, &what("posed_mean_eq6"));
        let rotation = skinned.rotations.as_ref().unwrap()[0];
        assert_same_rotation(rotation, &case["posed_quat_eq8"], tolerance, &what("posed_quat_eq8"));
        assert_covariance(&skinned, &case["cov_markley"], scale, 2.0 * tolerance, &what("cov_markley"));
        let own = quat(&case["quat_wxyz"]).normalize();
        let turned = DQuat::from_xyzw(
            f64::from(rotation[1]),
            f64::from(rotation[2]),
            f64::from(rotation[3]),
            f64::from(rotation[0]),
        ) * own.conjugate();
        let blended = [turned.w, turned.x, turned.y, turned.z].map(|c| c as f32);
        assert_same_rotation(blended, &case["blended_quat_eq7"], tolerance, &what("blended_quat_eq7"));
        let sh: Vec<f64> = skinned.sh.iter().flatten().map(|&c| f64::from(c)).collect();
        let largest = sh.iter().fold(1.0f64, |m, c| m.max(c.abs()));
        let sh_tolerance = 6.0 * largest * tolerance;
        assert_close(&sh, &numbers(&case["posed_sh_eq9_16x3"]), sh_tolerance, &what("posed_sh_eq9_16x3"));
        let view = (mean - camera).normalize();
        assert_close(&view.to_array(), &numbers(&case["view_dir"]), 1e-6, &what("view_dir"));
        let rgb_tolerance = 4.0 * sh_tolerance;
        let expected = numbers(&case["rgb_skinned"]);
        assert_close(&colour(&skinned, camera), &expected, rgb_tolerance, &what("rgb_skinned"));
        let by_view = gaussian.posed("quaternion-average+colour=view-rotation");
        assert_close(&colour(&by_view, camera), &expected, rgb_tolerance, &what("rgb by view rotation"));

        let variants = &case["variants"];
        for (field, strategy, tolerance) in [
            ("cov_polar_lbs", "lbs+rotation=lbs-polar", 2.0 * tolerance),
            ("cov_raw_lbs", "view-canonical", 2e-6),
            ("cov_gram_schmidt_cols", "lbs", 2e-5),
            ("cov_gram_schmidt_rows", "lbs+rotation=gram-schmidt-rows", 2e-5),
            ("cov_hugs_normalised", "lbs+rotation=matrix-to-quaternion", 4e-6),
            ("cov_hugs_unnormalised_kernel", "hugs-original", 4e-6),
            ("cov_nlerp", "quaternion-average+rotation=nlerp", 4e-6),
        ] {
            if variants[field].is_null() {
                panic!("{}: missing", what(field));
            }
            assert_covariance(&gaussian.posed(strategy), &variants[field], scale, tolerance, &what(field));
        }
        for (field, strategy) in [
            ("rgb_unrotated_sh", "quaternion-average+colour=none"),
            ("rgb_viewdir_canon_MT", "view-canonical"),
            ("rgb_viewdir_canon_Minv", "view-canonical+colour=view-blend-inverse"),
        ] {
            let found = colour(&gaussian.posed(strategy), camera);
            assert_close(&found, &numbers(&variants[field]), rgb_tolerance, &what(field));
        }
        let field = "hugs_raw_quat_of_M_Rg";
        let hugs = gaussian.posed("hugs-original");
        assert!(hugs.rotations.is_none(), "{}: not a rotation", what(field));
        let kernel = raw_matrix(&numbers(&variants[field])) * DMat3::from_diagonal(scale);
        let largest = (hugs.factors[0].as_dmat3() - kernel).abs().to_cols_array();
        let largest = largest.iter().fold(0.0f64, |m, &c| m.max(c));
        assert!(largest <= 4e-6 * scale.max_element(), "{}: {largest:e}", what(field));
    }
}

/// `I + 2 w [v]x + 2 [v]x²`: what the 3DGS kernels draw for a quaternion of any length.
fn raw_matrix(q: &[f64]) -> DMat3 {
    let cross = DMat3::from_cols(
        DVec3::new(0.0, q[3], -q[2]),
        DVec3::new(-q[3], 0.0, q[1]),
        DVec3::new(q[2], -q[1], 0.0),
    );
    DMat3::IDENTITY + cross * (2.0 * q[0]) + cross * cross * 2.0
}

#[test]
fn three_bones_as_every_method_sees_them() {
    let goldens = support::json("goldens/goldens.json");
    let golden = &goldens["three_bone"];
    let bones: Vec<DMat3> = golden["bones"].as_array().unwrap().iter().map(mat3).collect();
    let motions: Vec<(DQuat, DVec3)> =
        bones.iter().map(|m| (DQuat::from_mat3(m).normalize(), DVec3::ZERO)).collect();
    let scale = vec3(&golden["s"]);
    let rotation = DQuat::from_mat3(&mat3(&golden["Rc"])).normalize();
    let weights = numbers(&golden["w"]);
    let sh: Vec<f64> = (0..48).map(|k| (f64::from(k) * 0.7).sin()).collect();
    let case = Case::new(&motions, &weights, DVec3::X, rotation, scale, &sh);

    for (field, strategy) in [
        ("cov_hugs", "hugs-original"),
        ("cov_lbs_TSTt", "view-canonical"),
        ("cov_animatable_conj", "animatable-original"),
        ("cov_skinned", "quaternion-average"),
        ("cov_skinned", "lbs+rotation=lbs-polar"),
        ("cov_skinned", "quaternion-average+rotation=eigen"),
        ("cov_skinned", "quaternion-average+rotation=polar"),
    ] {
        assert_covariance(&case.posed(strategy), &golden[field], scale, 4e-6, strategy);
    }
    let skinned = case.posed("quaternion-average");
    assert_same_rotation(skinned.rotations.unwrap()[0], &golden["skinned_q"], 1e-6, "skinned_q");

    let factor = |strategy: &str| {
        let upright = Case::new(&motions, &weights, DVec3::X, DQuat::IDENTITY, DVec3::ONE, &sh);
        upright.posed(strategy).factors[0].as_dmat3()
    };
    for (field, strategy) in [
        ("polar", "lbs+rotation=lbs-polar"),
        ("polar", "quaternion-average"),
        ("gs_rows", "lbs+rotation=gram-schmidt-rows"),
        ("gs_cols", "lbs"),
        ("blend", "view-canonical"),
    ] {
        let (found, expected) = (factor(strategy), mat3(&golden[field]));
        assert_close(&found.to_cols_array(), &expected.to_cols_array(), 1e-6, strategy);
    }

    let direction = vec3(&goldens["viewdir"]["d"]);
    for (field, strategy) in [
        ("BTd", "view-canonical"),
        ("BTd", "animatable-original"),
        ("RTd", "quaternion-average+colour=view-rotation"),
    ] {
        let frame = case.posed(strategy).view_frames.unwrap()[0].as_dmat3();
        let read = (frame * direction).normalize();
        assert_close(&read.to_array(), &numbers(&goldens["viewdir"][field]), 1e-6, strategy);
    }
    assert_eq!(case.posed("animatable-original").colour_clamp, ColourClamp::Unit);
}

#[test]
fn face_frames_as_the_stock_methods_build_them() {
    let goldens = support::json("goldens/goldens.json");
    let triangle = |value: &Value| -> [Vec3; 3] {
        let rows = value.as_array().unwrap();
        [0, 1, 2].map(|k: usize| vec3(&rows[k]).as_vec3())
    };
    let matrix =
        |frame: face_frame::Frame| Mat3::from_cols_array_2d(&frame).transpose().as_dmat3().to_cols_array();
    for (field, kind) in [
        ("frame_splatting", FaceFrame::SplattingAvatar),
        ("frame_ihuman", FaceFrame::IHuman),
        ("frame_haha", FaceFrame::Haha),
    ] {
        let golden = &goldens[field];
        let frame = face_frame::frame(kind, triangle(&golden["tri"])).unwrap();
        assert_close(&matrix(frame), &mat3(&golden["R"]).to_cols_array(), 3e-7, field);
        let quat = skinsplat_core::math::rotation::matrix_to_quaternion(frame);
        assert_same_rotation(quat, &golden["q"], 3e-7, field);
    }
    let rest = triangle(&goldens["frame_splatting"]["tri"]);
    let golden = &goldens["splatting_face_rot"];
    let posed = triangle(&golden["tri_def"]);
    for kind in [FaceFrame::SplattingAvatar, FaceFrame::IHuman] {
        let frames =
            [posed, rest].map(|t| face_frame::frame(kind, t).unwrap()).map(|f| Mat3::from_cols_array_2d(&f));
        // The arrays hold rows: this is F_posed F_restᵀ.
        let turn = frames[0].transpose() * frames[1];
        assert_close(&turn.as_dmat3().to_cols_array(), &mat3(&golden["R"]).to_cols_array(), 1e-6, "turn");
    }
}
