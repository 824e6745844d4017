//! What `inspect` says of folders that other people made, whole and half unpacked.

use crate::args;
use crate::files::{Values, npz};
use crate::program::{Desk, copy};
use crate::support::data;

/// What is said of a folder of the layouts' test data, with a model beside it.
fn said(desk: &Desk, layout: &str, subject: &str, model: Option<(&str, &str)>) -> String {
    let place = format!("data/{subject}");
    copy(&data("small/layouts").join(layout).join(subject), &desk.path(&place));
    if let Some((from, to)) = model {
        let bytes = std::fs::read(data("blender/models").join(from)).unwrap();
        desk.put(&format!("data/models/{to}"), bytes);
    }
    desk.ok(args!["inspect", desk.path(&place)])
}

#[track_caller]
fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
}

#[test]
fn every_layout_is_recognised() {
    let smpl = Some(("anny_smpl24.npz", "SMPL_NEUTRAL.npz"));
    let desk = Desk::new();
    let text = said(&desk, "neuman", "ava", smpl);
    has(&text, &["layout neuman", "sparse/images.txt", "sam_segmentations", "smpl_optimized"]);
    has(&text, &["8 files: images/", "not read", "at least 10, or splits"]);
    let text = said(&Desk::new(), "peoplesnapshot", "ava", smpl);
    has(
        &text,
        &[
            "layout peoplesnapshot:",
            "masks/*.{npy,png}",
            "anim_nerf_test.npz",
            "24 joints",
            "6 frames, ",
            "6 masks, images of 64x64",
        ],
    );
    let text = said(&Desk::new(), "peoplesnapshot-raw", "someone", None);
    has(&text, &["layout peoplesnapshot-raw", "masks.hdf5", "camera.pkl", "consensus.pkl", "not read"]);
    let text = said(&Desk::new(), "xhumans", "00099", None);
    has(&text, &["layout xhumans", "gender.txt", "train/*/render/depth/depth_*.tiff", "not read", "SMPLX_"]);
    let text = said(&Desk::new(), "galabasketball", "ball", None);
    has(&text, &["layout galabasketball", "camera/*.txt", "images of camera 6", "7 cameras"]);
    has(&desk.ok(args!["inspect", desk.path("data")]), &["folder of subjects", "layout neuman"]);
}

#[test]
fn a_run_is_told_from_a_folder_of_images() {
    let desk = Desk::new();
    desk.ok(args!["run", "ci", "--limit", "1", "--variant", "face", "--out", "run"]);
    let text = desk.ok(args!["inspect", "run"]);
    has(&text, &["run of reproduce", "protocol avatar-v1", "frames.jsonl", "missing scores", "avatars made"]);
    std::fs::remove_file(desk.path("run/results.json")).unwrap();
    has(&desk.ok(args!["inspect", "run"]), &["not there yet", "results store"]);
}

#[test]
fn what_is_missing_is_named_with_its_alternatives() {
    let desk = Desk::new();
    copy(&data("small/layouts/neuman/ava"), &desk.path("ava"));
    std::fs::remove_dir_all(desk.path("ava/4d_humans")).unwrap();
    std::fs::remove_file(desk.path("ava/sparse/images.txt")).unwrap();
    let text = desk.ok(args!["inspect", desk.path("ava")]);
    has(&text, &["layout neuman", "registered images (sparse/images.txt)"]);
    has(
        &text,
        &["poses (4d_humans/smpl_optimized_aligned_scale.npz or smpl_output_optimized.pkl)", "not read"],
    );
}

#[test]
fn renders_are_told_from_subjects() {
    let desk = Desk::new();
    for k in 0..2 {
        let bytes = std::fs::read(data(&format!("small/tiny/test_b/images/image_000{k}.png"))).unwrap();
        desk.put(&format!("theirs/color/image_000{k}.png"), bytes);
    }
    desk.put("theirs/renders.json", r#"{ "splats": 12 }"#);
    let text = desk.ok(args!["inspect", desk.path("theirs")]);
    has(&text, &["renders of another program", "2, image_0000 to image_0001", "splats", "12"]);
    std::fs::create_dir(desk.path("empty")).unwrap();
    desk.run(args!["inspect", desk.path("empty")]).refuses(&["empty", "neuman", "images"], "nothing there");
}

#[test]
fn arrays_that_nothing_reads_are_named() {
    let desk = Desk::new();
    let strange = [("weather", &[2][..], Values::F64(vec![1.0, 2.0]))];
    npz(&desk.path("strange.npz"), &strange);
    has(&desk.ok(args!["inspect", "strange.npz"]), &["not read", "weather"]);
    let mut body = crate::files::small_body();
    body.push(("vertex_colours", &[1], Values::F64(vec![0.0])));
    npz(&desk.path("body.npz"), &body);
    has(&desk.ok(args!["inspect", "body.npz"]), &["body model", "not read             vertex_colours"]);
}

#[test]
fn parts_of_data_sets_are_listed() {
    let desk = Desk::new();
    let raw = data("small/layouts/peoplesnapshot-raw/ava");
    has(&desk.ok(args!["inspect", raw.join("masks.hdf5")]), &["HDF5", "masks", "inspect FOLDER"]);
    let ball = data("small/layouts/galabasketball/ball/model");
    has(&desk.ok(args!["inspect", ball.join("weights.npy")]), &["array", "shape", "inspect FOLDER"]);
    has(&desk.ok(args!["inspect", ball.join("mesh.txt")]), &["text", "lines", "inspect FOLDER"]);
}

/// A subject of which too little is there: `check` looks at the others, `plan` and a table that falls back say what is wrong with it, and
/// asking for it alone is that error.
#[test]
fn a_subject_that_cannot_be_loaded_is_named_everywhere() {
    let desk = Desk::new();
    copy(&data("small/layouts/neuman/ava"), &desk.path("data/neuman/seattle"));
    desk.put("sets.toml", include_str!("../../datasets.toml"));
    let reason = "8 registered";
    let asked = |words: &[&str]| {
        words.iter().chain(&["--datasets", "sets.toml"]).map(std::ffi::OsString::from).collect::<Vec<_>>()
    };
    let looked = desk.run(asked(&["check", "neuman", "--format", "json"])).exits(1, "check");
    has(&looked.out, &[reason, "missing-frames"]);
    has(&desk.ok(asked(&["plan", "table1"])), &["cannot be loaded: neuman/seattle", reason]);
    let alone = desk.run(asked(&["plan", "table1", "--subject", "seattle"]));
    alone.refuses(&["seattle", reason], "the subject alone");
    has(&desk.ok(asked(&["list", "datasets"])), &["no folder", "citron", reason]);
}

#[test]
fn help_is_there_for_the_raw_layout_too() {
    let text = Desk::new().ok(args!["fetch-help", "peoplesnapshot-raw"]);
    has(&text, &["masks.hdf5", "layout = \"peoplesnapshot-raw\"", "graphics.tu-bs.de"]);
}
