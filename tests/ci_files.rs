//! The shell steps of `ci/action.yml` and `ci/gitlab.yml`, run as they stand in the place of a project that copied them.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
mod support;

use program::{Answer, Desk, copy};
use std::path::Path;
use std::process::Command;
use support::data;

const ACTION: &str = include_str!("../ci/action.yml");
const GITLAB: &str = include_str!("../ci/gitlab.yml");

/// The script of a step of the action.
fn step(id: &str) -> String {
    let from = ACTION.split(&format!("    - id: {id}\n")).nth(1).unwrap_or_else(|| panic!("no step {id}"));
    let script = from.split("      run: |\n").nth(1).unwrap();
    let lines = script.lines().take_while(|line| line.starts_with("        ") || line.is_empty());
    lines.map(|line| line.get(8..).unwrap_or_default().to_owned() + "\n").collect()
}

/// The lines of the job's script.
fn gitlab_script() -> Vec<String> {
    let from = GITLAB.split("  script:\n").nth(1).unwrap();
    let lines = from.lines().map_while(|line| line.strip_prefix("    - "));
    lines
        .map(|line| line.strip_prefix('\'').and_then(|l| l.strip_suffix('\'')).unwrap_or(line).to_owned())
        .collect()
}

/// Runs a script as the runners do, with the program in reach.
fn bash(desk: &Desk, script: &str, environment: &[(&str, &str)]) -> Answer {
    let program = Path::new(env!("CARGO_BIN_EXE_reproduce")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new("bash");
    command.args(["-eo", "pipefail", "-c", script]).current_dir(desk.path("")).env("PATH", path);
    command.env("GITHUB_OUTPUT", desk.path("output")).env("GITHUB_STEP_SUMMARY", desk.path("summary"));
    command.env("REPRODUCE_DATASETS", concat!(env!("CARGO_MANIFEST_DIR"), "/datasets.toml"));
    Answer::of(command.envs(environment.iter().copied()))
}

/// A project with an experiment, its baseline, and one that is worse than it.
fn project() -> Desk {
    let desk = Desk::new();
    let table = include_str!("cli/tiny.toml").replace("id = \"tiny\"", "id = \"mine\"");
    desk.put("mine.toml", table.replace("snapshot_ava", "tiny"));
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    desk.ok(args!["run", "mine.toml", "--data", "data", "--limit", "1", "--out", "first", "-q"]);
    let results = desk.read("first/results.json");
    desk.put("baseline.json", &results);
    let mut better: serde_json::Value = serde_json::from_str(&results).unwrap();
    let psnr = &mut better["tables"][0]["sequences"][0]["variants"][0]["summary"]["values"]["psnr"];
    *psnr = serde_json::Value::from(psnr.as_f64().unwrap() + 1.0);
    desk.put("better.json", better.to_string());
    desk
}

#[test]
fn the_steps_of_the_action_run_and_carry_the_verdict() {
    let desk = project();
    bash(&desk, &step("install"), &[("VERSION", "skinsplat")]).exits(0, "installed");
    let run = [("EXPERIMENTS", "mine.toml"), ("ARGUMENTS", "--limit 1 --data data")];
    bash(&desk, &step("run"), &run).exits(0, "run");
    assert!(desk.read("skinsplat-ci/page.html").starts_with("<!DOCTYPE html>"));
    for (baseline, code) in [("baseline.json", "0"), ("better.json", "1")] {
        let compare = [("BASELINE", baseline), ("TOLERANCES", ""), ("COMPARISON", "")];
        let said = bash(&desk, &step("compare"), &compare).exits(0, "compare");
        assert!(said.out.lines().all(|line| line.starts_with("::")), "{}", said.out);
        assert!(desk.read("output").ends_with(&format!("code={code}\n")));
        assert!(desk.read("summary").contains("# Comparison"), "{}", desk.read("summary"));
        assert!(desk.read("skinsplat-ci/compare.xml").starts_with("<?xml"));
        bash(&desk, &step("verdict"), &[("CODE", code)]).exits(code.parse().unwrap(), "verdict");
    }
}

#[test]
fn the_script_of_the_gitlab_job_runs_and_carries_the_verdict() {
    let desk = project();
    let script = gitlab_script().join("\n");
    assert!(script.contains("reproduce compare"), "{script}");
    for (baseline, code) in [("baseline.json", 0), ("better.json", 1)] {
        let environment = [
            ("EXPERIMENTS", "mine.toml"),
            ("ARGUMENTS", "--limit 1 --data data"),
            ("BASELINE", baseline),
            ("TOLERANCES", ""),
            ("COMPARISON", ""),
            ("VERSION", "skinsplat"),
            ("CARGO_HOME", "none"),
        ];
        bash(&desk, &script, &environment).exits(code, baseline);
        assert!(!desk.path("asked").exists(), "nobody gave a token");
        // Somebody else's server: what it is asked is written down.
        desk.put("bin/curl", "#!/bin/sh\nprintf '%s\\n' \"$@\" >asked; exit 22\n");
        let posting = format!("chmod +x bin/curl; PATH=$PWD/bin:$PATH\n{script}");
        let request = [
            ("COMMENT_TOKEN", "secret"),
            ("CI_MERGE_REQUEST_IID", "7"),
            ("CI_PROJECT_ID", "42"),
            ("CI_API_V4_URL", "https://gitlab.example/api/v4"),
        ];
        let said = bash(&desk, &posting, &[&environment[..], &request].concat()).exits(code, baseline);
        assert!(said.err.contains("the note was not posted"), "{}", said.err);
        let asked = desk.read("asked");
        assert!(asked.contains("body@skinsplat-ci/comment.md"), "{asked}");
        assert!(
            asked.ends_with("https://gitlab.example/api/v4/projects/42/merge_requests/7/notes\n"),
            "{asked}"
        );
        std::fs::remove_file(desk.path("asked")).unwrap();
    }
}
