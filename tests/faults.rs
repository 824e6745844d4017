//! Faults that are seeded one at a time (`skinsplat::run::faults`): `compare` catches each on the experiment `ci`, by the name of the
//! table and of the frames, and reports no rounding.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;

use program::{Answer, Desk};
use serde_json::Value;
use skinsplat::run::faults::{Fault, VARIABLE};
use skinsplat_simd::Level;

/// What is compared with: the experiment as it is, two frames of each sequence. Its avatars are made once.
fn baseline() -> Desk {
    let desk = Desk::new();
    run(&desk, "sound", &[]);
    std::fs::create_dir(desk.path("now")).unwrap();
    program::copy(&desk.path("sound/avatars"), &desk.path("now/avatars"));
    desk
}

fn run(desk: &Desk, out: &str, environment: &[(&str, &str)]) {
    let arguments =
        args!["run", "ci", "--limit", "2", "--variant", "skinned", "--variant", "face", "--out", out];
    let mut command = desk.command(arguments);
    Answer::of(command.arg("-q").arg("--fresh").envs(environment.iter().copied())).exits(0, out);
}

#[test]
fn every_fault_is_caught_and_rounding_is_not() {
    let desk = baseline();
    let compare = || desk.run(args!["compare", "sound", "now", "--strict", "--format", "json"]);
    for (name, _) in Fault::ALL {
        run(&desk, "now", &[(VARIABLE, name)]);
        let changes: Value = serde_json::from_str(&compare().exits(1, name).out).unwrap();
        let moved = changes["lines"].as_array().unwrap().iter();
        let moved: Vec<&Value> = moved.filter(|line| line["fate"] != "unchanged").collect();
        assert!(moved.iter().all(|line| line["table"] == "ci") && !moved.is_empty(), "{name}: {moved:?}");
        let frames = changes["frames"].as_array().unwrap();
        let named = |frame: &Value| frame["frame"].as_str().is_some_and(|of| of.starts_with("image_"));
        assert!(frames.iter().all(named) && !frames.is_empty(), "{name}: {frames:?}");
    }
    for level in Level::available() {
        run(&desk, "now", &[(skinsplat_simd::VARIABLE, level.name())]);
        compare().exits(0, level.name());
    }
    noise_of_rounding(&desk);
}

/// Every score of the sound run moved by its last bits.
fn noise_of_rounding(desk: &Desk) {
    let mut results: Value = serde_json::from_str(&desk.read("sound/results.json")).unwrap();
    let mut number = 0_u64;
    shake(&mut results["tables"][0]["sequences"], &mut number);
    assert!(number > 50, "{number} numbers were moved");
    desk.put("noisy.json", results.to_string());
    let compared = desk.run(vec!["compare".into(), "sound".into(), "noisy.json".into(), "--strict".into()]);
    assert!(compared.exits(0, "rounding").out.contains("Frames that moved most"));
}

fn shake(value: &mut Value, number: &mut u64) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| shake(item, number)),
        // Counts are not rounded.
        Value::Object(fields) => {
            let measured = fields.iter_mut().filter(|(name, _)| *name != "splats");
            measured.for_each(|(_, item)| shake(item, number));
        }
        Value::Number(of) if of.is_f64() => {
            *number += 1;
            let sign = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            *value = Value::from(of.as_f64().unwrap() * (1.0 + sign * 1e-7));
        }
        _ => {}
    }
}
