//! From a folder in somebody else's layout to a row of a table, through the program.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
mod support;

use program::Desk;
use serde_json::Value;
use std::path::{Path, PathBuf};
use support::data;

/// A registry with one data set.
fn registry(layout: &str, capture: &str, path: PathBuf, subject: &str, more: &str) -> String {
    format!(
        "[[dataset]]\nid = \"{layout}\"\ntitle = \"T\"\nlayout = \"{layout}\"\ncapture = \"{capture}\"\nlicence = \"CC0-1.0\"\n\
         provenance = \"here\"\npath = {path:?}\nsubjects = [\"{subject}\"]\n{more}"
    )
}

/// What the tables' avatars are: gathered from the training frames, so that these count too. A texture costs less than
/// Gaussians, and blurs less: it tells more of the data.
const TEXTURED: &str = "{ recipe = \"textured-mesh\", size = 64 }";
const GAUSSIANS: &str = "{ recipe = \"surface-vertex\" }\nstrategy = \"quaternion-average\"\nsh_degree = 1";

/// A table of an avatar on a data set. The protocol's background is what the data set captured, or white.
fn table(dataset: &str, protocol: &str, avatar: &str) -> String {
    format!(
        "schema = 1\nid = \"small\"\nversion = 1\ntitle = \"Small\"\ncaption = \"An avatar\"\ndataset = \"{dataset}\"\n\
         dataset_title = \"Theirs\"\nmethod = \"M\"\nprotocol = \"{protocol}\"\nlayout = \"rows\"\nbaseline = \"own\"\n\
         columns = [{{ metric = \"psnr\" }}]\n[[variants]]\nid = \"own\"\nlabel = \"Own\"\navatar = {avatar}\n"
    )
}

/// Scores by variant of the only row of a run.
fn scores(layout: &str, registry: &str, protocol: &str, avatar: &str) -> Vec<f64> {
    let desk = Desk::new();
    desk.put("sets.toml", registry);
    desk.put("small.toml", table(layout, protocol, avatar));
    let run = args!["-q", "run", "small.toml", "--datasets", "sets.toml", "--out", "out"];
    desk.run(run).exits(0, layout);
    let results: Value = serde_json::from_str(&desk.read("out/results.json")).unwrap();
    let sequences = results["tables"][0]["sequences"].as_array().unwrap();
    assert_eq!(sequences.len(), 1, "{layout}");
    let variants = sequences[0]["variants"].as_array().unwrap();
    variants.iter().map(|variant| variant["summary"]["values"]["psnr"].as_f64().unwrap_or(f64::NAN)).collect()
}

fn layouts() -> PathBuf {
    data("small/layouts")
}

fn of_ava(layout: &str, folder: &str) -> Vec<f64> {
    let model = data("blender/models/anny_smpl24.npz");
    let (parent, subject) = folder.rsplit_once('/').unwrap();
    let more = format!(
        "model = {model:?}\n[dataset.splits]\n{subject} = {{ train = [0, 5, 1], test = [6, 7, 1] }}\n"
    );
    scores(
        layout,
        &registry(layout, "monocular", layouts().join(parent), subject, &more),
        "default",
        TEXTURED,
    )
}

#[test]
fn one_person_gets_one_score_through_every_layout() {
    let own = of_ava("folder", "folder/ava");
    assert!(own.iter().all(|psnr| *psnr > 5.0 && psnr.is_finite()), "{own:?}");
    for (layout, folder) in [
        ("peoplesnapshot", "peoplesnapshot/ava"),
        ("peoplesnapshot-raw", "peoplesnapshot-raw/ava"),
        ("neuman", "neuman/ava"),
        ("neuman", "neuman/own"),
    ] {
        let other = of_ava(layout, folder);
        for (a, b) in own.iter().zip(&other) {
            assert!((a - b).abs() < 0.02, "{folder}: {other:?} instead of {own:?}");
        }
    }
}

#[test]
fn takes_of_x_humans_are_rows() {
    let model = data("blender/models/anny_smplx55.npz");
    let model = format!("model = {model:?}\n");
    let own = registry("folder", "hands", layouts().join("folder"), "hands", &model);
    let other = registry("xhumans", "hands", layouts().join("xhumans"), "00099", &model);
    let [own, other] = [("folder", own), ("xhumans", other)]
        .map(|(layout, sets)| scores(layout, &sets, "default", TEXTURED));
    for (a, b) in own.iter().zip(&other) {
        assert!((a - b).abs() < 0.02, "{other:?} instead of {own:?}");
    }
}

/// Makes a world of GalaBasketball a fifth as large, which no camera sees: its avatars need fewer Gaussians. Lengths are the
/// first of every 5 lines of the mesh, the first of every 3 of poses, the second line of cameras, and the last columns of
/// matrices.
fn shrink(folder: &Path) {
    let scaled = |file: &Path, lines: [usize; 2], columns: &[usize]| {
        let text = std::fs::read_to_string(file).unwrap();
        let line = |(i, line): (usize, &str)| {
            if i % lines[0] != lines[1] {
                return line.to_owned();
            }
            let number = |(k, word): (usize, &str)| match columns.contains(&k) {
                true => (0.2 * word.trim().parse::<f64>().unwrap()).to_string(),
                false => word.to_owned(),
            };
            let separator = if line.contains(',') { "," } else { " " };
            let words: Vec<String> = line.split(separator).enumerate().map(number).collect();
            words.join(separator)
        };
        std::fs::write(file, text.lines().enumerate().map(line).collect::<Vec<_>>().join("\n")).unwrap();
    };
    scaled(&folder.join("model/mesh.txt"), [5, 0], &[0, 1, 2]);
    scaled(&folder.join("model/tpose.txt"), [3, 0], &[0, 1, 2]);
    scaled(&folder.join("model/tpose_mat.txt"), [1, 0], &[3, 7, 11]);
    for (place, lines) in [("pose", [3, 0]), ("camera", [usize::MAX, 1])] {
        for entry in std::fs::read_dir(folder.join(place)).unwrap() {
            scaled(&entry.unwrap().path(), lines, &[0, 1, 2]);
        }
    }
}

#[test]
fn a_player_is_scored_before_the_captured_background() {
    let desk = Desk::new();
    program::copy(&layouts().join("galabasketball/ball"), &desk.path("ball"));
    shrink(&desk.path("ball"));
    let sets = registry("galabasketball", "multiview", desk.path(""), "ball", "");
    let psnr = scores("galabasketball", &sets, "animatable-gala", GAUSSIANS);
    assert!(psnr.iter().all(|psnr| *psnr > 5.0), "{psnr:?}");
}

#[test]
fn a_damaged_subject_is_one_line() {
    let desk = Desk::new();
    program::copy(&layouts().join("neuman/ava"), &desk.path("data/ava"));
    std::fs::remove_file(desk.path("data/ava/sparse/images.txt")).unwrap();
    desk.put("sets.toml", registry("neuman", "monocular", "data".into(), "ava", ""));
    desk.put("small.toml", table("neuman", "default", TEXTURED));
    let run = args!["-q", "run", "small.toml", "--datasets", "sets.toml", "--out", "out"];
    desk.run(run).refuses(&["sparse/images.txt", "images", "COLMAP"], "no images.txt");
}
