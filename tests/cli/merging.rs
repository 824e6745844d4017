//! Collecting what several machines computed: what is refused, what differs, what is missing.

use crate::args;
use crate::program::{Answer, Desk, copy};
use crate::support::data;
use std::ffi::OsString;

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    desk
}

fn shard(desk: &Desk, out: &str, shard: &str, more: &[&str]) -> Answer {
    let mut all = args!["-q", "run", "small.toml", "--data", "data", "--fit-iterations", "2"];
    all.extend(args!["--out", out, "--shard", shard]);
    all.extend(more.iter().map(OsString::from));
    desk.run(all)
}

#[test]
fn slices_of_two_plans_are_refused_and_the_difference_is_named() {
    let desk = desk();
    shard(&desk, "a", "1/2", &[]).exits(0, "a slice");
    shard(&desk, "b", "2/2", &["--limit", "1"]).exits(0, "a slice of another plan");
    let merge = |from: [&str; 2]| desk.run(args!["merge", from[0], from[1], "--out", "out"]);
    merge(["a", "b"])
        .refuses(&["a/shard-01-of-02", "b/shard-02-of-02", "options.subset.limit", "1"], "plans");
    desk.put("data/tiny/test_b/images/image_0001.png", desk.bytes("data/tiny/test_b/images/image_0000.png"));
    shard(&desk, "c", "2/2", &[]).exits(0, "a slice on other data");
    merge(["a", "c"]).refuses(&["data", ".test: ", "slices of one"], "data");
    assert!(!desk.path("out").exists());
    merge(["a", "data"]).refuses(&["data: no results"], "no run");
    desk.run(args!["merge", "a", "b"]).refuses(&["--out"], "two folders and no third");
    std::fs::remove_dir_all(desk.path("b")).unwrap();
    copy(&desk.path("a"), &desk.path("b"));
    for entry in std::fs::read_dir(desk.path("b")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "json") {
            std::fs::remove_file(path).unwrap();
        }
    }
    desk.run(args!["merge", "b"]).refuses(&["shard-01-of-02.jsonl", "no plan-"], "no plan");
}

#[test]
fn machines_that_disagree_are_named_with_what_they_have() {
    let desk = desk();
    shard(&desk, "a", "1/1", &[]).exits(0, "all of it");
    copy(&desk.path("a"), &desk.path("b"));
    let store = desk.read("b/shard-01-of-01.jsonl");
    let start = store.find("\"psnr\":").unwrap() + "\"psnr\":".len();
    let psnr = &store[start..start + store[start..].find([',', '}']).unwrap()];
    let changed = store.replacen(psnr, "12.5", 1).replacen("\"host\":", "\"host\":\"elsewhere\",\"was\":", 1);
    desk.put("b/shard-01-of-01.jsonl", changed);
    let told = desk.run(args!["merge", "a", "b", "--out", "out"]).exits(1, "two results");
    for part in ["a/shard-01-of-01.jsonl:2 on ", "b/shard-01-of-01.jsonl:2 on elsewhere", "key ", "test_b"] {
        assert!(told.out.contains(part), "no `{part}` in {}", told.out);
    }
    assert!(told.out.contains(&format!("  psnr: {psnr} and 12.5\n")), "{}", told.out);
    assert!(!desk.path("out/results.json").exists() && told.err.contains("1 results differ"), "{}", told.err);
}

#[test]
fn what_is_missing_is_listed_with_its_slice() {
    let desk = desk();
    shard(&desk, "run", "1/2", &[]).exits(0, "one of two");
    let told = desk.run(args!["merge", "run"]).exits(3, "a slice is missing");
    let listed: Vec<&str> = told.err.lines().filter(|line| line.starts_with("missing: ")).collect();
    assert!(
        listed.len() == 3 && listed.iter().all(|line| line.ends_with("not run; in slice 2/2")),
        "{}",
        told.err
    );
    assert!(desk.read("run/tables.md").contains("(not run)"));
    let image = desk.bytes("data/tiny/test_b/images/image_0001.png");
    shard(&desk, "run", "2/2", &[]).exits(0, "the other");
    desk.run(args!["merge", "run"]).exits(0, "both");
    // Who computed what, and where the time went, is that of the slices.
    let said: serde_json::Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
    for (slice, name) in said["merged"].as_array().unwrap().iter().zip(["1/2", "2/2"]) {
        assert_eq!((&slice["shard"], slice["run"]["binary"].as_str().unwrap().len()), (&name.into(), 64));
    }
    let timing = desk.ok(args!["report", "run", "--timing"]);
    assert!(["1/2", "2/2"].iter().all(|slice| timing.contains(&format!("The last call of slice {slice}"))));
    // A slice whose frames fail says so itself, and the merge why.
    desk.put("data/tiny/test_b/images/image_0001.png", &image[..image.len() / 2]);
    shard(&desk, "damaged", "1/1", &[]).exits(3, "a damaged frame");
    let told = desk.run(args!["merge", "damaged"]).exits(3, "a damaged frame");
    assert!(told.err.contains("image_0001") && told.err.contains("failed: "), "{}", told.err);
}
