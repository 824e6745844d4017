//! Pipes and signals: readers that went away, inputs that are no files, being told to stop.
#![cfg(target_os = "linux")]

use crate::args;
use crate::program::{Answer, Desk, copy};
use crate::support::data;
use std::ffi::OsString;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    desk
}

fn run(out: &str) -> Vec<OsString> {
    args!["run", "small.toml", "--data", "data", "--fit-iterations", "2", "--out", out]
}

/// The exit code of a command nobody reads: a stream that is closed at its other end.
fn unread(desk: &Desk, arguments: Vec<OsString>, stdout: bool, stderr: bool) -> Option<i32> {
    let closed = || {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        Stdio::from(writer)
    };
    let mut command = desk.command(arguments);
    command.stdout(if stdout { closed() } else { Stdio::null() });
    command.stderr(if stderr { closed() } else { Stdio::null() });
    command.status().unwrap().code()
}

#[test]
fn a_verdict_is_the_same_when_nobody_reads() {
    let desk = desk();
    desk.run(run("now")).exits(0, "a run");
    let results = desk.read("now/results.json");
    let mut better: serde_json::Value = serde_json::from_str(&results).unwrap();
    let psnr = &mut better["tables"][0]["sequences"][0]["variants"][0]["summary"]["values"]["psnr"];
    *psnr = serde_json::Value::from(psnr.as_f64().unwrap() + 1.0);
    desk.put("better.json", better.to_string());
    let image = "data/tiny/test_b/images/image_0001.png";
    let bytes = desk.bytes(image);
    desk.put(image, &bytes[..bytes.len() / 2]);
    desk.run(run("damaged")).exits(3, "a damaged frame");
    desk.run([run("slices"), args!["--shard", "1/1"]].concat()).exits(3, "a damaged frame");
    let cases = [
        (args!["compare", "better.json", "now"], 1),
        (args!["compare", "better.json", "now", "--save", "junit=/dev/stdout"], 1),
        (args!["compare", "now", "now"], 0),
        (args!["report", "now", "--baseline", "better.json"], 1),
        (args!["report", "damaged"], 3),
        (run("damaged"), 3),
        (args!["merge", "slices"], 3),
        (args!["compare", "nowhere", "now"], 2),
        (args!["run", "--shard", "9"], 2),
        (args!["--help"], 0),
    ];
    for (arguments, code) in cases {
        for (stdout, stderr) in [(true, false), (false, true), (true, true)] {
            let found = unread(&desk, arguments.clone(), stdout, stderr);
            assert_eq!(found, Some(code), "{arguments:?}, stdout {stdout}, stderr {stderr}");
        }
    }
}

/// Runs a command that must not wait for anybody.
fn promptly(desk: &Desk, arguments: Vec<OsString>) -> Answer {
    let shown = format!("{arguments:?}");
    let mut child = desk.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            panic!("{shown}: waits");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Answer { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

fn pipe(desk: &Desk, name: &str) {
    let made = Command::new("mkfifo").arg(desk.path(name)).status().unwrap();
    assert!(made.success());
}

#[test]
fn pipes_in_place_of_files_are_refused_and_not_waited_for() {
    let desk = desk();
    let (body, poses) = (data("small/tiny/models/body.npz"), data("small/tiny/test_b/transforms.json"));
    let kinds =
        ["png", "jpg", "npy", "ply", "npz", "pkl", "pth", "ckpt", "glb", "gltf", "json", "jsonl", "toml"];
    kinds.iter().for_each(|kind| pipe(&desk, &format!("pipe.{kind}")));
    for kind in kinds.iter().filter(|kind| **kind != "toml") {
        let name = format!("pipe.{kind}");
        promptly(&desk, args!["inspect", name]).refuses(&[&name, "regular file"], kind);
    }
    let commands = [
        args!["run", "pipe.toml", "--data", "data"],
        args!["run", "small.toml", "--datasets", "pipe.toml"],
        args!["run", "small.toml", "--data", "data", "--motion", "pipe.npz", "--out", "r"],
        args!["run", "small.toml", "--data", "data", "--lpips-weights", "pipe.npz", "--out", "r"],
        args!["score", "pipe.png", "pipe.png"],
        args!["compare", "pipe.json", "pipe.json"],
        args!["report", "pipe.json"],
        args!["blend", "pipe.json"],
        args!["render", "pipe.ply", "--camera", "pipe.json", "--out", "o.png"],
        args!["skin", "pipe.ply", "--body", body, "--poses", poses, "--out", "o.ply"],
        args!["skin", "pipe.ply", "--body", "pipe.npz", "--poses", "pipe.npz", "--out", "o.ply"],
    ];
    for command in commands {
        let shown = format!("{command:?}");
        promptly(&desk, command).refuses(&["pipe.", "regular file"], &shown);
    }
    // In a subject's folder, whatever the file is for.
    for place in [
        "test_b/images/image_0000.png",
        "test_b/masks/mask_0000.png",
        "test_b/transforms.json",
        "models/body.npz",
    ] {
        let whole = desk.bytes(&format!("data/tiny/{place}"));
        std::fs::remove_file(desk.path(&format!("data/tiny/{place}"))).unwrap();
        pipe(&desk, &format!("data/tiny/{place}"));
        let answer = promptly(&desk, [run("r"), args!["-q"]].concat());
        assert!(matches!(answer.code, Some(2 | 3)), "{place}: {answer:?}");
        std::fs::remove_file(desk.path(&format!("data/tiny/{place}"))).unwrap();
        desk.put(&format!("data/tiny/{place}"), whole);
    }
}

#[test]
fn names_are_printed_without_what_a_terminal_obeys() {
    let desk = desk();
    let said = desk.run(args!["run", "\u{1b}]0;x\u{7}.toml"]);
    assert!(said.code == Some(2) && !said.err.contains(['\u{1b}', '\u{7}']), "{said:?}");
    copy(&desk.path("data/tiny"), &desk.path("data/a\u{1b}[31mb"));
    let said = desk.run([run("run"), args!["--subject", "a\u{1b}[31mb"]].concat());
    assert!(!said.err.contains('\u{1b}') && !said.out.contains('\u{1b}'), "{said:?}");
    // What turns the direction of writing.
    let turned = ['\u{202e}', '\u{2066}'];
    let rig = std::fs::read_to_string(crate::support::data("small/foreign_bodies/scaled.gltf")).unwrap();
    let mut rig: serde_json::Value = serde_json::from_str(&rig).unwrap();
    rig["nodes"][0]["name"] = serde_json::json!("\u{202e}a\u{2066}b");
    desk.put("rig.gltf", rig.to_string());
    assert!(!desk.ok(args!["inspect", "rig.gltf"]).contains(turned));
    let said = desk.run(args!["inspect", "\u{202e}.ply"]);
    assert!(said.code == Some(2) && !said.err.contains(turned), "{said:?}");
}

/// Whether a process does something of its own about SIGTERM.
fn catches_sigterm(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or_default();
    u64::from_str_radix(caught.trim(), 16).unwrap_or_default() >> 14 & 1 == 1
}

/// Sends a signal to a command once `begun`; what it says, and how long it takes to end.
fn stopped(
    desk: &Desk,
    arguments: Vec<OsString>,
    signal: &str,
    begun: impl Fn() -> bool,
) -> (Answer, Duration) {
    let mut child = desk.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !begun() || !catches_sigterm(child.id()) {
        assert!(
            start.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none(),
            "not begun"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    let told = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    let told = Instant::now();
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let answer = Answer { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) };
    (answer, told.elapsed())
}

#[test]
fn being_told_to_stop_ends_a_run_at_once_and_says_how_to_go_on() {
    let desk = desk();
    // Long enough to be in the middle of: a fit that ends in hours.
    let long = [&run("run")[..4], &args!["--fit-iterations", "3000000", "--out", "run"][..]].concat();
    let fit = args![
        "fit",
        "tiny",
        "--data",
        "data",
        "--iterations",
        "3000000",
        "--profile",
        "quick",
        "--out",
        "a.ply"
    ];
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let begun = || desk.path("run/avatars").is_dir();
        let (answer, took) = stopped(&desk, long.clone(), signal, begun);
        assert_eq!(answer.code, Some(code), "{answer:?}");
        assert!(took < Duration::from_secs(2), "{took:?}");
        let last = answer.err.lines().last().unwrap();
        assert!(
            last.starts_with("stopped by SIG") && last.contains("what is done is kept in run;"),
            "{last}"
        );
        let start = Instant::now();
        let (answer, took) =
            stopped(&desk, fit.clone(), signal, || start.elapsed() > Duration::from_millis(500));
        assert_eq!(answer.code, Some(code), "{answer:?}");
        assert!(took < Duration::from_secs(2) && answer.err.contains("a.checkpoint"), "{took:?} {answer:?}");
    }
    let left = desk.contents().into_iter().filter(|(path, _)| path.to_string_lossy().contains(".writing-"));
    assert_eq!(left.count(), 0);
    desk.run(run("run")).exits(0, "with fewer iterations");
}
