//! Columns of what changes from a frame to the next.

use crate::args;
use crate::program::{Desk, copy};
use crate::support::data;
use serde_json::Value;
use std::ffi::OsString;

/// The small experiment with both columns, a strategy that deforms, a mesh, and renders of another program.
fn experiment() -> String {
    let columns = "[[columns]]\nmetric = \"flicker\"\n\n[[columns]]\nmetric = \"rotation-jumps\"\n\n";
    let renders = "{ recipe = \"renders\", path = \"theirs\" }";
    let variants = format!(
        "{}{}{}",
        variant("affine", "{ recipe = \"surface-vertex\" }", "strategy = \"view-canonical\"\nsh_degree = 1"),
        variant("mesh", "{ recipe = \"textured-mesh\", size = 64 }", ""),
        variant("renders", renders, "")
    );
    let small = include_str!("small.toml")
        .replace("id = \"small\"", "id = \"motion\"")
        .replace("recipe = \"fit\", name = \"hugs-skinned\"", "recipe = \"surface-face\"");
    small.replacen("[[variants]]", &format!("{columns}[[variants]]"), 1) + "sh_degree = 0\n" + &variants
}

fn variant(id: &str, avatar: &str, more: &str) -> String {
    format!("\n[[variants]]\nid = \"{id}\"\nlabel = \"{id}\"\navatar = {avatar}\n{more}\n")
}

/// A desk with it. The renders are one image for every frame.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("motion.toml", experiment());
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    let first = desk.bytes("data/tiny/test_b/images/image_0000.png");
    for k in 0..3 {
        desk.put(&format!("theirs/image_000{k}.png"), &first);
    }
    desk
}

fn run(desk: &Desk, out: &str, more: &[&str]) -> Value {
    let mut all = args!["-q", "run", "motion.toml", "--data", "data", "--out", out];
    all.extend(more.iter().map(OsString::from));
    desk.ok(all);
    serde_json::from_str(&desk.read(&format!("{out}/results.json"))).unwrap()
}

fn frames(results: &Value, variant: &str) -> Vec<Value> {
    let variants = results["tables"][0]["sequences"][0]["variants"].as_array().unwrap();
    let variant = variants.iter().find(|own| own["id"] == variant).unwrap();
    variant["frames"].as_array().unwrap().clone()
}

fn value(frame: &Value, metric: &str) -> Option<f64> {
    frame["score"]["values"][metric].as_f64()
}

/// Levels of a true image over white, as `avatar-v1` sees it.
fn levels(desk: &Desk, frame: usize) -> Vec<f64> {
    let open =
        |what: &str| image::open(desk.path(&format!("data/tiny/test_b/{what}_000{frame}.png"))).unwrap();
    let (image, mask) = (open("images/image").to_rgb8(), open("masks/mask").to_luma8());
    let over_white = |(rgb, alpha): (&image::Rgb<u8>, &image::Luma<u8>)| {
        let a = f64::from(alpha.0[0]) / 255.0;
        rgb.0.map(|level| (f64::from(level) * a + 255.0 * (1.0 - a) + 0.5).floor())
    };
    image.pixels().zip(mask.pixels()).flat_map(over_white).collect()
}

#[test]
fn a_frame_is_compared_with_the_one_before_it() {
    let desk = desk();
    let results = run(&desk, "all", &[]);
    for id in ["surface", "theirs"] {
        let frames = frames(&results, id);
        assert_eq!(frames.len(), 3);
        for (k, frame) in frames.iter().enumerate() {
            assert_eq!(value(frame, "flicker").is_some(), k > 0, "{frame}");
            assert_eq!(value(frame, "rotation-jumps"), (k > 0).then_some(0.0), "{frame}");
        }
        let why = frames[0]["score"]["not_computed"]["flicker"].as_str().unwrap();
        assert_eq!(why, "frame before: none by this camera; expected one that the same camera took");
    }
    // Renders that stand still flicker by what the truth moves.
    for (k, frame) in frames(&results, "renders").iter().enumerate().skip(1) {
        let [before, now] = [levels(&desk, k - 1), levels(&desk, k)];
        let moved: f64 = before.iter().zip(&now).map(|(a, b)| (a - b).abs()).sum();
        let (found, expected) = (value(frame, "flicker").unwrap(), moved / now.len() as f64);
        assert!(expected > 0.1 && (found - expected).abs() < 1e-9, "{found}, expected {expected}");
    }
    let page = desk.read("all/tables.md");
    for part in [
        "Between a frame and the one before it by the same camera in the data's sequence, scored or not",
        "by over 5 degrees more than the widest turn of any joint",
        "rotations: those of frames that another program rendered are not known",
        "rotations: the strategy deforms Gaussians and turns none",
        "rotations: a mesh has none",
    ] {
        assert!(page.contains(part), "no `{part}` in {page}");
    }
    assert!(!page.contains("time steps apart"), "{page}");

    // The frame before counts whether it is scored or not, and on whichever machine.
    let one = run(&desk, "one", &["--frames", "2..3"]);
    for id in ["surface", "theirs", "affine", "mesh", "renders"] {
        assert_eq!(frames(&one, id)[0]["score"], frames(&results, id)[2]["score"], "{id}");
    }
    for shard in ["1/2", "2/2"] {
        let out = ["-q", "run", "motion.toml", "--data", "data", "--out", "parts", "--shard", shard];
        desk.ok(out.map(OsString::from).into());
    }
    desk.ok(args!["-q", "merge", "parts"]);
    assert_eq!(desk.read("parts/results.json"), desk.read("all/results.json"));
}

#[test]
fn what_lies_further_apart_is_said() {
    let desk = desk();
    let file = "data/tiny/test_b/transforms.json";
    let mut sequence: Value = serde_json::from_str(&desk.read(file)).unwrap();
    sequence["frames"].as_array_mut().unwrap().remove(1);
    desk.put(file, sequence.to_string());
    run(&desk, "apart", &["--variant", "surface"]);
    let page = desk.read("apart/tables.md");
    assert!(page.contains("Data of tiny: frames of test_b are 2 time steps apart"), "{page}");
}
