//! The first things that a new user does.

use crate::args;
use crate::program::{Answer, Desk, copy};
use crate::support::data;

/// A registry whose Blender renders are small ones.
const SETS: &str = r#"
[[dataset]]
id = "snapshot_ava"
title = "Blender: snapshot_ava"
layout = "folder"
capture = "monocular"
licence = "CC0-1.0"
provenance = "here"
path = "snapshot_ava"
"#;

#[test]
fn a_demo_shows_a_table_and_pictures() {
    let desk = Desk::new();
    desk.put("sets.toml", SETS);
    copy(&data("small/tiny"), &desk.path("snapshot_ava"));
    let run = |arguments| Answer::of(desk.command(arguments).env("REPRODUCE_DATASETS", "sets.toml"));
    let answer = run(args!["demo", "--out", "seen"]).exits(0, "a demo");
    assert!(
        answer.out.contains("## Demo") && answer.out.contains("| PSNR ↑ | SSIM ↑ | LPIPS ↓ |"),
        "{}",
        answer.out
    );
    assert_eq!(answer.out, desk.read("seen/tables.md"));
    assert!(desk.read("seen/demo.html").contains("data:image/"));
    assert!(desk.path("seen/images/README.md").is_file());
    assert!(answer.err.contains("seen/demo.html in a browser"), "{}", answer.err);
    // What it says of itself is the command that it was.
    let command = answer.err.lines().find_map(|line| line.strip_prefix("reproduce run ")).unwrap();
    let words = args!["run"].into_iter().chain(command.split(' ').map(Into::into)).collect();
    assert_eq!(run(words).exits(0, command).out, answer.out);
}

/// The tables are printed as they are done, and are those of the file.
#[test]
fn every_table_is_printed_when_it_is_done() {
    let desk = Desk::new();
    let small = |id: &str| include_str!("small.toml").replace("id = \"small\"", &format!("id = \"{id}\""));
    desk.put("b.toml", small("b"));
    desk.put("a.toml", small("a").replace("sh_degree = 1", "sh_degree = 0"));
    let tables = args!["run", "b.toml", "a.toml", "--data", data("small"), "--variant", "surface"];
    let run = desk.run([tables, args!["--limit", "1", "--out", "run"]].concat()).exits(0, "two tables");
    assert_eq!(run.out, desk.read("run/tables.md"));
    let at = |line: &str| run.err.find(line).unwrap_or_else(|| panic!("{line}: {}", run.err));
    assert!(at("b: avatar 1/1") < at("b: sequence") && at("b: sequence") < at("a: avatar 1/1"));
}

/// Away from the repository the figure is one that is generated.
#[test]
fn a_demo_needs_no_data() {
    let desk = Desk::new();
    let mut command = desk.command(args!["demo"]);
    command.env_remove("REPRODUCE_DATASETS");
    let answer = Answer::of(&mut command).exits(0, "a demo without data");
    assert!(
        answer.out.contains("Ran on: Synthetic figure") && answer.out.contains("Average of quaternions"),
        "{}",
        answer.out
    );
    assert!(desk.path("runs/demo/demo.html").is_file());
}

#[test]
fn a_subject_of_another_kind_of_capture_is_refused() {
    let desk = Desk::new();
    for command in ["plan", "run"] {
        desk.run(args![command, "table4", "--subject", "stripes"])
            .refuses(&["`stripes`: not among the data of table4", "ring_stripes"], command);
    }
    desk.run(args!["run", "table1", "--limit", "0"]).refuses(&["--limit", "0"], "no frame");
}

/// Whatever prints tables prints them in the formats of `report`.
#[test]
fn tables_are_printed_in_every_format() {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    let small = |out: &str| {
        let run = args!["run", "small.toml", "--data", data("small"), "--variant", "surface", "--out", out];
        [run, args!["--limit", "1"]].concat()
    };
    let run = |format: &str| [small("run"), args!["--format", format]].concat();
    for format in ["markdown", "json", "csv", "latex", "text"] {
        let printed = desk.ok(run(format));
        assert_eq!(printed, desk.ok(args!["report", "run", "--format", format]), "{format}");
    }
    desk.ok([small("slices"), args!["--shard", "1/1"]].concat());
    assert_eq!(desk.ok(args!["merge", "slices", "--format", "json"]), desk.ok(run("json")));
    let stress = desk.ok(args!["stress", "--quick", "--only", "averages", "--out", "s", "--format", "json"]);
    assert_eq!(stress, desk.read("s/stress.json"));
    desk.run(run("word")).refuses(&["--format", "word", "markdown"], "no format");
}
