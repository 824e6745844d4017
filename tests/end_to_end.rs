//! Whole runs: repeated, threaded, killed, sharded, with a frame that fails; the files must not show any of it.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
mod support;

use program::{Answer, Desk, contents, copy};
use serde_json::Value;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::Path;
use std::time::{Duration, Instant};

/// A seventh table: a file, and no Rust code.
const TABLE: &str = include_str!("cli/tiny.toml");

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("tiny.toml", TABLE);
    desk
}

/// The subject's place.
const SMALL: [&str; 2] = ["--data", "data"];

/// A desk with the table on a subject of 32 pixels, for what does not depend on sizes.
fn small_desk() -> Desk {
    let desk = Desk::new();
    desk.put("tiny.toml", TABLE.replace("snapshot_ava", "tiny"));
    copy(&support::data("small/tiny"), &desk.path("data/tiny"));
    desk
}

fn arguments(out: &str, more: &[&str]) -> Vec<OsString> {
    let mut all = args!["run", "tiny.toml", "--out", out];
    all.extend(more.iter().map(OsString::from));
    all
}

fn run(desk: &Desk, out: &str, more: &[&str]) -> Answer {
    desk.run(arguments(out, more)).exits(0, out)
}

/// Everything that a run writes but its store and provenance: what must be equal byte for byte.
fn products(desk: &Desk, out: &str) -> Vec<(String, Vec<u8>)> {
    let folder = desk.path(out);
    let relative = |path: &Path| path.strip_prefix(&folder).unwrap().display().to_string();
    let files = contents(&folder).into_iter().filter_map(|(path, bytes)| Some((relative(&path), bytes?)));
    files.filter(|(name, _)| !name.ends_with(".jsonl") && name != "run.json").collect()
}

fn assert_equal(desk: &Desk, a: &str, b: &str) {
    let [a, b] = [a, b].map(|out| products(desk, out));
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|f| f.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

fn rendered(desk: &Desk, out: &str) -> u64 {
    let run: Value = serde_json::from_str(&desk.read(&format!("{out}/run.json"))).unwrap();
    run["frames_rendered"].as_u64().unwrap()
}

/// Keys of all records of a store, in order.
fn keys(store: &str) -> Vec<String> {
    let lines = store.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.filter_map(|line| Some(line.get("frame")?["key"].as_str()?.to_owned())).collect()
}

fn assert_nothing_twice(keys: &[String]) {
    assert_eq!(keys.iter().collect::<BTreeSet<_>>().len(), keys.len(), "a frame was rendered twice");
}

#[test]
fn a_second_run_renders_nothing_and_changes_nothing() {
    let desk = small_desk();
    let first = run(&desk, "run", &SMALL);
    assert_eq!(rendered(&desk, "run"), 3);
    let names: Vec<String> = products(&desk, "run").into_iter().map(|file| file.0).collect();
    assert_eq!(names.len(), 6, "{names:?}");
    for name in ["results.json", "tables.md", "tiny.csv", "tiny.tex"] {
        assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
    }
    let (before, store) = (products(&desk, "run"), desk.read("run/frames.jsonl"));
    let second = run(&desk, "run", &SMALL);
    assert_eq!((rendered(&desk, "run"), first.out), (0, second.out));
    assert!(products(&desk, "run") == before && desk.read("run/frames.jsonl") == store);
    // Another avatar folder is rebuilt, bit for bit.
    std::fs::remove_dir_all(desk.path("run/avatars")).unwrap();
    run(&desk, "run", &[&SMALL[..], &["--fresh"]].concat());
    assert_eq!(rendered(&desk, "run"), 3);
    assert!(products(&desk, "run") == before);
}

#[test]
fn threads_and_places_do_not_show() {
    let desk = desk();
    run(&desk, "one", &["--threads", "1"]);
    run(&desk, "two", &["--threads", "2"]);
    assert_equal(&desk, "one", "two");
    // Another folder, another path to the experiment, another path for the output, another path to the data.
    let (here, elsewhere) = (small_desk(), small_desk());
    run(&here, "run", &SMALL);
    let experiment = elsewhere.put("deep/tiny.toml", elsewhere.read("tiny.toml"));
    let (out, data) = (elsewhere.path("a/b/c"), elsewhere.path("data"));
    elsewhere.ok(args!["run", experiment, "--data", data, "--out", out]);
    assert!(products(&elsewhere, "a/b/c") == products(&here, "run"));
    for (desk, out) in [(&desk, "one"), (&here, "run"), (&elsewhere, "a/b/c")] {
        let results = desk.read(&format!("{out}/results.json"));
        for trace in [desk.path("").display().to_string(), "unix".into(), "seconds".into()] {
            assert!(!results.contains(&trace), "{trace}");
        }
    }
}

#[test]
fn a_killed_run_goes_on_where_it_stopped() {
    let desk = desk();
    let more = ["--profile", "standard", "--threads", "1"];
    run(&desk, "whole", &more);
    let mut child = desk.command(arguments("killed", &more)).spawn().unwrap();
    let store = desk.path("killed/frames.jsonl");
    let start = Instant::now();
    let done = loop {
        let text = std::fs::read_to_string(&store).unwrap_or_default();
        let done = text.matches("{\"frame\":").count();
        if done >= 2 || child.try_wait().unwrap().is_some() {
            break done;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "no frame was written");
        std::thread::sleep(Duration::from_millis(1));
    };
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!desk.path("killed/results.json").exists(), "killed too late, after {done} records");
    // What a write that was cut short leaves.
    let mut text = std::fs::read(&store).unwrap();
    text.extend(b"{\"frame\":{\"key\":\"12");
    std::fs::write(&store, text).unwrap();
    run(&desk, "killed", &more);
    assert_equal(&desk, "whole", "killed");
    let keys = keys(&desk.read("killed/frames.jsonl"));
    assert_nothing_twice(&keys);
    assert_eq!(keys.len(), 12);
    assert!(rendered(&desk, "killed") < 6, "all frames were rendered again");
    assert!(
        contents(&desk.path("killed")).iter().all(|(p, _)| !p.display().to_string().contains(".writing-"))
    );
}

/// What a run leaves for its reader: everything but what it works with, slices included.
fn shown(desk: &Desk, out: &str) -> Vec<(String, Vec<u8>)> {
    let works_with =
        |name: &str| ["avatars", "plan-", "shard-"].iter().any(|working| name.starts_with(working));
    products(desk, out).into_iter().filter(|(name, _)| !works_with(name)).collect()
}

fn assert_same_tables(desk: &Desk, a: &str, b: &str) {
    let [a, b] = [a, b].map(|out| shown(desk, out));
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|f| f.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

#[test]
fn shards_merge_to_the_same_tables() {
    let desk = small_desk();
    // A fit besides, whose way is drawn too.
    let table = desk.read("tiny.toml");
    let fit = table.replacen("surface-vertex\" }", "fit\", name = \"hugs-skinned\" }", 1);
    desk.put("tiny.toml", fit.replacen("sh_degree = 1\n", "", 1));
    let more = [SMALL[0], SMALL[1], "--fit-iterations", "2", "--limit", "3"];
    let whole = run(&desk, "whole", &more);
    for shard in ["1/3", "2/3", "3/3"] {
        let own = format!("own-{}", &shard[..1]);
        for out in ["shared", &own] {
            let answer = run(&desk, out, &[&more[..], &["--shard", shard]].concat());
            assert_eq!(answer.out, "");
            assert!(!desk.path(out).join("results.json").exists());
        }
    }
    let keys: Vec<String> =
        [1, 2, 3].iter().flat_map(|i| keys(&desk.read(&format!("shared/shard-0{i}-of-03.jsonl")))).collect();
    assert_nothing_twice(&keys);
    // From one folder into itself, and from three into a fourth, without data and experiment.
    std::fs::remove_file(desk.path("tiny.toml")).unwrap();
    std::fs::remove_dir_all(desk.path("data")).unwrap();
    assert_eq!(desk.ok(args!["merge", "shared"]), whole.out);
    assert_same_tables(&desk, "whole", "shared");
    for again in 0..2 {
        let merged = desk.ok(args!["merge", "own-1", "own-2", "own-3", "--out", "merged"]);
        assert_eq!(merged, whole.out, "{again}");
    }
    assert!(desk.path("merged/curves.csv").is_file());
    assert_same_tables(&desk, "whole", "merged");
    // The folder is a run's: nothing is left to do.
    assert_eq!(desk.ok(args!["report", "merged"]), whole.out);
    desk.ok(args!["report", "merged", "--timing"]);
}

#[test]
fn other_settings_redo_only_what_they_change() {
    let desk = small_desk();
    let run = |more: &[&str]| run(&desk, "run", &[&SMALL[..], more].concat());
    run(&["--limit", "1"]);
    assert_eq!(rendered(&desk, "run"), 1);
    run(&["--limit", "2"]);
    assert_eq!(rendered(&desk, "run"), 1);
    run(&["--limit", "2", "--all-strategies"]);
    assert_nothing_twice(&keys(&desk.read("run/frames.jsonl")));
    let page = desk.read("run/tables.md");
    // Those of the table's own variants have a row already.
    let shown = ["lbs", "quaternion-average"];
    for preset in skinsplat_posing::PRESETS.iter().filter(|preset| !shown.contains(&preset.id)) {
        assert!(page.contains(preset.title), "{} in {page}", preset.title);
    }
    desk.put("tiny.toml", desk.read("tiny.toml").replace("avatar-v1", "hugs-full"));
    run(&["--limit", "1"]);
    assert_eq!(rendered(&desk, "run"), 1);
    assert!(desk.read("run/tables.md").contains("Protocol: hugs-full, version 1."));
}

#[test]
fn a_folder_of_ones_own_and_a_frame_that_fails() {
    let desk = small_desk();
    run(&desk, "whole", &SMALL);
    let image = desk.path("data/tiny/test_b/images/image_0001.png");
    let bytes = std::fs::read(&image).unwrap();
    std::fs::write(&image, &bytes[..bytes.len() / 2]).unwrap();

    let answer = desk.run(arguments("run", &SMALL)).exits(3, "a damaged frame");
    assert!(answer.err.contains("2 scores are missing"), "{}", answer.err);
    let page = desk.read("run/tables.md");
    assert!(page.contains("image_0001"), "{page}");
    let results: Value = serde_json::from_str(&desk.read("run/results.json")).unwrap();
    let sequences = results["tables"][0]["sequences"].as_array().unwrap();
    let frames = |sequence: &Value| sequence["variants"][0]["frames"].as_array().unwrap().clone();
    let scored = |frames: Vec<Value>| frames.iter().filter(|frame| !frame["score"].is_null()).count();
    assert_eq!(sequences.iter().map(|s| scored(frames(s))).sum::<usize>(), 2);
    let failed: Vec<Value> =
        sequences.iter().flat_map(frames).filter(|frame| frame["score"].is_null()).collect();
    assert_eq!(failed.len(), 1);
    let problem = failed[0]["error"].as_str().unwrap();
    assert!(problem.contains("image_0001.png") && !problem.contains('\n'), "{problem}");
    // The report of it says the same, and repaired data repairs the run.
    assert_eq!(desk.run(args!["report", "run"]).exits(3, "report").out, page);
    std::fs::write(&image, bytes).unwrap();
    run(&desk, "run", &SMALL);
    assert_equal(&desk, "whole", "run");
}

/// The paper's tables on a subject of one's own, which stands in under its own name.
#[test]
fn the_papers_tables_on_a_folder() {
    let desk = Desk::new();
    let data = support::data("blender");
    let page = desk.ok(args!["run", "--data", data, "--out", "run", "--limit", "1", "--fit-iterations", "2"]);
    for table in 1..=6 {
        assert!(page.contains(&format!("## Table {table}")), "{page}");
        assert!(desk.path(&format!("run/table{table}.csv")).is_file());
    }
    assert!(page.matches("Ran on: ").count() >= 6 && page.matches("a stand-in").count() >= 6, "{page}");
    assert!(!page.contains("Ran on: NeuMan") && !page.contains("Ran on: PeopleSnapshot"), "{page}");
}
