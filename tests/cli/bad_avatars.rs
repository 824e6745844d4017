//! Avatars and cameras that are wrong.

use crate::args;
use crate::made_up::{Ply, camera, desk};
use crate::program::Desk;
use crate::support::fixture;
use serde_json::{Value, json};

/// Renders and inspects `bad.ply`: both refuse, and leave nothing.
fn refused(desk: &Desk, content: &[u8], parts: &[&str], what: &str) {
    desk.put("bad.ply", content);
    let before = desk.contents();
    let mut all = vec!["bad.ply"];
    all.extend(parts);
    desk.run(args!["render", "bad.ply", "--camera", "camera.json", "--out", "a.png"]).refuses(&all, what);
    desk.run(args!["inspect", "bad.ply"]).refuses(&all, what);
    assert!(desk.contents() == before, "{what}: files changed");
}

#[test]
fn avatars_that_are_wrong() {
    let desk = desk();
    let good = Ply::bound();
    let text = |ply: &Ply| ply.text().into_bytes();
    for (content, parts, what) in [
        (Vec::new(), vec!["header"], "empty"),
        (b"ply\n".to_vec(), vec!["header"], "one line"),
        (b"PNG what".to_vec(), vec!["header"], "not a PLY"),
        (good.text()[..60].into(), vec!["header"], "half a header"),
        (text(&good.clone().drop("opacity")), vec!["opacity", "missing"], "no opacity"),
        (text(&good.clone().drop("rot_3")), vec!["rot_3", "missing"], "three of four"),
        (text(&good.clone().drop("f_dc_1")), vec!["f_dc_1", "missing"], "two of three"),
        (text(&good.clone().drop("weight_1")), vec!["weight_"], "joints without weights"),
        (text(&good.clone().set(3, "x", "nan")), vec!["[3]", "finite"], "NaN position"),
        (text(&good.clone().set(2, "scale_1", "inf")), vec!["[2]", "finite"], "infinite scale"),
        (text(&good.clone().set(0, "opacity", "nan")), vec!["[0]", "finite"], "NaN opacity"),
        (text(&good.clone().set(5, "f_dc_2", "-inf")), vec!["[5", "finite"], "infinite colour"),
        (text(&good.clone().set(1, "rot_0", "0").set(1, "rot_1", "0")), vec!["[1]"], "zero quaternion"),
        (text(&good.clone().set(1, "y", "high")), vec!["y", "high"], "a word"),
        (
            text(&good.clone().set(4, "weight_0", "0").set(4, "weight_1", "0")),
            vec!["weights[4]", "sum 0", "a sum of 1"],
            "zero weights",
        ),
        (
            text(&good.clone().set(4, "weight_0", "0.5")),
            vec!["weights[4]", "sum 0.75", "a sum of 1"],
            "weights to 0.75",
        ),
        (
            text(&good.clone().set(4, "weight_0", "-0.5").set(4, "weight_1", "1.5")),
            vec!["weights[4]", "-0.5"],
            "negative weight",
        ),
        (text(&good.clone().set(4, "joint_0", "-1")), vec!["joint"], "negative joint"),
        (good.header("ascii", 4_000_000_000).into_bytes(), vec!["4000000000"], "4e9 rows, ascii"),
        (
            good.header("binary_little_endian", 4_000_000_000).into_bytes(),
            vec!["4000000000"],
            "4e9 rows, binary",
        ),
        (
            good.header("binary_little_endian", u64::MAX).into_bytes(),
            vec!["18446744073709551615"],
            "2^64 rows",
        ),
        (
            good.header("binary_middle_endian", 6).into_bytes(),
            vec!["format", "binary_middle_endian"],
            "format",
        ),
        (
            good.text().replace("element vertex 6", "element vertex -6").into_bytes(),
            vec!["vertex", "-6"],
            "negative count",
        ),
        (good.text().replace("element vertex 6", "element vertex 7").into_bytes(), vec!["7"], "a row short"),
        (good.text().replace("property float x", "property quad x").into_bytes(), vec!["quad"], "type"),
        (points("").into_bytes(), vec!["element vertex", "a point cloud"], "points"),
        (
            points("element face 1\nproperty list uchar int vertex_indices\n").into_bytes(),
            vec!["element vertex", "a mesh"],
            "a mesh",
        ),
    ] {
        refused(&desk, &content, &parts, what);
    }
}

/// A PLY of points, with more elements.
fn points(elements: &str) -> String {
    let properties = "property float x\nproperty float y\nproperty float z\n";
    format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}{elements}end_header\n0 0 0\n3 0 0 0\n")
}

#[test]
fn an_avatar_cut_off_anywhere() {
    let desk = desk();
    let whole = std::fs::read(fixture("raster/scene_S.ply")).unwrap();
    let header = whole.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    for length in [1, header / 2, header - 1, header, header + 1, whole.len() / 2, whole.len() - 1] {
        refused(&desk, &whole[..length], &[], &format!("{length} bytes"));
    }
}

#[test]
fn an_avatar_that_does_not_fit_the_body() {
    let desk = desk();
    let skin = |more: &[&str]| {
        let mut arguments = args!["skin", "other.ply", "--out", "out.ply"];
        arguments.extend(more.iter().map(std::ffi::OsString::from));
        desk.run(arguments)
    };
    desk.put("other.ply", Ply::bound().set(4, "joint_0", "3").text());
    let body = ["--body", "body.npz", "--poses", "poses.npz"];
    skin(&body).refuses(&["other.ply", "joint[4]", "body's 3 joints"], "a joint that the body has not");
    skin(&[]).refuses(&["--body"], "no body");
    let mut plain = Ply::bound();
    for name in ["joint_0", "joint_1", "weight_0", "weight_1"] {
        plain = plain.drop(name);
    }
    desk.put("other.ply", plain.text());
    let answer = skin(&body).exits(0, "a static scene hangs on the nearest points of the body");
    assert!(
        answer.err.contains("other.ply: no binding in the file: skinning weights of the nearest"),
        "{}",
        answer.err
    );
    std::fs::remove_file(desk.path("out.ply")).unwrap();
    desk.put("other.ply", Ply::bound().text());
    skin(&[&body[..], &["--frame", "2"]].concat()).refuses(&["poses.npz", "--frame 2", "below 2"], "frame");
    skin(&[&body[..], &["--strategy", "guess"]].concat()).refuses(&["--strategy", "guess"], "strategy");
    skin(&[&body[..], &["--strategy", "lbs+rotation=guess"]].concat()).refuses(&["guess"], "axis");
    skin(&[&body[..], &["--strategy", "lbs+taste=good"]].concat()).refuses(&["taste"], "no such axis");
    skin(&["--body", "nothing.npz"]).refuses(&["nothing.npz", "No such file"], "missing body");
    skin(&["--body", "poses.npz"]).refuses(&["poses.npz", "v_template"], "poses as a body");
    skin(&["--body", "body.npz", "--poses", "body.npz"]).refuses(&["body.npz"], "a body as poses");
    skin(&["--poses", "poses.npz"]).refuses(&["--body"], "poses without a body");
    assert!(!desk.path("out.ply").exists());
}

#[test]
fn cameras_that_are_wrong() {
    let desk = desk();
    let with = |key: &str, value: Value| {
        let mut camera = camera();
        camera[key] = value;
        camera.to_string()
    };
    for (content, parts, what) in [
        (String::new(), vec!["line 1"], "empty"),
        ("{".to_owned(), vec!["line 1"], "half"),
        ("[]".to_owned(), vec![], "a list"),
        ("{}".to_owned(), vec![], "no fields"),
        (with("fx", json!(0)), vec!["fx", "0"], "zero focal length"),
        (with("fy", json!(-80)), vec!["fy", "-80"], "negative focal length"),
        (with("fx", json!("wide")), vec!["wide"], "a word"),
        (with("width", json!(0)), vec!["width"], "no width"),
        (with("width", json!(4_000_000_000_u64)), vec!["4000000000"], "absurd width"),
        (with("height", json!(-1)), vec!["-1"], "negative height"),
        (with("cx", Value::Null), vec!["null"], "null"),
        (with("world_to_camera", json!([[1, 0], [0, 1]])), vec!["length 2"], "2x2"),
        (
            with("world_to_camera", json!([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]])),
            vec!["world_to_camera"],
            "singular",
        ),
        (
            with("world_to_camera", json!([[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 3], [0, 0, 0, 1]])),
            vec!["world_to_camera", "times 2.0000"],
            "scaled",
        ),
        (with("background", json!([1, 1])), vec!["length 2"], "two colours"),
    ] {
        desk.put("bad.json", content);
        let before = desk.contents();
        let mut all = vec!["bad.json"];
        all.extend(parts);
        let arguments = args!["render", "avatar.ply", "--camera", "bad.json", "--out", "a.png"];
        desk.run(arguments).refuses(&all, what);
        assert!(desk.contents() == before, "{what}: files changed");
    }
    let index =
        args!["render", "avatar.ply", "--camera", "camera.json", "--camera-index", "1", "--out", "a.png"];
    desk.run(index).refuses(&["camera.json", "--camera-index 1", "below 1"], "index");
}
