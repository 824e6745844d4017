//! Frames that another program rendered, as a row of a table.

use crate::args;
use crate::program::{Answer, Desk, copy};
use crate::support::data;
use serde_json::Value;
use std::ffi::OsString;

/// A desk with the small experiment and a folder of renders of its subject: the true images.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    for k in 0..3 {
        let name = format!("image_000{k}.png");
        let bytes = std::fs::read(data(&format!("small/tiny/test_b/images/{name}"))).unwrap();
        desk.put(&format!("theirs/tiny/{name}"), bytes);
    }
    desk
}

fn run(desk: &Desk, out: &str, more: &[&str]) -> Answer {
    let mut all =
        args!["-q", "run", "small.toml", "--data", data("small"), "--fit-iterations", "2", "--out", out];
    all.extend(more.iter().map(OsString::from));
    desk.run(all)
}

fn variant(desk: &Desk, out: &str, id: &str) -> Value {
    let results: Value = serde_json::from_str(&desk.read(&format!("{out}/results.json"))).unwrap();
    let variants = results["tables"][0]["sequences"][0]["variants"].as_array().unwrap().clone();
    variants.into_iter().find(|variant| variant["id"] == id).unwrap()
}

#[test]
fn renders_are_scored_under_the_protocol_of_the_table() {
    let desk = desk();
    desk.put("theirs/tiny/renders.json", r#"{ "splats": 1234, "bytes": 99, "milliseconds": 4.5 }"#);
    desk.put("theirs/tiny/._image_0000.png", "no image");
    run(&desk, "run", &["--renders", "surface=theirs/{subject}"]).exits(0, "the truth as renders");
    let theirs = variant(&desk, "run", "surface");
    assert_eq!(theirs["summary"]["identical_frames"], 3, "{theirs}");
    assert_eq!(theirs["summary"]["values"]["splats"], 1234.0, "{theirs}");
    let page = desk.read("run/tables.md");
    assert!(page.contains("rendered by another program") && page.contains("4.5 ms per frame"), "{page}");
    // The same as a recipe of the experiment's own file.
    let recipe = "{ recipe = \"renders\", path = \"theirs/{subject}\" }";
    let text = include_str!("small.toml").replace("\"small\"", "\"own\"");
    let surface = text.lines().position(|line| line.contains("surface-vertex")).unwrap();
    let lines = text.lines().enumerate().filter(|(i, line)| {
        !(*i > surface && *i < surface + 3 && (line.starts_with("strategy") || line.starts_with("sh_degree")))
    });
    let lines: Vec<String> = lines
        .map(|(i, line)| if i == surface { format!("avatar = {recipe}") } else { line.to_owned() })
        .collect();
    desk.put("folder/own.toml", lines.join("\n"));
    let own_run = || {
        let small = data("small");
        desk.run(args![
            "-q",
            "run",
            "folder/own.toml",
            "--data",
            small,
            "--variant",
            "surface",
            "--out",
            "own"
        ])
    };
    own_run().exits(2, "no renders below the experiment's folder");
    std::fs::rename(desk.path("theirs"), desk.path("folder/theirs")).unwrap();
    own_run().exits(0, "renders below the experiment's folder");
    assert_eq!(variant(&desk, "own", "surface")["summary"]["identical_frames"], 3);
}

#[test]
fn gaps_and_wrong_sizes_are_named() {
    let desk = desk();
    std::fs::remove_file(desk.path("theirs/tiny/image_0001.png")).unwrap();
    let answer = run(&desk, "run", &["--renders", "surface=theirs/tiny"]);
    answer.exits(3, "a frame is missing");
    assert!(desk.read("run/frames.jsonl").contains("theirs/tiny: frame image_0001: no image"));
    assert!(desk.read("run/tables.md").contains("image_0001"), "{}", desk.read("run/tables.md"));
    let small = skinsplat_core::scene::Image::filled(5, 4, [0.5; 3]);
    skinsplat_data::frames::save_png(&desk.path("theirs/tiny/image_0001.png"), &small).unwrap();
    run(&desk, "run", &["--renders", "surface=theirs/tiny"]).exits(3, "a frame of another size");
    assert!(desk.read("run/frames.jsonl").contains("5x4; expected"));
    let answer = run(&desk, "none", &["--renders", "surface=nowhere/{subject}"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("nowhere/tiny: no render of test_b; expected"), "{answer:?}");
    run(&desk, "none", &["--renders", "other=theirs/tiny"]).exits(2, "no such variant");
}

/// Images that are of no frame take no part, and that is said.
#[test]
fn images_of_no_frame_are_named() {
    let desk = desk();
    let run = |desk: &Desk| {
        desk.run(args![
            "run",
            "small.toml",
            "--data",
            data("small"),
            "--fit-iterations",
            "2",
            "--out",
            "run",
            "--renders",
            "surface=theirs/tiny",
            "--variant",
            "surface"
        ])
    };
    let answer = run(&desk).exits(0, "every image is of a frame");
    assert!(!answer.err.contains("no frame"), "{answer:?}");
    for name in ["image_9998.png", "image_9999.png"] {
        std::fs::copy(desk.path("theirs/tiny/image_0001.png"), desk.path(&format!("theirs/tiny/{name}")))
            .unwrap();
    }
    let answer = run(&desk).exits(0, "two are of none");
    let said = "2 more images are of no frame, such as image_9998";
    assert!(answer.err.contains(&format!("theirs/tiny: {said} of test_b")), "{answer:?}");
    assert!(desk.read("run/tables.md").contains(said), "{}", desk.read("run/tables.md"));
}

/// What has no score has no picture, and a page says so.
#[test]
fn a_gap_leaves_the_page_and_its_pictures() {
    let desk = desk();
    std::fs::remove_file(desk.path("theirs/tiny/image_0001.png")).unwrap();
    let renders = "surface=theirs/tiny";
    run(&desk, "run", &["--renders", renders, "--html", "p.html", "--images", "all"])
        .exits(3, "one is missing");
    assert!(desk.read("p.html").contains("Incomplete: 1 score missing"));
    let index: Value = serde_json::from_str(&desk.read("run/pictures/index.json")).unwrap();
    let frames = index["frames"].as_array().unwrap();
    let has = |frame: &str| {
        let of = frames.iter().find(|own| own["frame"] == frame).unwrap();
        of["variants"].as_array().unwrap().iter().any(|variant| variant[0] == "surface")
    };
    assert_eq!(["image_0000", "image_0001", "image_0002"].map(has), [true, false, true]);
    // A moving picture has all of its columns in every frame.
    assert_eq!(index["moving"][0]["frames"][0], 2, "{index}");
    assert!(desk.path("run/images/README.md").is_file());
    // Pictures are the run's own, and of one size.
    let page = || desk.run(args!["report", "run", "--format", "html", "--out", "q.html"]);
    let kept = desk.read("run/pictures/index.json");
    let pixel = skinsplat_core::scene::Image::filled(1, 1, [0.5; 3]);
    skinsplat_data::frames::save_png(&desk.path("run/pictures/small.png"), &pixel).unwrap();
    let truth = index["frames"][0]["truth"].as_str().unwrap();
    for foreign in ["../../theirs/tiny/image_0000.png", "/etc/hostname"] {
        desk.put("run/pictures/index.json", kept.replacen(truth, foreign, 1));
        page().refuses(&["index.json", foreign, "in the folder"], foreign);
    }
    desk.put("run/pictures/index.json", kept.replacen(truth, "small.png", 1));
    let said = page().exits(3, "another size");
    assert!(said.err.contains("pixels; expected 1x1, as of the truth"), "{}", said.err);
}

/// A subject that cannot be read costs its own row, with the reason, and no other.
#[test]
fn half_a_data_set_gives_half_a_table() {
    let desk = desk();
    let registry = |subjects: &str| {
        let head =
            "[[dataset]]\nid = \"pair\"\ntitle = \"Pair\"\nlayout = \"folder\"\ncapture = \"monocular\"\n";
        format!(
            "{head}licence = \"CC0-1.0\"\nprovenance = \"here\"\npath = \"people\"\nsubjects = {subjects}\n"
        )
    };
    copy(&data("small/tiny"), &desk.path("people/tiny"));
    copy(&data("small/tiny"), &desk.path("people/torn"));
    desk.put("people/torn/test_b/transforms.json", "{");
    let text = include_str!("small.toml").replace("\"small\"", "\"pair\"");
    let text: Vec<String> = text
        .lines()
        .filter(|line| !line.starts_with("sequences"))
        .map(|line| if line.starts_with("dataset =") { "dataset = \"pair\"".into() } else { line.to_owned() })
        .collect();
    desk.put("pair.toml", text.join("\n"));
    let run = |subjects: &str, out: &str| {
        desk.put("datasets.toml", registry(subjects));
        desk.run(args![
            "-q",
            "run",
            "pair.toml",
            "--datasets",
            "datasets.toml",
            "--variant",
            "surface",
            "--out",
            out
        ])
    };
    run("[\"tiny\", \"torn\", \"gone\"]", "run").exits(3, "two of three subjects cannot be read");
    let page = desk.read("run/tables.md");
    assert!(page.contains("torn/test_b/transforms.json") && page.contains("gone"), "{page}");
    let answer = run("[\"torn\"]", "none");
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("transforms.json"), "{answer:?}");
    let listed = desk.ok(args!["list", "datasets", "--datasets", "datasets.toml"]);
    assert!(listed.contains("not complete: 0 of 1 subjects; one cannot be loaded"), "{listed}");
    desk.put("datasets.toml", registry("[\"tiny\", \"gone\"]"));
    let listed = desk.ok(args!["list", "datasets", "--datasets", "datasets.toml"]);
    assert!(listed.contains("not complete: 1 of 2 subjects; no folder"), "{listed}");
    assert!(listed.contains("people/gone"), "{listed}");
    desk.put("datasets.toml", registry("[\"tiny\", \"torn\"]"));
    let listed = desk.ok(args!["list", "datasets", "--datasets", "datasets.toml"]);
    assert!(listed.contains("not complete: 1 of 2 subjects; one cannot be loaded: "), "{listed}");
    desk.put("datasets.toml", registry("[\"gone\"]"));
    let listed = desk.ok(args!["list", "datasets", "--datasets", "datasets.toml"]);
    assert!(listed.contains("not there: looked in"), "{listed}");
    // Asked for by name it costs its row too, and ends the run where nothing else was asked for.
    let asked = |subjects: &[&str], out: &str| {
        desk.put("datasets.toml", registry("[\"tiny\", \"torn\"]"));
        let mut all = args![
            "-q",
            "run",
            "pair.toml",
            "--datasets",
            "datasets.toml",
            "--variant",
            "surface",
            "--out",
            out
        ];
        all.extend(subjects.iter().flat_map(|id| ["--subject", *id]).map(OsString::from));
        desk.run(all)
    };
    asked(&["tiny", "torn"], "both").exits(3, "one of two subjects cannot be read");
    assert!(desk.read("both/tables.md").contains("torn/test_b/transforms.json"));
    asked(&["tiny"], "one").exits(0, "the other alone");
    let answer = asked(&["torn"], "none");
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("`torn` cannot be loaded") && answer.err.lines().count() == 1, "{answer:?}");
    assert!(!desk.path("none").exists());
}
