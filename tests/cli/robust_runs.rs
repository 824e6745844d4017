//! Runs on data that is odd and in folders that are damaged.

use crate::args;
use crate::program::{Answer, Desk, copy};
use crate::support::data;
use std::ffi::OsString;
use std::path::PathBuf;

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    desk
}

fn run(desk: &Desk, more: &[&str]) -> Answer {
    let mut all = args!["run", "small.toml", "--data", "data", "--fit-iterations", "2"];
    all.extend(more.iter().map(OsString::from));
    desk.run(all)
}

/// The files of the run's folder of avatars with an extension.
fn avatars(desk: &Desk, extension: &str) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(desk.path("run/avatars")).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|e| e == extension)).collect();
    found.sort();
    found
}

#[test]
fn a_damaged_avatar_is_made_again_and_that_is_said() {
    let desk = desk();
    let out = ["--out", "run"];
    let first = run(&desk, &out).exits(0, "first");
    let files = [avatars(&desk, "ply"), avatars(&desk, "json")].concat();
    assert_eq!(files.len(), 4, "a surface, a start, a fit and its report: {files:?}");
    for file in &files {
        let bytes = std::fs::read(file).unwrap();
        for damage in [Vec::new(), bytes[..bytes.len() / 2].to_vec()] {
            std::fs::write(file, &damage).unwrap();
            let again = run(&desk, &[&out[..], &["--fresh"]].concat()).exits(0, "damaged");
            assert_eq!(again.out, first.out);
            let start = std::fs::read(file).unwrap() == damage;
            assert!(start || again.err.contains("made again"), "{}: {}", file.display(), again.err);
            if !start {
                assert!(std::fs::read(file).unwrap() == bytes, "{}: the same bits", file.display());
            }
        }
    }
    // A checkpoint that is damaged does not stop the fit, either.
    let fitted = avatars(&desk, "json")[0].clone();
    std::fs::write(fitted.with_extension("checkpoint"), "skinsplat checkpoint").unwrap();
    std::fs::remove_file(fitted.with_extension("sha256")).unwrap();
    let again = run(&desk, &[&out[..], &["--fresh"]].concat()).exits(0, "a damaged checkpoint");
    assert!(again.out == first.out && again.err.contains("fitted from the start"), "{}", again.err);
}

#[test]
fn a_folder_without_avatars_is_small_and_still_a_run() {
    let desk = desk();
    let all = run(&desk, &["--out", "run"]).exits(0, "everything is kept");
    let curves = desk.read("run/curves.csv");
    let none = run(&desk, &["--out", "run", "--keep", "none"]).exits(0, "no avatars");
    assert_eq!(none.out, all.out);
    let left = std::fs::read_dir(desk.path("run/avatars")).unwrap().map(|entry| entry.unwrap().path());
    let left: Vec<PathBuf> = left.collect();
    assert!(left.len() == 1 && left[0].extension().is_some_and(|e| e == "json"), "{left:?}");
    assert_eq!(run(&desk, &["--out", "run"]).exits(0, "nothing is left to do").out, all.out);
    assert_eq!(desk.read("run/curves.csv"), curves);
    // What needs them makes them again, bit for bit.
    run(&desk, &["--out", "run", "--fresh", "--images", "all"]).exits(0, "pictures");
    assert_eq!(avatars(&desk, "ply").len(), 3);
}

#[test]
fn a_slice_whose_frames_fail_is_incomplete() {
    let desk = desk();
    for image in ["image_0000.png", "image_0001.png", "image_0002.png"] {
        desk.put(&format!("data/tiny/test_b/images/{image}"), b"not an image");
    }
    let answer = run(&desk, &["--out", "run", "--shard", "1/1"]).exits(3, "every frame failed");
    assert!(answer.err.contains("6 scores of this slice are missing"), "{}", answer.err);
}

#[cfg(unix)]
#[test]
fn folders_may_have_any_name() {
    use std::os::unix::ffi::OsStringExt;
    let desk = desk();
    let mut all = args!["-q", "run", "small.toml", "--data", "data", "--fit-iterations", "1", "--out"];
    all.push(OsString::from_vec(b"o\xff".to_vec()));
    desk.run(all).exits(0, "a folder whose name is no UTF-8");
}

#[test]
fn data_that_is_there_under_two_names_runs_under_both() {
    let desk = desk();
    copy(&desk.path("data/tiny"), &desk.path("data/twin"));
    let stand_in = "[stand_in]\ncaption = \"Stand-ins\"\n\n[[columns]]\nmetric = \"psnr\"";
    let text = include_str!("small.toml").replace("dataset = \"tiny\"", "dataset = \"other\"");
    desk.put("small.toml", text.replacen("[[columns]]\nmetric = \"psnr\"", stand_in, 1));
    let page = run(&desk, &["--out", "run"]).exits(0, "twins").out;
    assert!(page.contains("tiny / test_b") && page.contains("twin / test_b"), "{page}");
}

#[test]
fn a_test_sequence_without_frames_is_refused_before_the_fit_begins() {
    let desk = desk();
    let path = "data/tiny/test_b/transforms.json";
    let mut listing: serde_json::Value = serde_json::from_str(&desk.read(path)).unwrap();
    listing["frames"] = serde_json::json!([]);
    desk.put(path, listing.to_string());
    let fit = args![
        "-q",
        "fit",
        "tiny",
        "--data",
        "data",
        "--iterations",
        "100000",
        "--profile",
        "quick",
        "--out",
        "a.ply"
    ];
    let before = desk.contents();
    desk.run(fit).refuses(&["test_b", "frames"], "no test frames");
    assert!(desk.contents() == before);
}

#[test]
fn a_body_out_of_view_does_not_stop_later_runs() {
    let desk = desk();
    let path = "data/tiny/test_b/transforms.json";
    let mut listing: serde_json::Value = serde_json::from_str(&desk.read(path)).unwrap();
    listing["cameras"][0]["w2c"][0][3] = serde_json::json!(50.0);
    desk.put(path, listing.to_string());
    for frame in 0..3 {
        let mask = desk.path(&format!("data/tiny/test_b/masks/mask_{frame:04}.png"));
        let empty = skinsplat_core::scene::Mask::filled(32, 32, 0.0);
        skinsplat_data::frames::save_mask_png(&mask, &empty).unwrap();
    }
    let first = run(&desk, &["--out", "run"]).exits(0, "out of view");
    assert!(first.out.contains('∞'), "{}", first.out);
    assert_eq!(run(&desk, &["--out", "run"]).exits(0, "again").out, first.out);
    assert!(desk.read("run/curves.csv").contains("inf"), "{}", desk.read("run/curves.csv"));
}

#[test]
fn a_log_has_a_line_per_avatar_and_sequence() {
    let desk = desk();
    let answer = run(&desk, &["--out", "run"]).exits(0, "a run");
    for line in [
        "small: avatar 1/2: tiny/tiny surface-vertex, for surface\n",
        "small: avatar 2/2: tiny/tiny fit hugs-skinned 0, for theirs\n",
    ] {
        assert!(answer.err.contains(line), "no `{line}` in {}", answer.err);
    }
    assert!(answer.err.contains("sequence tiny/tiny/test_b: 3 frames; 3 of 3 in all\n"), "{}", answer.err);
    assert_eq!(desk.run(args!["-q", "run", "small.toml", "--data", "data", "--out", "run"]).err, "");
}

#[test]
fn the_built_in_registry_looks_in_the_current_folder() {
    let desk = desk();
    let listed = |desk: &Desk| {
        let mut command = desk.command(args!["list", "datasets"]);
        command.env_remove("REPRODUCE_DATASETS");
        String::from_utf8(command.output().unwrap().stdout).unwrap()
    };
    let text = listed(&desk);
    let line = |text: &str, id: &str| text.lines().find(|line| line.starts_with(id)).unwrap().to_owned();
    let place = desk.path("tests/data/blender/datasets/snapshot_ava");
    let expected = format!("not there: looked in {}", place.display());
    assert!(line(&text, "snapshot_ava ").ends_with(&expected), "{text}");
    assert!(line(&text, "synthetic ").ends_with("available"), "{text}");
    copy(&data("small/tiny"), &place);
    assert!(line(&listed(&desk), "snapshot_ava ").ends_with("  available"), "{text}");
}

/// What is no file of records is none, whatever its name: a pipe would be waited for.
#[cfg(unix)]
#[test]
fn pipes_named_like_stores_are_left_alone() {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    std::fs::create_dir(desk.path("run")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(desk.path("run/frames-9.jsonl")).status().unwrap();
    assert!(made.success());
    let run =
        || args!["-q", "run", "small.toml", "--data", data("small"), "--variant", "surface", "--out", "run"];
    desk.run(run()).exits(0, "a pipe beside the store");
    desk.run(args!["inspect", "run/frames-9.jsonl"]).refuses(&["frames-9.jsonl", "regular file"], "a pipe");
    // What a killed run left is swept, once nobody can be writing to it.
    let left = desk.put("run/avatars/.writing-x", "half");
    desk.run(run()).exits(0, "another's unfinished file");
    assert!(left.exists());
    let day = std::time::Duration::from_secs(86_400);
    let file = std::fs::File::options().write(true).open(&left).unwrap();
    file.set_modified(std::time::SystemTime::now() - day).unwrap();
    desk.run(run()).exits(0, "an abandoned file");
    assert!(!left.exists());
}
