//! Bodies, poses and rigs of other people, through the program: where Gaussians end, and what is said.

use crate::args;
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
