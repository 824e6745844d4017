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

/// A subject on a desk of its own, to be damaged.
struct Victim {
    desk: Desk,
    layout: &'static str,
}

impl Victim {
    fn new(layout: &'static str, subject: &str) -> Self {
        let desk = Desk::new();
        program::copy(&layouts().join(layout).join(subject), &desk.path(&format!("data/{subject}")));
        let (capture, model) = match layout {
            "galabasketball" => ("multiview", None),
            "xhumans" => ("hands", Some("blender/models/anny_smplx55.npz")),
            _ => ("monocular", Some("blender/models/anny_smpl24.npz")),
        };
        let model = model.map_or(String::new(), |model| format!("model = {:?}\n", data(model)));
        let split = format!("[dataset.splits]\n{subject} = {{ train = [0, 5, 1], test = [6, 7, 1] }}\n");
        let split = if model.contains("smpl24") { split } else { String::new() };
        desk.put("sets.toml", registry(layout, capture, "data".into(), subject, &(model + &split)));
        Self { desk, layout }
    }

    /// What `check` finds that spoils numbers, by kind.
    fn found(&self) -> Vec<String> {
        self.seen(true)
    }

    /// What `check` finds that does or doesn't spoil numbers, by kind.
    fn seen(&self, spoils: bool) -> Vec<String> {
        let answer =
            self.desk.run(args!["-q", "check", self.layout, "--datasets", "sets.toml", "--format", "json"]);
        let seen: Value = serde_json::from_str(&answer.out).unwrap_or_else(|_| panic!("{answer:?}"));
        let findings = seen["findings"].as_array().unwrap();
        let findings = findings.iter().filter(|finding| finding["spoils"] == spoils);
        let mut kinds: Vec<String> = findings.map(|f| f["kind"].as_str().unwrap().to_owned()).collect();
        kinds.sort();
        kinds.dedup();
        kinds
    }

    /// The files of a folder of the subject, in order.
    fn files(&self, folder: &str) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.desk.path("data").join(folder)).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    /// Every file of a folder gets what the next one holds.
    fn shift(&self, folder: &str) {
        for pair in self.files(folder).windows(2) {
            std::fs::copy(&pair[1], &pair[0]).unwrap();
        }
    }

    /// Changes a number of a text: the one at this place among those of the line that begins so.
    fn scale(&self, file: &str, line: &str, place: usize, separator: &str, factor: f64) {
        let path = self.desk.path("data").join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let scaled = |old: &str| {
            let number = |(i, word): (usize, &str)| match i == place {
                true => (factor * word.parse::<f64>().unwrap()).to_string(),
                false => word.to_owned(),
            };
            old.split(separator).enumerate().map(number).collect::<Vec<_>>().join(separator)
        };
        let mut done = false;
        let lines = text.lines().map(|old| match !done && old.starts_with(line) {
            true => {
                done = true;
                scaled(old)
            }
            false => old.to_owned(),
        });
        let lines = lines.collect::<Vec<_>>().join("\n") + "\n";
        assert_ne!(lines, text, "{file}");
        std::fs::write(&path, lines).unwrap();
    }
}

/// Masks the other way round: of `.npy` files of 0 and 1, or of images.
fn invert(file: &Path) {
    if file.extension().is_some_and(|extension| extension == "npy") {
        let mut bytes = std::fs::read(file).unwrap();
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        bytes[start..].iter_mut().for_each(|value| *value = 1 - *value);
        std::fs::write(file, bytes).unwrap();
    } else {
        let mut image = image::open(file).unwrap();
        image.invert();
        image.save(file).unwrap();
    }
}

/// Layouts, a subject of each, its folders of images and of what tells its masks.
const VICTIMS: [(&str, &str, &str, &str); 6] = [
    ("neuman", "ava", "ava/images", "ava/4d_humans/sam_segmentations"),
    ("neuman", "own", "own/images", "own/segmentations"),
    ("peoplesnapshot", "ava", "ava/images", "ava/masks"),
    ("peoplesnapshot-raw", "ava", "ava/frames", ""),
    ("xhumans", "00099", "00099/train/Take4/render/image", "00099/train/Take4/render/depth"),
    ("galabasketball", "ben", "ben/2", "ben/2"),
];

#[test]
fn nothing_is_found_in_any_layout_that_is_whole() {
    for (layout, subject, ..) in VICTIMS {
        let whole = Victim::new(layout, subject);
        assert_eq!(whole.found(), [""; 0], "{layout}/{subject}");
        // These were taken through a lens, and say so.
        let lens = layout == "peoplesnapshot-raw" || subject == "own";
        let said: &[&str] = if lens { &["camera"] } else { &[] };
        assert_eq!(whole.seen(false), said, "{layout}/{subject}");
    }
}

#[test]
fn damage_is_found_by_its_kind_in_every_layout() {
    for (layout, subject, images, masks) in VICTIMS {
        let at = format!("{layout}/{subject}");
        let missing = Victim::new(layout, subject);
        std::fs::remove_file(&missing.files(images)[1]).unwrap();
        assert_eq!(missing.found(), ["missing-frames"], "{at}");
        // The masks of the raw recordings are in one file with all others.
        if !masks.is_empty() {
            let shifted = Victim::new(layout, subject);
            shifted.shift(masks);
            assert_eq!(shifted.found(), ["frame-offset"], "{at}");
        }
        if ["neuman", "peoplesnapshot"].contains(&layout) {
            let inverted = Victim::new(layout, subject);
            inverted.files(masks).iter().for_each(|file| invert(file));
            assert_eq!(inverted.found(), ["inverted-masks"], "{at}");
        }
        let other = Victim::new(layout, subject);
        match layout {
            "neuman" => other.scale(&format!("{subject}/sparse/cameras.txt"), "3 ", 4, " ", 1.4),
            "galabasketball" => other.scale("ben/camera/2.txt", "", 0, ",", 1.3),
            _ => continue,
        }
        assert_eq!(other.found(), ["camera"], "{at}");
    }
}
