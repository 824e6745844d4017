//! `skin`, and `render` of a posed avatar.

use crate::args;
use crate::made_up;
use crate::program::Desk;
use crate::rendering::differences;
use crate::reports::finished;
use crate::support::data;
use skinsplat_core::scene::Binding;
use skinsplat_data::ply;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::OnceLock;

/// An avatar of the Blender subject, bound to its body: one Gaussian per vertex, as a run makes it.
fn avatar() -> PathBuf {
    static DESK: OnceLock<(Desk, PathBuf)> = OnceLock::new();
    let make = || {
        let desk = finished();
        let files = std::fs::read_dir(desk.path("run/avatars")).unwrap().map(|file| file.unwrap().path());
        let mut avatars = files.filter(|path| path.extension().is_some_and(|extension| extension == "ply"));
        let path = avatars.next().unwrap();
        assert!(avatars.next().is_none());
        (desk, path)
    };
    DESK.get_or_init(make).1.clone()
}

/// The Blender subject's body and the second pose of a test sequence.
fn posing(strategy: &str) -> Vec<OsString> {
    let body = data("blender/models/anny_smpl24.npz");
    let poses = data("blender/datasets/snapshot_ava/test_twist/poses.npz");
    args!["--body", body, "--poses", poses, "--frame", "1", "--strategy", strategy]
}

fn with_posing(mut arguments: Vec<OsString>, strategy: &str) -> Vec<OsString> {
    arguments.extend(posing(strategy));
    arguments
}

/// The properties of the 3DGS layout at SH degree `degree`, in its order.
fn standard_properties(degree: usize) -> Vec<String> {
    let numbered = |name: &str, n: usize| (0..n).map(|i| format!("{name}_{i}")).collect::<Vec<_>>();
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
    names.extend(numbered("f_dc", 3));
    names.extend(numbered("f_rest", 3 * ((degree + 1).pow(2) - 1)));
    names.push("opacity".to_owned());
    names.extend(numbered("scale", 3));
    names.extend(numbered("rot", 4));
    names
}

#[test]
fn a_posed_avatar_is_a_plain_3dgs_file() {
    let desk = Desk::new();
    desk.ok(with_posing(args!["skin", avatar(), "--out", "posed.ply"], "quaternion-average"));
    let bytes = desk.bytes("posed.ply");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"), "{header}");
    let properties: Vec<&str> = header.lines().filter_map(|l| l.strip_prefix("property float ")).collect();
    assert_eq!(properties, standard_properties(1));
    assert_eq!(header.lines().filter(|l| l.starts_with("element ")).count(), 1, "{header}");
    assert!(!header.contains("property ushort") && !header.contains("property list"), "{header}");

    let posed = ply::read_avatar(&desk.path("posed.ply")).unwrap();
    let canonical = ply::read_avatar(&avatar()).unwrap();
    assert_eq!(posed.binding, Binding::Static);
    assert_eq!(posed.gaussians.len(), canonical.gaussians.len());
    assert_eq!(posed.gaussians.opacity_logits, canonical.gaussians.opacity_logits);
    for q in &posed.gaussians.rotations {
        let length = q.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 2.0 * f64::from(f32::EPSILON), "{q:?}");
    }
    assert_ne!(posed.gaussians.rotations, canonical.gaussians.rotations);
    assert_ne!(posed.gaussians.means, canonical.gaussians.means);
    assert_ne!(posed.gaussians.sh, canonical.gaussians.sh);
}

/// The paper's point: posing first and drawing with a rasterizer that knows nothing of posing gives the same image.
/// Stored rotations and scales are rounded to f32 once more on the way; a splat whose 1/255 cut-off or tile edge
/// falls the other way may show, as in the golden image.
#[test]
fn drawing_the_posed_file_is_drawing_the_posed_avatar() {
    let desk = Desk::new();
    let camera = data("blender/datasets/snapshot_ava/test_twist/cameras.npz");
    for strategy in ["quaternion-average", "dual-quaternion", "quaternion-average+rotation=polar"] {
        desk.ok(with_posing(args!["skin", avatar(), "--out", "posed.ply"], strategy));
        desk.ok(args!["render", "posed.ply", "--camera", camera, "--out", "a.npy"]);
        desk.ok(with_posing(args!["render", avatar(), "--camera", camera, "--out", "b.npy"], strategy));
        let differences = differences(&desk.path("a.npy"), &desk.path("b.npy"));
        let p999 = differences[differences.len() * 999 / 1000];
        let max = differences.last().unwrap();
        assert!(p999 <= 1e-5, "{strategy}: p99.9 {p999:e}");
        assert!(*max <= 4.0 / 255.0, "{strategy}: max {max:e}");
        // The pose shows.
        desk.ok(args!["render", avatar(), "--camera", camera, "--out", "rest.npy"]);
        assert!(*self::differences(&desk.path("a.npy"), &desk.path("rest.npy")).last().unwrap() > 0.1);
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let desk = Desk::new();
    for (name, threads) in [("one.ply", "1"), ("two.ply", "2")] {
        let arguments = args!["skin", avatar(), "--out", name, "--threads", threads];
        desk.ok(with_posing(arguments, "quaternion-average"));
    }
    assert!(desk.bytes("one.ply") == desk.bytes("two.ply"));
}

#[test]
fn a_strategy_that_no_static_file_can_hold_says_so() {
    let desk = Desk::new();
    let arguments = with_posing(args!["skin", avatar(), "--out", "posed.ply"], "view-canonical");
    let answer = desk.run(arguments).exits(0, "skin");
    assert!(answer.err.starts_with("posed.ply: "), "{}", answer.err);
    assert_eq!(answer.err.lines().count(), 1, "{}", answer.err);
    let exact = with_posing(args!["skin", avatar(), "--out", "posed.ply"], "quaternion-average");
    assert_eq!(desk.run(exact).err, "");
}

#[test]
fn every_preset_poses_a_small_avatar() {
    let desk = made_up::desk();
    for preset in skinsplat_posing::PRESETS {
        let posing =
            args!["--body", "body.npz", "--poses", "poses.npz", "--frame", "1", "--strategy", preset.id];
        let mut skin = args!["skin", "avatar.ply", "--out", "posed.ply"];
        skin.extend(posing.clone());
        desk.ok(skin);
        let mut render = args!["render", "avatar.ply", "--camera", "camera.json", "--out", "posed.png"];
        render.extend(posing);
        desk.ok(render);
    }
    // Without poses: at rest.
    desk.ok(args!["skin", "avatar.ply", "--body", "body.npz", "--out", "rest.ply"]);
    let [rest, canonical] =
        ["rest.ply", "avatar.ply"].map(|name| ply::read_avatar(&desk.path(name)).unwrap());
    for (a, b) in rest.gaussians.means.iter().zip(&canonical.gaussians.means) {
        assert!(a.distance(*b) < 1e-6, "{a} {b}");
    }
}

#[test]
fn gltf_clips_pose_by_name() {
    let desk = Desk::new();
    let rig = data("blender/models/ava_smpl24_4inf.glb");
    desk.put("avatar.ply", made_up::Ply::bound().text());
    let skin = |more: Vec<OsString>| {
        let mut arguments = args!["skin", "avatar.ply", "--out", "p.ply", "--body", rig, "--poses", rig];
        arguments.extend(more);
        desk.run(arguments)
    };
    for clip in ["twist", "squat"] {
        skin(args!["--clip", clip, "--frame", "39"]).exits(0, clip);
        skin(args!["--clip", clip, "--frame", "40"]).refuses(&["--frame 40", "below 40"], clip);
    }
    skin(args!["--clip", "dance"]).refuses(&["ava_smpl24_4inf.glb", "dance", "twist", "squat"], "clip");
    skin(args![]).refuses(&["ava_smpl24_4inf.glb", "twist", "squat"], "no clip");
}

#[test]
fn continuity_is_a_choice_of_signs() {
    let desk = Desk::new();
    let skin = |out: &str, more: &[&str], strategy: &str| {
        let mut arguments = with_posing(args!["skin", avatar(), "--out", out], strategy);
        arguments.extend(more.iter().map(OsString::from));
        desk.ok(arguments);
        desk.bytes(out)
    };
    let named = skin("a.ply", &[], "quaternion-average+rotation=lifted-sum");
    assert!(skin("b.ply", &["--continuity", "rest"], "quaternion-average") == named);
    // The second pose of a track that starts within 180 degrees of rest has the same signs.
    assert!(skin("c.ply", &["--continuity", "previous"], "quaternion-average") == named);
    assert!(skin("d.ply", &[], "quaternion-average") != named);
    let mut refused = with_posing(args!["skin", avatar(), "--out", "e.ply"], "lbs");
    refused.extend(args!["--continuity", "rest"]);
    desk.run(refused).refuses(&["--continuity", "gram-schmidt-columns", "average"], "another rotation");
}
