//! `conform`: the rig, the program's own skinning as an engine, verdicts and exit codes.

use crate::args;
use crate::program::Desk;
use serde_json::{Value, json};

/// A desk with a small rig.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.ok(args!["-q", "conform", "export", "--out", "rig"]);
    desk
}

#[test]
fn this_program_conforms() {
    let desk = desk();
    for poses in ["rig/poses.json", "rig/body.glb"] {
        for frame in ["0", "4"] {
            let arguments = args![
                "skin",
                "rig/avatar.ply",
                "--body",
                "rig/body.glb",
                "--poses",
                poses,
                "--frame",
                frame,
                "--out",
                "mine.ply"
            ];
            desk.ok(arguments);
            let text = desk.ok(args!["conform", "check", "rig", "mine.ply"]);
            assert!(text.starts_with("conforms within "), "{text}");
            assert!(text.contains(&format!("pose {frame}, by its values")), "{text}");
            assert!(text.contains("not judged: covariances, directions"), "{text}");
        }
    }
    let shown = desk.ok(args!["conform", "check", "rig", "rig/vectors.json", "--format", "json"]);
    let report: Value = serde_json::from_str(&shown).unwrap();
    assert_eq!((&report["verdict"], &report["explanations"]), (&json!("conforms"), &json!([])));
    let readme = desk.read("rig/README.md");
    assert!(!readme.contains('{') && readme.contains("54 Gaussians"), "{readme}");
}

#[test]
fn strategies_are_named_as_bugs() {
    let desk = desk();
    for (strategy, kind) in [
        ("quaternion-average+colour=none", "sh-not-turned"),
        ("quaternion-average+rotation=gram-schmidt-columns", "gram-schmidt"),
        ("quaternion-average+rotation=power-4", "too-few-power-steps"),
        ("quaternion-average+rotation=matrix-to-quaternion", "matrix-to-quaternion"),
        ("dual-quaternion", "dual-quaternions"),
    ] {
        let arguments = args![
            "skin",
            "rig/avatar.ply",
            "--body",
            "rig/body.glb",
            "--poses",
            "rig/poses.json",
            "--frame",
            "3",
            "--strategy",
            strategy,
            "--out",
            "pose_3.ply"
        ];
        desk.ok(arguments);
        let check = args!["conform", "check", "rig", "pose_3.ply", "--format", "json"];
        let report: Value = serde_json::from_str(&desk.run(check).exits(1, strategy).out).unwrap();
        assert_eq!(report["verdict"], "differs");
        let kinds: Vec<&str> =
            report["explanations"].as_array().unwrap().iter().map(|e| e["kind"].as_str().unwrap()).collect();
        assert!(kinds.contains(&kind), "{strategy}: {kinds:?}");
    }
}

#[test]
fn what_cannot_be_read_is_one_line() {
    let desk = desk();
    desk.put("empty.json", "{}");
    desk.put("nan.json", "{\"means\": [NaN]}");
    desk.put("half.bin", [b"SKINCONF".as_slice(), &[1, 0, 0, 0, 1, 0, 0, 0]].concat());
    desk.put("short.json", "{\"means\": [[[0, 0, 0]]]}");
    desk.put("nothing.json", "");
    for (arguments, parts) in [
        (args!["conform", "check", "rig", "nothing.json"], vec!["nothing.json", "an empty file"]),
        (
            args!["conform", "check", "rig", "rig/vectors.json", "--frame", "3"],
            vec!["vectors.json", "--frame: 3", "itself"],
        ),
        (args!["conform", "check", "rig", "missing.ply"], vec!["missing.ply", "cannot read"]),
        (args!["conform", "check", "rig", "empty.json"], vec!["empty.json", "no field"]),
        (args!["conform", "check", "rig", "nan.json"], vec!["nan.json", "NaN"]),
        (args!["conform", "check", "rig", "half.bin"], vec!["half.bin", "truncated"]),
        (args!["conform", "check", "rig", "short.json"], vec!["means", "1 poses", "6 poses of 54 Gaussians"]),
        (args!["conform", "check", ".", "rig/vectors.json"], vec!["conform.json", "conform export"]),
        (
            args!["conform", "check", "rig", "rig/vectors.json", "--convention", "unity"],
            vec!["skinsplat", "unity"],
        ),
        (
            args!["conform", "check", "rig", "rig/expected", "--convention", "unity"],
            vec!["skinsplat", "declared"],
        ),
        (args!["conform", "check", "rig", "rig/expected", "--convention", "maya"], vec!["maya", "unreal"]),
        (
            args!["conform", "check", "rig", "rig/expected/pose_0001.ply", "--frame", "9"],
            vec!["--frame", "below 6"],
        ),
        (
            args!["conform", "check", "rig", "rig/expected", "--tolerance", "0"],
            vec!["--tolerance", "above 0"],
        ),
        (args!["conform", "export", "--out", "rig/README.md"], vec!["README.md", "folder"]),
    ] {
        let what = format!("{arguments:?}");
        desk.run(arguments).refuses(&parts, &what);
    }
}

#[test]
fn exported_files_are_avatars_again() {
    let desk = desk();
    let posing = |more: &[&str]| {
        let fixed = ["export", "rig/avatar.ply", "--body", "rig/body.glb", "--poses", "rig/body.glb"];
        fixed.iter().chain(more).map(std::ffi::OsString::from).collect::<Vec<_>>()
    };
    desk.ok(posing(&["--all-frames", "--to", "posed-ply", "--out", "posed"]));
    let text = desk.ok(args!["conform", "check", "rig", "posed"]);
    assert!(text.contains("6 pose(s)"), "{text}");
    // A skinned file is avatar, body and poses in one.
    desk.ok(posing(&["--to", "skinned-glb", "--out", "skinned.glb"]));
    let skin = |avatar: &str, body: &str, out: &str| {
        let poses = ["skin", avatar, "--body", body, "--poses", body, "--frame", "2", "--out", out];
        desk.ok(poses.iter().map(std::ffi::OsString::from).collect());
    };
    let drawn = |avatar: &str, out: &str| {
        desk.ok(args!["render", avatar, "--camera", "rig/camera.json", "--out", out]);
        desk.bytes(out)
    };
    skin("skinned.glb", "skinned.glb", "a.ply");
    skin("rig/avatar.ply", "rig/body.glb", "b.ply");
    assert_eq!(drawn("a.ply", "a.png"), drawn("b.ply", "b.png"));
    // Degrees of SH.
    for (degree, properties) in [("0", 17), ("3", 62)] {
        desk.ok(posing(&["--to", "posed-ply", "--degree", degree, "--out", "p.ply"]));
        let bytes = desk.bytes("p.ply");
        let header = String::from_utf8_lossy(&bytes[..2500.min(bytes.len())]).into_owned();
        assert_eq!(header.matches("property float ").count(), properties, "degree {degree}");
    }
    desk.ok(posing(&["--frame", "2", "--to", "glb", "--out", "p.glb"]));
    desk.ok(posing(&["--frame", "2", "--to", "posed-ply", "--out", "p.ply"]));
    assert_eq!(drawn("p.glb", "a.png"), drawn("p.ply", "b.png"));
    assert!(desk.ok(args!["export", "rig/avatar.ply", "--to", "spz-hint"]).contains("splat-transform"));
}

#[test]
fn exports_that_are_wrong_are_one_line() {
    let desk = desk();
    for (arguments, parts) in [
        (args!["export", "rig/avatar.ply", "--to", "glb", "--out", "a.glb"], vec!["--body"]),
        (args!["export", "rig/avatar.ply", "--to", "glb", "--body", "rig/body.glb"], vec!["--out"]),
        (args!["export", "rig/avatar.ply", "--to", "glb", "--out", "x.ply"], vec!["x.ply", "ends in .glb"]),
        (
            args!["export", "rig/avatar.ply", "--to", "posed-ply", "--out", "x.glb"],
            vec!["x.glb", "ends in .ply"],
        ),
        (
            args![
                "export",
                "rig/avatar.ply",
                "--body",
                "rig/body.glb",
                "--poses",
                "rig/body.glb",
                "--all-frames",
                "--to",
                "skinned-glb",
                "--out",
                "s.glb"
            ],
            vec!["--all-frames", "skinned-glb"],
        ),
        (args!["export", "rig/avatar.ply", "--to", "fbx", "--out", "a.fbx"], vec!["fbx", "skinned-glb"]),
        (args!["export", "rig/avatar.ply", "--to", "glb", "--degree", "4", "--out", "a"], vec!["4"]),
        (
            args!["export", "rig/avatar.ply", "--body", "rig/body.glb", "--to", "glb", "--out", "none/a.glb"],
            vec!["none/a.glb", "cannot write"],
        ),
    ] {
        let what = format!("{arguments:?}");
        desk.run(arguments).refuses(&parts, &what);
    }
}
