//! SMPL-style bodies and poses.

use crate::files::{self, Values};
use glam::{DVec3, Vec3};
use skinsplat_core::scene::PosedBody;
use skinsplat_data::{body, poses};
use std::path::{Path, PathBuf};

fn write(folder: &Path, arrays: &[(&str, &[u64], Values)]) -> PathBuf {
    let path = folder.join("file.npz");
    files::npz(&path, arrays);
    path
}

fn body_with(folder: &Path, name: &'static str, shape: &'static [u64], values: Values) -> PathBuf {
    let mut arrays = files::small_body();
    arrays.retain(|(n, ..)| *n != name);
    arrays.push((name, shape, values));
    write(folder, &arrays)
}

fn body_without(folder: &Path, name: &str) -> PathBuf {
    let mut arrays = files::small_body();
    arrays.retain(|(n, ..)| *n != name);
    write(folder, &arrays)
}

#[test]
fn a_body_is_read_shaped_and_posed() {
    let folder = tempfile::tempdir().unwrap();
    let body = body::load(&write(folder.path(), &files::small_body())).unwrap();
    assert_eq!(body.rest.faces, [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(body.rest.skeleton.names, ["joint 0", "joint 1"]);
    assert_eq!(body.rest.weights.row(2), (&[1u16][..], &[1.0f32][..]));
    let rest = body.shaped(&[2.0, 0.0]).unwrap();
    assert_eq!(rest.vertices[2], DVec3::new(4.0, 0.0, 0.0));
    assert_eq!(
        rest.skeleton.rest_locals[1].translation,
        DVec3::new(2.0, 0.0, 0.0),
        "joints follow the shape"
    );
    assert_eq!(body.shaped(&[0.0, 1.0]).unwrap_err().field, "betas[1]");

    let quarter = std::f32::consts::FRAC_PI_2;
    let path = folder.path().join("poses.npz");
    let thetas = Values::F32(vec![0., 0., 0., 0., 0., quarter]);
    let betas = Values::F32(vec![2.0]);
    files::npz(
        &path,
        &[
            ("thetas", &[1, 6], thetas),
            ("transl", &[1, 3], Values::F32(vec![0., 0., 7.])),
            ("betas", &[1], betas),
        ],
    );
    let track = poses::load(&path).unwrap();
    assert_eq!((track.len(), track.num_joints(), &track.betas[..]), (1, 2, &[2.0][..]));
    let rest = body.shaped(&track.betas).unwrap();
    let pose = &track.poses(&rest.skeleton).unwrap()[0];
    let mesh = PosedBody::new(&rest, pose).unwrap().mesh().vertices[2];
    assert!((mesh - Vec3::new(2.0, 2.0, 7.0)).length() < 1e-6, "{mesh}");
}

#[test]
fn models_of_other_writers_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let expected = body::load(&write(folder, &files::small_body())).unwrap();
    // The root's parent as SMPL's own files store it, faces under their other name.
    let unsigned = Values::U32(vec![u32::MAX, 0, 0, 1]);
    assert_eq!(body::load(&body_with(folder, "kintree_table", &[2, 2], unsigned)).unwrap(), expected);
    let mut arrays = files::small_body();
    arrays[1].0 = "faces";
    assert_eq!(body::load(&write(folder, &arrays)).unwrap(), expected);
    // Pose directions that are all zero count as none; others are kept, direction by direction.
    let zeros = Values::F32(vec![0.0; 4 * 3 * 9]);
    assert_eq!(body::load(&body_with(folder, "posedirs", &[4, 3, 9], zeros)).unwrap(), expected);
    let directions = Values::F32((0..108).map(|v| v as f32).collect());
    let body = body::load(&body_with(folder, "posedirs", &[4, 3, 9], directions)).unwrap();
    assert_eq!(body.rest.pose_directions.len(), 9);
    assert_eq!(body.rest.pose_directions[8][3], Vec3::new(89.0, 98.0, 107.0));
    // Rest joints instead of a regressor: they do not follow the shape.
    let mut arrays = files::small_body();
    arrays[4] = ("J", &[2, 3], Values::F32(vec![0., 0., 0., 1., 0., 0.]));
    let body = body::load(&write(folder, &arrays)).unwrap();
    assert_eq!(body.rest.skeleton, expected.rest.skeleton);
    assert_eq!(body.shaped(&[2.0]).unwrap().skeleton, expected.rest.skeleton);
}

#[test]
fn what_is_wrong_with_a_body_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for name in ["v_template", "weights", "kintree_table", "J_regressor"] {
        assert_eq!(body::load(&body_without(folder, name)).unwrap_err().field(), name);
    }
    assert_eq!(body::load(&body_without(folder, "f")).unwrap_err().field(), "faces");
    let f32s = |v: &[f32]| Values::F32(v.to_vec());
    let cases: [(&str, &[u64], Values, &str); 14] = [
        ("v_template", &[4, 2], f32s(&[0.0; 8]), "v_template"),
        ("v_template", &[5, 3], f32s(&[0.0; 15]), "weights"),
        ("v_template", &[4, 3], f32s(&[f32::NAN; 12]), "v_template[0, 0]"),
        ("f", &[1, 3], Values::I64(vec![0, 1, 4]), "f[0]"),
        ("f", &[1, 3], Values::I64(vec![0, 1, -1]), "f[0, 2]"),
        ("f", &[1, 3], Values::F64(vec![0.0, 1.5, 2.0]), "f[0, 1]"),
        ("weights", &[4, 2], f32s(&[1., 0., 0.5, 0.4, 0., 1., 0.25, 0.75]), "weights[1]"),
        ("weights", &[4, 2], f32s(&[1., 0., 0., 0., 0., 1., 0.25, 0.75]), "weights[1]"),
        ("weights", &[4, 2], f32s(&[1., 0., -1., 2., 0., 1., 0.25, 0.75]), "weights[1]"),
        ("kintree_table", &[2, 2], Values::I64(vec![1, 0, 0, 1]), "kintree_table[0, 0]"),
        ("kintree_table", &[2, 2], Values::I64(vec![-1, 5, 0, 1]), "kintree_table[0, 1]"),
        ("kintree_table", &[2, 2], Values::I64(vec![-1, 0, 0, 7]), "kintree_table[1, 1]"),
        ("posedirs", &[4, 3, 10], f32s(&[1.0; 120]), "posedirs"),
        ("joint_names", &[2], f32s(&[1.0; 2]), "joint_names"),
    ];
    for (name, shape, values, field) in cases {
        let mut arrays = files::small_body();
        arrays.retain(|(n, ..)| *n != name);
        arrays.push((name, shape, values));
        let path = write(folder, &arrays);
        let error = body::load(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), (field, path.as_path()), "{error}");
    }
    let pickle = folder.join("model.pkl");
    std::fs::write(&pickle, b"\x80\x02}q\x01.").unwrap();
    assert_eq!(body::load(&pickle).unwrap_err().field(), "v_template");
    assert_eq!(body::load(&folder.join("missing.npz")).unwrap_err().field(), "file");
}

#[test]
fn poses_come_whole_or_in_parts() {
    let folder = tempfile::tempdir().unwrap();
    let ramp = |n: usize, first: f32| Values::F32((0..n).map(|i| first + i as f32).collect());
    let whole = write(folder.path(), &[("thetas", &[1, 165], ramp(165, 0.0))]);
    let whole = poses::load(&whole).unwrap();
    let parts: [(&str, &[u64], Values); 7] = [
        ("right_hand_pose", &[1, 45], ramp(45, 120.0)),
        ("left_hand_pose", &[1, 45], ramp(45, 75.0)),
        ("reye_pose", &[1, 3], ramp(3, 72.0)),
        ("leye_pose", &[1, 3], ramp(3, 69.0)),
        ("jaw_pose", &[1, 3], ramp(3, 66.0)),
        ("body_pose", &[1, 63], ramp(63, 3.0)),
        ("global_orient", &[1, 3], ramp(3, 0.0)),
    ];
    let joined = poses::load(&write(folder.path(), &parts)).unwrap();
    let json = folder.path().join("transforms.json");
    let thetas: Vec<[f64; 3]> =
        (0..55).map(|j| std::array::from_fn(|c| f64::from(3 * j + c as u32))).collect();
    let text =
        serde_json::json!({ "betas": [], "poses": [{ "time": 0, "transl": [0, 0, 0], "thetas": thetas }] });
    std::fs::write(&json, text.to_string()).unwrap();
    let listed = poses::load(&json).unwrap();
    let body = body::load(&crate::support::data("blender/models/anny_smplx55.npz")).unwrap();
    let expected = whole.poses(&body.rest.skeleton).unwrap();
    assert_eq!(*joined.poses(&body.rest.skeleton).unwrap(), *expected);
    assert_eq!(*listed.poses(&body.rest.skeleton).unwrap(), *expected);
    assert_eq!(whole.num_joints(), 55);
    // Fewer joints than the body: the others rest. More: refused.
    let short = poses::load(&write(folder.path(), &[("thetas", &[1, 66], ramp(66, 0.0))])).unwrap();
    assert_eq!(
        short.poses(&body.rest.skeleton).unwrap()[0].locals[22..],
        body.rest.skeleton.rest_locals[22..]
    );
    // More than the body has: what it has no joints for is left out and said. Bodies of another family refuse it.
    let smpl = body::load(&crate::support::data("blender/models/anny_smpl24.npz")).unwrap();
    let cut = whole.poses(&smpl.rest.skeleton).unwrap();
    assert_eq!(cut[0].locals[21].rotation, expected[0].locals[21].rotation);
    assert_eq!(cut[0].locals[22..], smpl.rest.skeleton.rest_locals[22..]);
    assert!(
        whole.notes_for(&smpl.rest.skeleton)[0].starts_with("jaw_pose, leye_pose, reye_pose, left_hand_pose")
    );
    let tiny = body::load(&crate::support::data("small/tiny/models/body.npz")).unwrap();
    assert_eq!(whole.poses(&tiny.rest.skeleton).unwrap_err().field(), "thetas");
}

#[test]
fn what_is_wrong_with_poses_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let f32s = |n: usize, v: f32| Values::F32(vec![v; n]);
    type Arrays = Vec<(&'static str, &'static [u64], Values)>;
    let cases: Vec<(Arrays, &str)> = vec![
        (vec![], "global_orient"),
        (vec![("global_orient", &[1, 3], f32s(3, 0.0))], "body_pose"),
        (vec![("thetas", &[2, 7], f32s(14, 0.0))], "thetas"),
        (vec![("thetas", &[2, 6], f32s(12, f32::INFINITY))], "thetas[0, 0]"),
        (vec![("thetas", &[2, 6], f32s(12, 0.0)), ("transl", &[3, 3], f32s(9, 0.0))], "transl"),
        (
            vec![("thetas", &[1, 6], f32s(6, 0.0)), ("betas", &[2, 2], Values::F32(vec![0., 1., 0., 2.]))],
            "betas[1]",
        ),
        (
            vec![
                ("global_orient", &[1, 3], f32s(3, 0.0)),
                ("body_pose", &[1, 63], f32s(63, 0.0)),
                ("left_hand_pose", &[1, 48], f32s(48, 0.0)),
            ],
            "left_hand_pose",
        ),
        (vec![("thetas", &[2, 6], f32s(12, 0.0)), ("scale", &[2], Values::F32(vec![1.0, 0.0]))], "scale[1]"),
        (vec![("thetas", &[2, 6], f32s(12, 0.0)), ("scale", &[3], f32s(3, 1.5))], "scale"),
        (vec![("poses", &[2, 72], f32s(144, 0.0)), ("trans", &[2, 2], f32s(4, 0.0))], "trans"),
    ];
    for (arrays, field) in cases {
        let path = write(folder.path(), &arrays);
        let error = poses::load(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), (field, path.as_path()), "{error}");
    }
    let path = write(folder.path(), &[("thetas", &[1, 6], f32s(6, 0.0))]);
    assert_eq!(poses::load_clip(&path, Some("walk")).unwrap_err().field(), "clip");
}

/// Parts that are not a prefix of the order: each at its joints, whatever else is there.
#[test]
fn parts_keep_their_joints() {
    let folder = tempfile::tempdir().unwrap();
    let x = body::load(&crate::support::data("blender/models/anny_smplx55.npz")).unwrap().rest.skeleton;
    let smpl = body::load(&crate::support::data("blender/models/anny_smpl24.npz")).unwrap().rest.skeleton;
    let bent = |part: &'static str, width: usize| {
        let zeros = |n: usize| Values::F64(vec![0.0; n]);
        let body_width = if part == "body_pose" { width } else { 63 };
        let shape: &'static [u64] = Box::leak(vec![1, width as u64].into());
        let body_shape: &'static [u64] = Box::leak(vec![1, body_width as u64].into());
        let mut values = vec![0.0; width];
        values[width - 1] = 0.5;
        let mut arrays: Vec<(&str, &[u64], Values)> =
            vec![("global_orient", &[1, 3], zeros(3)), ("body_pose", body_shape, zeros(body_width))];
        arrays.retain(|(name, ..)| *name != part);
        arrays.push((part, shape, Values::F64(values)));
        poses::load(&write(folder.path(), &arrays)).unwrap()
    };
    let turned = |track: &poses::PoseTrack, skeleton: &skinsplat_core::scene::Skeleton| -> Vec<usize> {
        let pose = &track.poses(skeleton).unwrap()[0];
        let moved = pose.locals.iter().map(|local| local.rotation != glam::DQuat::IDENTITY);
        moved.enumerate().filter(|(_, moved)| *moved).map(|(joint, _)| joint).collect()
    };
    for (part, width, on_x, on_smpl) in [
        ("jaw_pose", 3, vec![22], vec![]),
        ("leye_pose", 3, vec![23], vec![]),
        ("reye_pose", 3, vec![24], vec![]),
        ("left_hand_pose", 45, vec![39], vec![]),
        ("right_hand_pose", 45, vec![54], vec![]),
        ("body_pose", 63, vec![21], vec![21]),
        ("body_pose", 69, vec![], vec![23]),
    ] {
        let track = bent(part, width);
        assert_eq!(
            (turned(&track, &x), turned(&track, &smpl)),
            (on_x.clone(), on_smpl.clone()),
            "{part} {width}"
        );
        assert_eq!(track.notes_for(&x).is_empty(), !on_x.is_empty(), "{part} {width}");
        assert_eq!(track.notes_for(&smpl).is_empty(), !on_smpl.is_empty(), "{part} {width}");
    }
}

/// AMASS and HUGS style: what the translation and the scale are called, and what they do.
#[test]
fn translation_and_scale_by_any_name() {
    let folder = tempfile::tempdir().unwrap();
    let body = body::load(&write(folder.path(), &files::small_body())).unwrap();
    let place = |extra: Vec<(&str, &[u64], Values)>| {
        let mut arrays: Vec<(&str, &[u64], Values)> =
            vec![("poses", &[1, 6], Values::F32(vec![0., 0., 0.3, 0., 0., 0.4]))];
        arrays.extend(extra);
        let track = poses::load(&write(folder.path(), &arrays)).unwrap();
        let poses = track.poses(&body.rest.skeleton).unwrap();
        let vertex = PosedBody::new(&body.rest, &poses[0]).unwrap().mesh().vertices[2];
        (vertex, track.notes().join("; "))
    };
    let (still, notes) = place(Vec::new());
    assert_eq!(notes, "");
    for name in ["transl", "trans", "smpl_trans", "Th"] {
        let (moved, notes) = place(vec![(name, &[1, 3], Values::F32(vec![0., 2., 5.]))]);
        assert!((moved - still - Vec3::new(0., 2., 5.)).length() < 1e-6, "{name}");
        assert_eq!(notes, "");
    }
    for (name, shape) in [("scale", &[1u64][..]), ("smpl_scaling", &[][..]), ("scaling", &[1, 1])] {
        let extra: Vec<(&str, &[u64], Values)> =
            vec![(name, shape, Values::F32(vec![1.25])), ("trans", &[1, 3], Values::F32(vec![0., 2., 5.]))];
        let (moved, notes) = place(extra);
        assert!((moved - (still * 1.25 + Vec3::new(0., 2., 5.))).length() < 1e-6, "{name}: {moved}");
        assert!(notes.contains("scaled by 1.25"), "{notes}");
    }
    let (_, notes) =
        place(vec![("Rh", &[1, 3], Values::F32(vec![0.; 3])), ("fps", &[], Values::F32(vec![30.]))]);
    assert_eq!(notes, "not read: Rh");
    let two = |other: f32| {
        let trans = ("trans", &[1, 3][..], Values::F32(vec![0., 2., 5.]));
        place(vec![trans, ("smpl_trans", &[1, 3], Values::F32(vec![0., 2., other]))]).1
    };
    assert_eq!(
        [two(5.0), two(6.0)],
        ["", "smpl_trans: not read, as trans is there too and holds other numbers"]
    );
}

#[test]
fn tracks_are_made_of_parts_and_joined() {
    use poses::{Part, PoseTrack};
    let path = Path::new("SMPLX/mesh-f00001_smplx.pkl");
    let x = body::load(&crate::support::data("blender/models/anny_smplx55.npz")).unwrap().rest.skeleton;
    let track = |angle: f64, hands: bool| {
        let mut parts = vec![(Part::GlobalOrient, vec![angle; 3]), (Part::BodyPose, vec![angle; 63])];
        if hands {
            parts.push((Part::LeftHand, vec![angle; 45]));
        }
        PoseTrack::from_parts(path, vec![1.0], parts, vec![DVec3::X * angle]).unwrap()
    };
    let all = PoseTrack::joined(path, vec![track(0.1, true), track(0.2, true).with_scales(&[2.0]).unwrap()])
        .unwrap();
    assert_eq!((all.len(), all.num_joints(), &all.betas[..]), (2, 37, &[1.0][..]));
    let poses = all.poses(&x).unwrap();
    assert_eq!(*track(0.1, true).poses(&x).unwrap(), poses[..1]);
    assert_eq!(poses[1].locals[0].scale, DVec3::splat(2.0));
    assert_eq!(poses[1].translation, DVec3::X * 0.2);
    assert_ne!(all.poses(&x).unwrap().digest(), track(0.1, true).poses(&x).unwrap().digest());
    assert!(PoseTrack::joined(path, vec![track(0.1, true), track(0.2, false)]).is_err());
    assert!(PoseTrack::joined(path, Vec::new()).is_err());
    let twice = vec![(Part::Jaw, vec![0.0; 3]), (Part::Jaw, vec![0.0; 3])];
    assert_eq!(
        PoseTrack::from_parts(path, Vec::new(), twice, vec![DVec3::ZERO]).unwrap_err().field(),
        "jaw_pose"
    );
    let uneven = vec![(Part::BodyPose, vec![0.0; 64])];
    assert!(PoseTrack::from_parts(path, Vec::new(), uneven, vec![DVec3::ZERO]).is_err());
    assert_eq!(track(0.1, false).with_scales(&[1.0, 2.0, 3.0]).unwrap_err().field(), "scale");
}
