//! The stock methods step by step, in f64 and without the library's kernels; and what is degenerate.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::scene::{
    Avatar, Binding, ColourClamp, FaceBinding, OwnedPosed, Pose, PosedBody, RestBody, SkinWeights,
};
use skinsplat_posing::{
    BoundAvatar, ColourChoice, FaceFrame, PRESETS, PosingError, Strategy, face_frame, pose,
};

fn strategy(spec: &str) -> Strategy {
    spec.parse().unwrap()
}

fn posed(bound: &BoundAvatar, body: &PosedBody<'_>, spec: &str) -> OwnedPosed {
    pose(bound, body, &strategy(spec)).unwrap()
}

fn faces_of(avatar: &Avatar) -> &FaceBinding {
    let Binding::Face(binding) = &avatar.binding else { panic!("a face-bound avatar") };
    binding
}

fn unit(avatar: &Avatar, i: usize) -> DQuat {
    let [w, x, y, z] = avatar.gaussians.rotations[i].map(f64::from);
    DQuat::from_xyzw(x, y, z, w).normalize()
}

fn assert_factor(found: &Mat3, rotation: DQuat, scale: DVec3, what: &str) {
    let expected = DMat3::from_quat(rotation) * DMat3::from_diagonal(scale);
    let error = (found.as_dmat3() - expected).abs().to_cols_array().into_iter().fold(0.0, f64::max);
    // Edges of centimetres between f32 positions of a metre: 1e-5 of direction.
    assert!(error <= 2e-5 * scale.max_element(), "{what}: {error:e} of {:e}", scale.max_element());
}

/// SplattingAvatar's `utils/map.py`: d = b − a, columns [unit(d × n), unit(d × (d × n)), d].
fn splatting_frame([a, b, c]: [DVec3; 3]) -> DMat3 {
    let n = (b - a).cross(c - a).normalize();
    let d = (b - a).normalize();
    let x = d.cross(n).normalize();
    DMat3::from_cols(x, d.cross(x).normalize(), d)
}

#[test]
fn splattingavatar_sums_face_rotations_at_vertices() {
    let body = rig::body();
    let at = rig::bent(&body, 21, 0.5);
    let posed_body = PosedBody::new(&body, &at).unwrap();
    let mesh: Vec<DVec3> = posed_body.mesh().vertices.iter().map(|v| v.as_dvec3()).collect();
    let mut sums = vec![[0.0f64; 4]; body.vertices.len()];
    for face in &body.faces {
        let rest = face.map(|v| body.vertices[v as usize]);
        let turn = splatting_frame(face.map(|v| mesh[v as usize])) * splatting_frame(rest).transpose();
        let q = DQuat::from_mat3(&turn);
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        let area = 0.5 * (rest[1] - rest[0]).cross(rest[2] - rest[0]).length();
        for &v in face {
            for (sum, c) in sums[v as usize].iter_mut().zip([q.w, q.x, q.y, q.z]) {
                *sum += area * sign * c;
            }
        }
    }
    let vertices: Vec<DQuat> =
        sums.iter().map(|&[w, x, y, z]| DQuat::from_xyzw(x, y, z, w).normalize()).collect();

    let avatar = rig::on_faces(&body, 100, 22);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let found = posed(&bound, &posed_body, "splattingavatar-original");
    let frames = found.view_frames.as_ref().unwrap();
    let binding = faces_of(&avatar);
    for i in 0..100 {
        let corners = body.faces[binding.faces[i] as usize];
        let base = corners
            .iter()
            .zip(binding.barycentric[i])
            .fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (&v, b)| {
                sum + vertices[v as usize] * f64::from(b)
            });
        let base = base.normalize();
        let scale = avatar.gaussians.log_scales[i].as_dvec3().map(f64::exp);
        assert_factor(&found.factors[i], base * unit(&avatar, i), scale, "base ⊗ own");
        let back = (frames[i].as_dmat3() - DMat3::from_quat(base).transpose()).abs().to_cols_array();
        assert!(back.iter().all(|e| *e < 2e-5), "the direction is turned back by the base");

        let mix = |values: &[Vec3]| -> DVec3 {
            corners
                .iter()
                .zip(binding.barycentric[i])
                .map(|(&v, b)| values[v as usize].as_dvec3() * f64::from(b))
                .sum()
        };
        let mesh = posed_body.mesh();
        let mean = mix(&mesh.vertices) + mix(&mesh.normals).normalize() * f64::from(binding.offsets[i]);
        assert!(found.means[i].as_dvec3().distance(mean) < 3e-7, "Σ b v + unit(Σ b n) offset");
    }
}

#[test]
fn splattingavatar_has_a_seam_where_a_body_has_turned_round() {
    let body = rig::body();
    let avatar = rig::on_faces(&body, 200, 23);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let at = rig::bent(&body, 24, 0.3);
    let round = DQuat::from_rotation_y(3.1);
    let moved = rig::moved(&at, round, DVec3::ZERO);
    let [before, after] = [&at, &moved].map(|pose| PosedBody::new(&body, pose).unwrap());
    let worst = |policy: &str| {
        let spec = format!("splattingavatar-original+rotation=vertex-quaternions-{policy}");
        let [before, after] = [&before, &after].map(|body| posed(&bound, body, &spec).rotations.unwrap());
        let angle = |(q, p): (&[f32; 4], &[f32; 4])| {
            let [q, p] = [q, p].map(|q| q.map(f64::from)).map(|[w, x, y, z]| DQuat::from_xyzw(x, y, z, w));
            2.0 * (round * q).dot(p).abs().min(1.0).acos()
        };
        before.iter().zip(&after).map(angle).fold(0.0, f64::max)
    };
    assert!(worst("w") > 0.5, "neighbouring faces disagree in sign: {}", worst("w"));
    assert!(worst("align") < 2e-3, "{}", worst("align"));
}

#[test]
fn ihuman_keeps_its_in_plane_angle() {
    let body = rig::body();
    let mut avatar = rig::on_faces(&body, 60, 31);
    let binding = faces_of(&avatar).clone();
    let triangle =
        |vertices: &[Vec3], i: usize| body.faces[binding.faces[i] as usize].map(|v| vertices[v as usize]);
    let rest: Vec<Vec3> = body.vertices.iter().map(|v| v.as_vec3()).collect();
    let angle = |i: usize| {
        let (sin, cos) = (i as f32 * 0.37).sin_cos();
        [cos, sin]
    };
    for i in 0..60 {
        let frame = face_frame::ihuman_turned(triangle(&rest, i), angle(i)).unwrap();
        let [w, x, y, z] = skinsplat_core::math::rotation::matrix_to_quaternion(frame);
        avatar.gaussians.rotations[i] = [w, x, y, z];
        avatar.gaussians.log_scales[i].x = 1e-3f32.ln();
    }
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 32, 1.0)).unwrap();
    let found = posed(&bound, &posed_body, "ihuman-original");
    assert!(found.view_frames.is_none() && found.sh == avatar.gaussians.sh);
    for i in 0..60 {
        let frame = face_frame::ihuman_turned(triangle(&posed_body.mesh().vertices, i), angle(i)).unwrap();
        let rotation = DQuat::from_mat3(&Mat3::from_cols_array_2d(&frame).transpose().as_dmat3());
        let scale = avatar.gaussians.log_scales[i].as_dvec3().map(f64::exp);
        assert_factor(&found.factors[i], rotation, scale, "[n | r1' | r2'] diag(1 mm, s0, s1)");
    }
    // Any other Gaussian becomes the nearest disc: 1 mm along the posed normal.
    let other = rig::on_faces(&body, 60, 33);
    let bound = BoundAvatar::new(&other, &body).unwrap();
    let found = posed(&bound, &posed_body, "ihuman-original");
    for i in 0..60 {
        let corners =
            body.faces[faces_of(&other).faces[i] as usize].map(|v| posed_body.mesh().vertices[v as usize]);
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let along = (found.factors[i].transpose() * n).length();
        assert!((along - 1e-3).abs() < 1e-6, "{along}");
    }
}

#[test]
fn haha_grows_with_its_triangle() {
    let body = rig::body();
    let mut at = rig::bent(&body, 41, 0.0);
    at.locals[0].scale = DVec3::splat(2.0);
    let posed_body = PosedBody::new(&body, &at).unwrap();
    let joint = posed_body.joints[0];
    for avatar in [rig::on_vertices(&body, 50, 42), rig::on_faces(&body, 50, 42)] {
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let found = posed(&bound, &posed_body, "face-tbn+rotation=face-haha-scaled");
        for i in 0..50 {
            let mean = joint.linear * avatar.gaussians.means[i].as_dvec3() + joint.translation;
            assert!(found.means[i].as_dvec3().distance(mean) < 3e-6);
            let scale = avatar.gaussians.log_scales[i].as_dvec3().map(f64::exp) * 2.0;
            assert_factor(&found.factors[i], unit(&avatar, i), scale, "twice the size");
        }
    }
}

#[test]
fn joints_that_scale_do_not_change_the_average() {
    let body = rig::body();
    let at = rig::bent(&body, 45, 1.0);
    let mut scaled = at.clone();
    scaled.locals[0].scale = DVec3::splat(2.0);
    let [plain, scaled] = [&at, &scaled].map(|pose| PosedBody::new(&body, pose).unwrap());
    let avatar = rig::on_vertices(&body, 80, 46);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    for rotation in ["closed-form", "eigen", "lbs-polar", "gram-schmidt-columns", "gram-schmidt-rows"] {
        let spec = format!("quaternion-average+rotation={rotation}");
        let [a, b] = [&plain, &scaled].map(|body| posed(&bound, body, &spec));
        for (a, b) in a.rotations.as_ref().unwrap().iter().zip(b.rotations.as_ref().unwrap()) {
            let angle = skinsplat_core::math::rotation::angle_between(a.map(f64::from), b.map(f64::from));
            assert!(angle < 1e-5, "{rotation}: {angle:e}");
        }
    }
}

#[test]
fn vertex_averages_are_averaged_again_over_the_face() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 51, 1.0)).unwrap();
    let avatar = rig::on_faces(&body, 80, 52);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let found = posed(&bound, &posed_body, "quaternion-average+rotation=vertex-average");
    let binding = faces_of(&avatar);
    for i in 0..80 {
        let corners = body.faces[binding.faces[i] as usize].map(|v| {
            let (joints, weights) = body.weights.row(v as usize);
            let quats: Vec<[f64; 4]> = joints
                .iter()
                .map(|&j| posed_body.joints[usize::from(j)].rotation)
                .map(|q| [q.w, q.x, q.y, q.z])
                .collect();
            let weights: Vec<f64> = weights.iter().map(|&w| f64::from(w)).collect();
            average_rotation(&quats, &weights, Solver::Eigen).unwrap()
        });
        let weights = binding.barycentric[i].map(f64::from);
        let [w, x, y, z] = average_rotation(&corners, &weights, Solver::Eigen).unwrap();
        let scale = avatar.gaussians.log_scales[i].as_dvec3().map(f64::exp);
        assert_factor(
            &found.factors[i],
            DQuat::from_xyzw(x, y, z, w) * unit(&avatar, i),
            scale,
            "two stages",
        );
    }
}

#[test]
fn animatable_clamps_to_one_and_turns_the_direction_with_the_blend() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 61, 1.0)).unwrap();
    let avatar = rig::on_vertices(&body, 40, 62);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let found = posed(&bound, &posed_body, "animatable-original");
    assert_eq!(found.colour_clamp, ColourClamp::Unit);
    assert!(found.rotations.is_none());
    let Binding::Vertex(weights) = &avatar.binding else { panic!("a vertex-bound avatar") };
    for i in 0..40 {
        let (joints, weights) = weights.row(i);
        let mut blend = DMat3::ZERO;
        for (&joint, &weight) in joints.iter().zip(weights) {
            blend += posed_body.joints[usize::from(joint)].linear * f64::from(weight);
        }
        let view = (found.view_frames.as_ref().unwrap()[i].as_dmat3() - blend.transpose()).abs();
        assert!(view.to_cols_array().iter().all(|e| *e < 1e-6), "Bᵀ");
        let scale = avatar.gaussians.log_scales[i].as_dvec3().map(f64::exp);
        let factor = blend * DMat3::from_quat(unit(&avatar, i).conjugate()) * DMat3::from_diagonal(scale);
        let error = (found.factors[i].as_dmat3() - factor).abs().to_cols_array();
        assert!(error.iter().all(|e| *e < 1e-6 * scale.max_element()), "B R_cᵀ S");
    }
}

/// Degenerate in every way: faces without area, all corners of a face at one point, half turns.
fn broken_body() -> RestBody {
    let mut body = rig::body();
    let first = body.faces[0];
    body.faces[3] = [first[0], first[0], first[1]];
    body.faces[5] = [first[0]; 3];
    let n = body.vertices.len();
    for v in 0..n / 3 {
        body.vertices[v] = body.vertices[0];
    }
    body
}

#[test]
fn degenerate_input_has_an_answer() {
    let body = broken_body();
    let mut half_turns = Pose::rest(&body.skeleton);
    for (j, axis) in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::X].into_iter().enumerate() {
        half_turns.locals[j + 1].rotation = DQuat::from_axis_angle(axis, std::f64::consts::PI);
    }
    let mut flat = rig::bent(&body, 71, 1.0);
    flat.locals[0].scale = DVec3::new(1.0, 1.0, 0.0);
    let mut vanished = flat.clone();
    vanished.locals[0].scale = DVec3::ZERO;
    let rows = (0..64).map(|i| match i % 4 {
        0 => vec![(1, 0.5), (0, 0.5)],
        1 => vec![(0, 0.25), (1, 0.25), (2, 0.25), (3, 0.25)],
        2 => vec![(2, 0.5), (2, 0.5)],
        _ => vec![(4, 1.0)],
    });
    let mut on_vertices = rig::on_vertices(&body, 64, 72);
    on_vertices.binding = Binding::Vertex(SkinWeights::from_rows(rows, rig::JOINTS).unwrap());
    let mut on_faces = rig::on_faces(&rig::body(), 64, 73);
    let Binding::Face(binding) = &mut on_faces.binding else { panic!("a face-bound avatar") };
    binding.faces.iter_mut().enumerate().for_each(|(i, face)| *face = i as u32);
    binding.barycentric[7] = [2.0, -0.5, -0.5];
    for avatar in [on_vertices, on_faces] {
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        for at in [&half_turns, &flat, &vanished, &Pose::rest(&body.skeleton)] {
            let posed_body = PosedBody::new(&body, at).unwrap();
            for strategy in rig::strategies() {
                let found = pose(&bound, &posed_body, &strategy).unwrap();
                let finite = |m: &Mat3| m.is_finite();
                assert!(found.means.iter().all(|m| m.is_finite()), "{strategy}: means");
                assert!(found.factors.iter().all(finite), "{strategy}: factors");
                assert!(found.sh.iter().flatten().all(|c| c.is_finite()), "{strategy}: SH");
                assert!(found.view_frames.iter().flatten().all(finite), "{strategy}: view frames");
                let zero = |m: &Mat3| *m == Mat3::ZERO;
                assert!(!found.view_frames.iter().flatten().any(zero), "{strategy}: a view frame of zeros");
                for q in found.rotations.iter().flatten() {
                    let norm = q.iter().map(|c| c * c).sum::<f32>().sqrt();
                    assert!((norm - 1.0).abs() < 2e-6, "{strategy}: |q| = {norm}");
                }
                assert_eq!(
                    found,
                    pose(&bound, &posed_body, &strategy).unwrap(),
                    "{strategy}: not repeatable"
                );
            }
        }
    }
}

#[test]
fn static_avatars_stay() {
    let body = rig::body();
    let avatar = Avatar { binding: Binding::Static, ..rig::on_vertices(&body, 30, 81) };
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 82, 1.0)).unwrap();
    let expected = OwnedPosed::from_static(&avatar.gaussians);
    for preset in PRESETS.iter().filter(|preset| preset.id != "animatable-original") {
        let found = pose(&bound, &posed_body, &preset.strategy).unwrap();
        assert_eq!(found.means, expected.means);
        for (a, b) in found.factors.iter().zip(&expected.factors) {
            assert!((*a - *b).abs().to_cols_array().iter().all(|e| *e < 1e-8), "{}", preset.id);
        }
    }
}

#[test]
fn errors_say_what_lacks() {
    let mut body = rig::body();
    let avatar = rig::on_vertices(&body, 10, 91);
    let with_faces = BoundAvatar::new(&avatar, &body).unwrap();
    assert!(with_faces.face(9).is_some() && with_faces.face(10).is_none());
    body.faces.clear();
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let posed_body = PosedBody::new(&body, &Pose::rest(&body.skeleton)).unwrap();
    for spec in
        ["face-tbn", "ihuman-original", "quaternion-average+rotation=vertex-average", "lbs+covariance=surfel"]
    {
        let error = pose(&bound, &posed_body, &strategy(spec)).unwrap_err();
        assert_eq!(error, PosingError::NoFaces { strategy: spec.into() });
        assert!(error.to_string().contains("no faces"), "{error}");
    }
    assert!(pose(&bound, &posed_body, &strategy("lbs")).is_ok());
    let other = pose(&with_faces, &posed_body, &strategy("lbs")).unwrap_err().to_string();
    assert!(other.contains("0 faces") && other.contains("240 faces"), "{other}");

    let mut wrong = avatar.clone();
    wrong.gaussians.rotations[3] = [0.0; 4];
    let error = BoundAvatar::new(&wrong, &body).unwrap_err().to_string();
    assert!(error.contains("rot[3]") && error.contains("zero quaternion"), "{error}");
    let mut foreign = rig::on_faces(&rig::body(), 5, 92);
    let Binding::Face(binding) = &mut foreign.binding else { panic!("a face-bound avatar") };
    binding.faces[2] = 1_000;
    let error = BoundAvatar::new(&foreign, &rig::body()).unwrap_err().to_string();
    assert!(error.contains("face[2]") && error.contains("240"), "{error}");
}

#[test]
fn degree_0_colours_are_not_touched() {
    let body = rig::body();
    let mut avatar = rig::on_vertices(&body, 20, 95);
    avatar.gaussians.sh_degree = 0;
    avatar.gaussians.sh.truncate(20);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 96, 1.0)).unwrap();
    for colour in ColourChoice::ALL {
        let found = pose(&bound, &posed_body, &Strategy { colour, ..strategy("lbs") }).unwrap();
        assert!(found.sh == avatar.gaussians.sh && found.view_frames.is_none());
    }
    let kinds = [FaceFrame::SplattingAvatar, FaceFrame::IHuman, FaceFrame::Haha, FaceFrame::HahaScaled];
    assert!(kinds.iter().all(|&kind| face_frame::frame(kind, [Vec3::ONE; 3]).is_none()));
}
