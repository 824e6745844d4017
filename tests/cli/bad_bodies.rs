//! Bodies and poses that are wrong.

use crate::args;
use crate::made_up::{self, Field, desk, with, without, write_npz};
use crate::program::Desk;
use crate::support::data;

fn skin(desk: &Desk, body: &str, poses: &str) -> crate::program::Answer {
    let mut arguments = args!["skin", "avatar.ply", "--out", "out.ply", "--body", body];
    arguments.extend(args!["--poses", poses, "--frame", "1"]);
    desk.run(arguments)
}

#[test]
fn the_made_up_body_is_right() {
    skin(&desk(), "body.npz", "poses.npz").exits(0, "skin");
}

#[test]
fn bodies_that_are_wrong() {
    let desk = desk();
    let body = made_up::body;
    let set = |name: &'static str, index: usize, value: f32| with(body(), name, |f| f.2[index] = value);
    let reshaped = |name: &'static str, shape: Vec<u64>| {
        with(body(), name, |f| {
            f.2.resize(shape.iter().product::<u64>() as usize, 0.0);
            f.1 = shape;
        })
    };
    let cases: Vec<(Vec<Field>, Vec<&str>, &str)> = vec![
        (without(body(), "v_template"), vec!["v_template", "missing"], "no vertices"),
        (without(body(), "f"), vec!["f", "missing"], "no faces"),
        (without(body(), "weights"), vec!["weights", "missing"], "no weights"),
        (without(body(), "kintree_table"), vec!["kintree_table", "missing"], "no joints"),
        (without(body(), "J"), vec!["J_regressor", "missing"], "no rest joints"),
        (set("v_template", 4, f32::NAN), vec!["v_template[1, 1]", "NaN", "finite"], "NaN vertex"),
        (set("v_template", 0, f32::INFINITY), vec!["v_template[0, 0]", "infinite"], "infinite vertex"),
        (set("J", 8, f32::NEG_INFINITY), vec!["J[2, 2]", "infinite"], "infinite joint"),
        (set("f", 5, 6.0), vec!["6", "below 6"], "vertex index out of range"),
        (set("f", 5, -1.0), vec!["f[1, 2]", "-1"], "negative vertex index"),
        (set("f", 5, 0.5), vec!["f[1, 2]", "0.5"], "half a vertex index"),
        (set("weights", 0, 0.25), vec!["weights[0]", "sum 0.5", "a sum of 1"], "weights to 0.5"),
        (set("weights", 4, f32::NAN), vec!["weights[1, 1]", "NaN"], "NaN weight"),
        (set("weights", 2, -0.5), vec!["weights[0]", "-0.5"], "negative weight"),
        (with(body(), "weights", |f| f.2[3..6].fill(0.0)), vec!["weights[1]", "sum 0"], "zero weights"),
        (set("kintree_table", 1, 2.0), vec!["kintree_table"], "a cycle of two"),
        (set("kintree_table", 1, 1.0), vec!["kintree_table[0, 1]"], "its own parent"),
        (set("kintree_table", 0, 2.0), vec!["kintree_table"], "a cycle of all"),
        (set("kintree_table", 2, 7.0), vec!["kintree_table[0, 2]", "7"], "a parent that is not there"),
        (set("kintree_table", 5, 9.0), vec!["kintree_table[1, 2]", "9"], "joint ids out of order"),
        (reshaped("v_template", vec![6, 2]), vec!["v_template", "[6, 2]", "(V,3)"], "flat vertices"),
        (reshaped("v_template", vec![7, 3]), vec!["[6, 3]", "V = 7"], "a vertex more than weights"),
        (
            reshaped("kintree_table", vec![2, 4]),
            vec!["kintree_table", "[2, 4]", "J = 3"],
            "a joint more than weights",
        ),
        (reshaped("f", vec![4, 4]), vec!["f", "[4, 4]", "(F,3)"], "quads"),
        (reshaped("weights", vec![6, 0]), vec!["weights"], "no joints at all"),
        (reshaped("kintree_table", vec![3]), vec!["kintree_table", "[3]", "(2,J)"], "parents alone"),
    ];
    for (fields, parts, what) in cases {
        write_npz(&desk.path("bad.npz"), &fields);
        let before = desk.contents();
        let mut all = vec!["bad.npz"];
        all.extend(parts);
        skin(&desk, "bad.npz", "poses.npz").refuses(&all, what);
        // Without vertices it is some other archive.
        if fields[0].0 == "v_template" {
            desk.run(args!["inspect", "bad.npz"]).refuses(&all, what);
        }
        assert!(desk.contents() == before, "{what}: files changed");
    }
}

/// Faces without an area have no frame of their own: every strategy still answers.
#[test]
fn zero_area_faces_are_posed() {
    let desk = desk();
    let flat = with(made_up::body(), "f", |f| f.2[..6].copy_from_slice(&[0., 0., 0., 1., 1., 3.]));
    write_npz(&desk.path("flat.npz"), &flat);
    let listing = desk.ok(args!["inspect", "flat.npz"]);
    assert!(listing.contains("zero-area faces      2"), "{listing}");
    for preset in skinsplat_posing::PRESETS {
        let mut arguments = args!["skin", "avatar.ply", "--out", "out.ply", "--body", "flat.npz"];
        arguments.extend(args!["--poses", "poses.npz", "--frame", "1", "--strategy", preset.id]);
        desk.ok(arguments);
        let posed = skinsplat_data::ply::read_avatar(&desk.path("out.ply")).unwrap();
        assert_eq!(posed.gaussians.len(), 6, "{}", preset.id);
        assert!(posed.gaussians.rotations.iter().flatten().all(|c| c.is_finite()), "{}", preset.id);
    }
}

#[test]
fn poses_that_are_wrong() {
    let desk = desk();
    let poses = made_up::poses;
    let reshaped = |name: &'static str, shape: Vec<u64>| {
        with(poses(), name, |f| {
            f.2.resize(shape.iter().product::<u64>() as usize, 0.0);
            f.1 = shape;
        })
    };
    let cases: Vec<(Vec<Field>, Vec<&str>, &str)> = vec![
        (Vec::new(), vec![], "nothing"),
        (without(poses(), "thetas"), vec![], "no rotations"),
        (with(poses(), "thetas", |f| f.2[10] = f32::NAN), vec!["thetas[1, 1]", "NaN"], "NaN"),
        (with(poses(), "transl", |f| f.2[5] = f32::INFINITY), vec!["transl[1, 2]", "infinite"], "infinite"),
        (reshaped("thetas", vec![2, 8]), vec!["thetas"], "not three to a joint"),
        (reshaped("thetas", vec![2, 12]), vec!["thetas"], "another number of joints"),
        (reshaped("thetas", vec![18]), vec!["thetas", "[18]"], "one dimension"),
        (reshaped("transl", vec![3, 3]), vec!["transl", "[3, 3]"], "another number of frames"),
    ];
    for (fields, parts, what) in cases {
        write_npz(&desk.path("bad.npz"), &fields);
        let before = desk.contents();
        let mut all = vec!["bad.npz"];
        all.extend(parts);
        skin(&desk, "body.npz", "bad.npz").refuses(&all, what);
        assert!(desk.contents() == before, "{what}: files changed");
    }
}

#[test]
fn files_cut_off_anywhere() {
    let desk = desk();
    for (source, name) in [
        (desk.path("body.npz"), "bad.npz"),
        (data("blender/models/ava_smpl24_4inf.glb"), "bad.glb"),
        (data("blender/datasets/snapshot_ava/test_twist/transforms.json"), "bad.json"),
    ] {
        let whole = std::fs::read(source).unwrap();
        for length in [0, 1, 11, whole.len() / 4, whole.len() / 2, whole.len() - 1] {
            let what = format!("{name}, {length} bytes");
            desk.put(name, &whole[..length]);
            let before = desk.contents();
            desk.run(args!["inspect", name]).refuses(&[name], &what);
            if name != "bad.json" {
                skin(&desk, name, "poses.npz").refuses(&[name], &what);
            }
            assert!(desk.contents() == before, "{what}: files changed");
        }
    }
}

#[test]
fn pointers_of_git_lfs_are_named() {
    let desk = desk();
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 3\n";
    for name in ["pointer.npz", "pointer.pkl", "pointer.glb", "pointer.gltf"] {
        desk.put(name, pointer);
        skin(&desk, name, "poses.npz").refuses(&[name, "Git LFS"], name);
        skin(&desk, "body.npz", name).refuses(&[name, "Git LFS"], name);
        desk.run(args!["inspect", name]).refuses(&[name, "Git LFS"], name);
    }
}

/// Files of 128 bytes whose headers announce terabytes.
#[test]
fn absurd_shapes_are_refused_before_they_are_allocated() {
    let desk = Desk::new();
    for shape in [[9_u64, 99_999_999], [u64::MAX, 2], [1 << 40, 3]] {
        let header =
            format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", shape[0], shape[1]);
        let padded = format!("{header:<117}\n");
        let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        npy.extend(padded.bytes());
        desk.put("bad.npy", &npy);
        desk.run(args!["inspect", "bad.npy"]).refuses(&["bad.npy"], &header);
    }
}
