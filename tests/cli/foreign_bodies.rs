//! Bodies, poses and rigs of other people, through the program: where Gaussians end, and what is said.

use crate::args;
use crate::files::{Values, npz};
use crate::program::{Answer, Desk};
use crate::support::data;
use glam::Vec3;
use skinsplat_core::scene::Gaussians;
use std::path::PathBuf;

fn file(name: &str) -> PathBuf {
    data("small/foreign_bodies").join(name)
}

/// The posed Gaussians, and what was said.
fn skinned(avatar: &str, body: &str, poses: Option<&str>, strategy: &str) -> (Gaussians, String) {
    let desk = Desk::new();
    let mut arguments =
        args!["skin", file(avatar), "--body", file(body), "--out", "o.ply", "--strategy", strategy];
    if let Some(poses) = poses {
        arguments.extend(args!["--poses", file(poses)]);
    }
    let Answer { code, err, .. } = desk.run(arguments);
    assert_eq!(code, Some(0), "{err}");
    (skinsplat_data::ply::read_avatar(&desk.path("o.ply")).unwrap().gaussians, err)
}

const AVERAGE: &str = "quaternion-average";

#[test]
fn a_part_that_is_missing_moves_nothing() {
    let (complete, _) = skinned("smplx.ply", "smplx.npz", Some("poses_complete.npz"), AVERAGE);
    let (without_face, _) = skinned("smplx.ply", "smplx.npz", Some("poses_no_face.npz"), AVERAGE);
    assert_eq!(complete, without_face);
    assert_ne!(complete.rotations[25], complete.rotations[24], "the index finger turns");
}

#[test]
fn parts_beside_a_whole_pose_are_said_where_they_differ() {
    let desk = Desk::new();
    let said = |arrays: &[(&str, &[u64], Values)]| {
        npz(&desk.path("poses.npz"), arrays);
        let arguments = args!["skin", file("smplx.ply"), "--body", file("smplx.npz"), "--out", "o.ply"];
        desk.run([arguments, args!["--poses", "poses.npz"]].concat()).exits(0, "posed").err
    };
    let turned = |count: usize, at: usize| {
        let mut values = vec![0.0; count];
        values[at] = 0.6;
        Values::F64(values)
    };
    let finger = said(&[("poses", &[1, 66], turned(66, 5)), ("left_hand_pose", &[1, 45], turned(45, 2))]);
    assert!(finger.contains("left_hand_pose: not read, as another array has the part"), "{finger}");
    let other = said(&[("thetas", &[1, 66], turned(66, 5)), ("body_pose", &[1, 63], turned(63, 3))]);
    assert!(other.contains("body_pose: not read"), "{other}");
    // AMASS repeats in parts what the whole vector has.
    let amass = said(&[
        ("poses", &[1, 165], turned(165, 5)),
        ("root_orient", &[1, 3], Values::F64(vec![0.0; 3])),
        ("pose_body", &[1, 63], turned(63, 2)),
        ("pose_hand", &[1, 90], Values::F64(vec![0.0; 90])),
    ]);
    assert!(!amass.contains("not read"), "{amass}");
}

/// Numbers that are finite and no pose: said of the file that holds them, not of the file that was to be written.
#[test]
fn poses_beyond_all_bodies_are_refused() {
    let desk = Desk::new();
    for (name, shape, width, value) in
        [("trans", [1, 3], 3, 1e154), ("poses", [1, 165], 165, 1e154), ("scale", [1, 1], 1, 1e38)]
    {
        let mut values = vec![0.0; width];
        values[width - 1] = value;
        let mut arrays = vec![(name, &shape[..], Values::F64(values))];
        if name != "poses" {
            arrays.push(("poses", &[1, 165], Values::F64(vec![0.0; 165])));
        }
        npz(&desk.path("far.npz"), &arrays);
        let arguments = args!["skin", file("smplx.ply"), "--body", file("smplx.npz"), "--out", "o.ply"];
        desk.run([arguments, args!["--poses", "far.npz"]].concat()).refuses(&["far.npz: poses[0]"], name);
        assert!(!desk.path("o.ply").exists());
    }
}

#[test]
fn options_without_effect_are_refused() {
    let desk = Desk::new();
    let body = || args!["smpl.ply", "--body", file("smpl.npz"), "--out", "o.ply"];
    std::fs::copy(file("smpl.ply"), desk.path("smpl.ply")).unwrap();
    desk.run([args!["skin"], body(), args!["--frame", "3"]].concat())
        .refuses(&["--frame 3 without --poses"], "skin");
    let rest = desk.run([args!["skin"], body()].concat()).exits(0, "the rest pose");
    assert!(rest.err.contains("no --poses: the body is at rest"), "{}", rest.err);
    let hint = args!["export", "nofile", "--to", "spz-hint", "--out", "x.spz"];
    desk.run(hint).refuses(&["--out with --to spz-hint"], "a hint writes nothing");
}

/// 24 joints of SMPL on a body of SMPL-X: hands become jaw and eye.
#[test]
fn an_avatar_of_another_body_is_said() {
    let desk = Desk::new();
    let answer = desk.run(args!["skin", file("smpl.ply"), "--body", file("smplx.npz"), "--out", "o.ply"]);
    assert!(answer.err.contains("of the body's 55: made for another body?"), "{}", answer.err);
    let own = desk.run(args!["skin", file("smplx.ply"), "--body", file("smplx.npz"), "--out", "o.ply"]);
    assert!(!own.err.contains("another body"), "{}", own.err);
}

#[test]
fn translations_and_scales_count_by_any_name() {
    let (amass, _) = skinned("smpl.ply", "smpl.npz", Some("amass_style.npz"), AVERAGE);
    let (rest, _) = skinned("smpl.ply", "smpl.npz", None, AVERAGE);
    let (hugs, said) = skinned("smpl.ply", "smpl.npz", Some("hugs_style.npz"), AVERAGE);
    for i in 0..rest.len() {
        let off = amass.means[i] - rest.means[i] - Vec3::new(0.0, 2.0, 5.0);
        assert!(off.length() < 1e-5, "{i}: {off}");
        assert!((hugs.means[i] - rest.means[i] * 1.25).length() < 1e-5, "{i}: {}", hugs.means[i]);
        let grown = hugs.log_scales[i] - rest.log_scales[i] - Vec3::splat(1.25f32.ln());
        assert!(grown.abs().max_element() < 1e-5, "{i}: {grown}");
    }
    assert!(said.contains("scaled by 1.25"), "{said}");
}

#[test]
fn gaussians_grow_with_joints_that_scale() {
    let (affine, _) = skinned("scaled.ply", "scaled.gltf", None, "quaternion-average+covariance=affine");
    for strategy in [AVERAGE, "face-tbn", "hugs-original", "dual-quaternion"] {
        let (posed, said) = skinned("scaled.ply", "scaled.gltf", None, strategy);
        for i in 0..posed.len() {
            assert!(
                (posed.means[i] - affine.means[i]).length() < 1e-6,
                "{strategy}, {i}: {}",
                posed.means[i]
            );
            let off = posed.log_scales[i] - Vec3::splat(-2.0 - 4.605_170_2);
            assert!(off.abs().max_element() < 1e-4, "{strategy}, {i}: {}", posed.log_scales[i]);
        }
        assert!(!said.contains("unequal"), "{said}");
    }
    assert!((affine.log_scales[0] + 6.605_170_2).abs().max_element() < 1e-4);
    let desk = Desk::new();
    let text = std::fs::read_to_string(file("scaled.gltf")).unwrap();
    let text =
        text.replace("0.01,0.01,0.01", "0.01,0.02,0.01").replace("0.01, 0.01, 0.01", "0.01, 0.02, 0.01");
    let body = desk.put("sheared.gltf", text);
    let answer = desk.run(args!["skin", file("scaled.ply"), "--body", body, "--out", "o.ply"]);
    assert!(answer.err.contains("scales by unequal factors"), "{}", answer.err);
}

#[test]
fn joints_that_mirror_or_scale_by_0_are_said() {
    let desk = Desk::new();
    let rig: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file("scaled.gltf")).unwrap()).unwrap();
    let joint = rig["skins"][0]["joints"][0].as_u64().unwrap() as usize;
    for (scale, note) in [([-1.0, 1.0, 1.0], "mirrored"), ([0.0; 3], "scaled by 0")] {
        let mut rig = rig.clone();
        rig["nodes"][joint]["scale"] = serde_json::json!(scale);
        let body = desk.put("odd.gltf", rig.to_string());
        let answer = desk.run(args!["skin", file("scaled.ply"), "--body", &body, "--out", "o.ply"]);
        assert_eq!(answer.err.matches(note).count(), 1, "{}", answer.err);
        assert!(desk.ok(args!["inspect", &body]).contains(note), "{note}");
    }
}

#[test]
fn what_was_not_read_is_said() {
    let desk = Desk::new();
    let bodies = data("small/bodies");
    let answer = desk.run(args!["inspect", bodies.join("amass_poses.npz")]);
    for part in ["poses                2", "gender               neutral", "not read: dmpls"] {
        assert!(answer.out.contains(part), "{part}: {}", answer.out);
    }
    let answer = desk.run(args!["inspect", bodies.join("smpl.pkl")]);
    for part in ["pickled dictionary", "body model", "shape directions     10", "left_hand"] {
        assert!(answer.out.contains(part), "{part}: {}", answer.out);
    }
    let answer = desk.run(args!["inspect", bodies.join("aist_poses.pkl")]);
    assert!(answer.out.contains("scaled by 93.77"), "{}", answer.out);
    let answer = desk.run(args!["inspect", file("weights.gltf")]);
    assert!(answer.out.contains("1 of 4 rows summed to 0.9800"), "{}", answer.out);
    let answer = desk.run(args!["inspect", data("small/pickles/foreign.pkl")]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("__main__.Foreign"), "{}", answer.err);
}
