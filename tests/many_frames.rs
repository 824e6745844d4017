//! A thousand frames take the memory of a hundred, and ten times their time. SKINSPLAT_MANY_FRAMES=10000 asks for more:
//! `SKINSPLAT_MANY_FRAMES=10000 cargo test --release --test many_frames -- --nocapture`.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/program.rs"]
mod program;

use program::Desk;
use std::process::Stdio;
use std::time::{Duration, Instant};

const DATA: &str = r#"
[[dataset]]
id = "many"
title = "Many frames"
layout = "synthetic"
capture = "monocular"
licence = "MIT OR Apache-2.0"
provenance = "Generated in-process."

[dataset.parameters.arm]
capture = "monocular"
seed = 9
resolution = 64
samples = 1
train_frames = 4
test_frames = FRAMES
rig = { kind = "arm", bones = 3, length = 0.9, radius = 0.06 }
"#;

/// What a run of so many frames took.
#[derive(Debug)]
struct Taken {
    /// Seconds after the plan was made, per frame.
    seconds_per_frame: f64,
    /// Most memory at a time, bytes.
    peak: u64,
}

fn run(frames: usize) -> Taken {
    let desk = Desk::new();
    let table = include_str!("cli/tiny.toml").replace("sequences = [\"snapshot_ava\"]", "sequences = []");
    desk.put("many.toml", table.replace("id = \"tiny\"", "id = \"many\"").replace("snapshot_ava", "many"));
    // Two test sequences.
    desk.put("data.toml", DATA.replace("FRAMES", &(frames / 2).to_string()));
    let all =
        args!["-q", "run", "many.toml", "--datasets", "data.toml", "--profile", "standard", "--out", "run"];
    let mut command = desk.command([all, args!["--variant", "skinned"]].concat());
    let mut child = command.stdout(Stdio::null()).spawn().unwrap();
    let (start, mut peak, mut begun) = (Instant::now(), 0, None);
    let status = loop {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        peak = peak.max(kilobytes.unwrap_or_default() * 1024);
        if begun.is_none() && desk.path("run/frames.jsonl").is_file() {
            begun = Some(start.elapsed());
        }
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(status.success(), "{status}");
    let taken = start.elapsed() - begun.unwrap();
    let records = desk.read("run/frames.jsonl").matches("{\"frame\":").count();
    assert_eq!(records, frames / 2 * 2);
    Taken { seconds_per_frame: taken.as_secs_f64() / frames as f64, peak }
}

#[test]
fn memory_does_not_grow_with_the_number_of_frames() {
    let asked = std::env::var("SKINSPLAT_MANY_FRAMES").ok().map(|text| text.parse().unwrap());
    let (few, many) = (100, asked.unwrap_or(1000));
    let [small, large] = [few, many].map(run);
    for (frames, Taken { seconds_per_frame, peak }) in [(few, &small), (many, &large)] {
        eprintln!(
            "{frames} frames: {:.2} ms each, at most {:.1} MB",
            seconds_per_frame * 1e3,
            *peak as f64 / 1e6
        );
    }
    // Plan, records and results are kept, 10 kilobytes per frame; an image of 64 by 64 in f64 takes 98.
    let grown = large.peak.saturating_sub(small.peak);
    assert!(grown < 8_000_000 + 12_000 * many as u64, "{grown} bytes more: {small:?} {large:?}");
}
