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
    has(
        &desk.ok(args!["inspect", raw.join("masks.hdf5")]),
        &["HDF5", "masks", "0.0000 to 1.0000", "layout peoplesnapshot-raw: masks"],
    );
    let ball = data("small/layouts/galabasketball/ball/model");
    has(
        &desk.ok(args!["inspect", ball.join("weights.npy")]),
        &["array", "shape", "layout galabasketball: weights"],
    );
    has(&desk.ok(args!["inspect", ball.join("mesh.txt")]), &["text", "lines", "layout galabasketball: mesh"]);
    desk.put("strange.txt", "x");
    has(&desk.ok(args!["inspect", "strange.txt"]), &["text", "inspect FOLDER"]);
}

/// Pickles and archives that only mean something in their data set: what they hold, who reads it, what is left.
#[test]
fn files_of_arrays_say_who_reads_them() {
    let desk = Desk::new();
    let inspect = |path: &str| desk.ok(args!["inspect", data("small/layouts").join(path)]);
    has(
        &inspect("peoplesnapshot-raw/someone/camera.pkl"),
        &["pickled dictionary", "camera_f", "[2]", " to ", "layout peoplesnapshot-raw: camera"],
    );
    has(
        &inspect("peoplesnapshot-raw/someone/consensus.pkl"),
        &["v_personal", ", 3]", "layout peoplesnapshot-raw: clothed shape"],
    );
    has(
        &inspect("peoplesnapshot-raw/someone/reconstructed_poses.hdf5"),
        &["HDF5", "pose ", "betas ", "layout peoplesnapshot-raw: poses"],
    );
    has(&inspect("neuman/own/alignments.npy"), &["00003.png", "[4, 3]", "layout neuman: alignments"]);
    has(
        &inspect("neuman/own/smpl_output_optimized.pkl"),
        &[".pose", ".betas", "72]", "layout neuman: poses"],
    );
    has(
        &inspect("xhumans/00099/train/Take4/render/cameras.npz"),
        &["npz archive", "extrinsic", "[5, 4, 4]", "layout xhumans: training cameras"],
    );
    has(
        &inspect("xhumans/00099/train/Take4/SMPLX/mesh-f00014_smplx.pkl"),
        &["body_pose", "layout xhumans: training poses", "not read", "betas"],
    );
    let numbers = [("camera_f", &[2][..], Values::F64(vec![1.0, f64::NAN]))];
    npz(&desk.path("odd.npz"), &numbers);
    has(&desk.ok(args!["inspect", "odd.npz"]), &["1.0000 to 1.0000, 1 NaN or infinite"]);
}

#[test]
fn a_folder_of_data_sets_says_what_each_folder_is() {
    let desk = Desk::new();
    let text = desk.ok(args!["inspect", data("small/layouts")]);
    has(&text, &["folder of data sets", "layout xhumans: 00099", "layout neuman: ava own"]);
    has(&text, &["models               no layout that is known", "layout galabasketball: ball"]);
    copy(&data("small/layouts/neuman/ava"), &desk.path("people/seattle"));
    desk.put("people/notes/readme.txt", "x");
    let text = desk.ok(args!["inspect", "people"]);
    has(&text, &["folder of subjects", "seattle              subject, layout neuman"]);
    has(&text, &["notes                no layout that is known"]);
}

/// What is found twice, once in each of several frames, is said once.
#[test]
fn a_note_is_said_once() {
    let desk = Desk::new();
    copy(&data("small/layouts/peoplesnapshot/ava"), &desk.path("data/ava"));
    let bytes = std::fs::read(data("blender/models/anny_smpl24.npz")).unwrap();
    desk.put("data/models/SMPL_NEUTRAL.npz", bytes);
    for i in 0..8 {
        // A map of two labels.
        let labels: Vec<u8> = (0..64 * 64).map(|k| u8::from(k % 64 > 20) + u8::from(k % 64 > 40)).collect();
        desk.put(&format!("data/ava/masks/mask_{i:04}.npy"), crate::files::npy(&[64, 64], &labels));
    }
    let text = desk.ok(args!["inspect", "data/ava"]);
    assert_eq!(text.matches("check finds mask-range in train").count(), 1, "{text}");
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
