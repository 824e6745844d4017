//! The first things that a new user does.

use crate::args;
use crate::program::Desk;

#[test]
fn a_demo_shows_a_table_and_pictures() {
    let desk = Desk::new();
    let answer = desk.run(args!["demo", "--out", "seen"]).exits(0, "a demo");
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
    assert_eq!(desk.run(words).exits(0, command).out, answer.out);
}

/// The tables are printed as they are done, and are those of the file.
#[test]
fn every_table_is_printed_when_it_is_done() {
    let desk = Desk::new();
    let tiny = |id: &str| include_str!("tiny.toml").replace("id = \"tiny\"", &format!("id = \"{id}\""));
    desk.put("b.toml", tiny("b"));
    desk.put("a.toml", tiny("a").replace("sh_degree = 1", "sh_degree = 0"));
    let run =
        desk.run(args!["run", "b.toml", "a.toml", "--limit", "1", "--out", "run"]).exits(0, "two tables");
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
    let answer = crate::program::Answer::of(&mut command).exits(0, "a demo without data");
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
    desk.put("tiny.toml", include_str!("tiny.toml"));
    let run = |format: &str| args!["run", "tiny.toml", "--limit", "1", "--out", "run", "--format", format];
    for format in ["markdown", "json", "csv", "latex", "text"] {
        let printed = desk.ok(run(format));
        assert_eq!(printed, desk.ok(args!["report", "run", "--format", format]), "{format}");
    }
    desk.ok(args!["run", "tiny.toml", "--limit", "1", "--out", "slices", "--shard", "1/1"]);
    assert_eq!(desk.ok(args!["merge", "slices", "--format", "json"]), desk.ok(run("json")));
    let stress = desk.ok(args!["stress", "--quick", "--only", "averages", "--out", "s", "--format", "json"]);
    assert_eq!(stress, desk.read("s/stress.json"));
    desk.run(run("word")).refuses(&["--format", "word", "markdown"], "no format");
}
