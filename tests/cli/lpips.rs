//! LPIPS from the command line: its weights, and every protocol at once.

use crate::args;
use crate::program::Desk;
use crate::support::{data, fixture, json};
use serde_json::Value;
use skinsplat_lpips_alex::SAFETENSORS as ALEX_BYTES;
use skinsplat_metrics::{LpipsNet, PROTOCOLS};
use std::ffi::OsString;

const PAIR: [&str; 2] = ["metrics/png/chelsea_128x192_blur_a.png", "metrics/png/chelsea_128x192_blur_b.png"];

fn score(desk: &Desk, more: &[&str]) -> Value {
    let mut arguments = args!["score", fixture(PAIR[0]), fixture(PAIR[1]), "--format", "json"];
    arguments.extend(more.iter().map(OsString::from));
    serde_json::from_str(&desk.ok(arguments)).unwrap()
}

/// The embedded weights with another header.
fn with_header(change: impl FnOnce(&mut serde_json::Map<String, Value>)) -> Vec<u8> {
    let length = u64::from_le_bytes(ALEX_BYTES[..8].try_into().unwrap()) as usize;
    let mut header = serde_json::from_slice(&ALEX_BYTES[8..8 + length]).unwrap();
    change(&mut header);
    let mut text = serde_json::to_vec(&header).unwrap();
    text.resize(text.len().next_multiple_of(8), b' ');
    [&(text.len() as u64).to_le_bytes()[..], &text, &ALEX_BYTES[8 + length..]].concat()
}

#[test]
fn weights_that_are_wrong_are_refused() {
    let desk = Desk::new();
    let header = 8 + u64::from_le_bytes(ALEX_BYTES[..8].try_into().unwrap()) as usize;
    let cut = |length: usize| ALEX_BYTES[..length].to_vec();
    let missing = with_header(|header| {
        let tensor = header.remove("features.8.bias").unwrap();
        header.insert("features.9.bias".to_owned(), tensor);
    });
    let shape = |name: &'static str, shape: Value| with_header(move |header| header[name]["shape"] = shape);
    let integers = with_header(|header| header["lin.3.weight"]["dtype"] = "I32".into());
    let mut nan = ALEX_BYTES.to_vec();
    let last = nan.len() - 4;
    nan[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    let mut endless = ALEX_BYTES.to_vec();
    endless[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    for (content, parts) in [
        (cut(0), &["LPIPS weights"][..]),
        (cut(7), &["LPIPS weights"]),
        (cut(8), &["LPIPS weights"]),
        (cut(header - 1), &["LPIPS weights"]),
        (cut(header), &["LPIPS weights"]),
        (cut(ALEX_BYTES.len() - 1), &["LPIPS weights"]),
        (endless, &["LPIPS weights"]),
        (b"\x89PNG\r\n\x1a\n and more".to_vec(), &["LPIPS weights"]),
        (missing, &["tensor features.8.bias", "missing"]),
        (
            shape("features.8.bias", serde_json::json!([2, 128])),
            &["tensor features.8.bias", "[2, 128]", "[256]"],
        ),
        (
            shape("features.0.weight", serde_json::json!([3, 64, 11, 11])),
            &["features.0.weight", "alex", "vgg"],
        ),
        (integers, &["tensor lin.3.weight", "I32", "F32"]),
        (nan, &["tensor lin.4.weight", "NaN"]),
    ] {
        desk.put("bad.safetensors", content);
        let all: Vec<&str> = ["bad.safetensors", "expected"].iter().chain(parts).copied().collect();
        desk.run(args!["score", fixture(PAIR[0]), fixture(PAIR[1]), "--lpips-weights", "bad.safetensors"])
            .refuses(&all, parts[0]);
    }
    desk.put("small.toml", include_str!("small.toml"));
    for (command, weights, part) in
        [("run", "bad.safetensors", "lin.4.weight"), ("plan", "none.safetensors", "none.safetensors")]
    {
        let small = args![command, "small.toml", "--data", data("small"), "--lpips-weights", weights];
        desk.run(small).refuses(&[part], command);
    }
}

#[test]
fn lpips_agrees_with_the_reference_and_a_file_goes_before_what_is_built_in() {
    let desk = Desk::new();
    let expected = json("metrics/expected.json")["pairs"]["chelsea_128x192_blur"]["lpips"].clone();
    let built_in = score(&desk, &["--lpips", "--protocol", "ihuman"]);
    for variant in ["alex_pm1", "alex_raw01"] {
        let (found, expected) = (&built_in[format!("lpips_{variant}")], &expected[variant]);
        assert!((found.as_f64().unwrap() - expected.as_f64().unwrap()).abs() < 1e-6, "{variant}: {found}");
    }
    assert_eq!(built_in["protocol"]["values"]["lpips"], built_in["lpips_alex_raw01"]);
    let missing = &built_in["not_computed"]["lpips_vgg_pm1"];
    assert_eq!(missing, "lpips: no weights for vgg; expected --lpips-weights FILE with the vgg network");
    desk.put("alex.safetensors", ALEX_BYTES);
    let given = score(&desk, &["--lpips", "--protocol", "ihuman", "--lpips-weights", "alex.safetensors"]);
    assert_eq!(given, built_in);
    // Without LPIPS nothing is said of it.
    let plain = score(&desk, &[]);
    assert!(!plain.to_string().contains("lpips"), "{plain}");
}

/// A file in the form of VGG-16's weights.
fn made_up_vgg() -> Vec<u8> {
    let (mut header, mut data) = (serde_json::Map::new(), Vec::<u8>::new());
    for (name, shape) in LpipsNet::Vgg.tensors() {
        let start = data.len();
        let count: usize = shape.iter().product();
        let scale = (6.0 / (count / shape[0]) as f32).sqrt();
        let value = |i: usize| ((i * 2_654_435_761) % 1009) as f32 / 504.5 - 1.0;
        // Weights of differences must not be negative for a distance.
        let sign = |value: f32| if name.starts_with("lin") { value.abs() } else { value };
        (0..count).for_each(|i| data.extend((sign(value(i)) * scale).to_le_bytes()));
        let tensor = serde_json::json!({"dtype": "F32", "shape": shape, "data_offsets": [start, data.len()]});
        header.insert(name, tensor);
    }
    let text = serde_json::to_vec(&header).unwrap();
    [&(text.len() as u64).to_le_bytes()[..], &text, &data].concat()
}

#[test]
fn every_protocol_at_once_is_each_by_itself() {
    let desk = Desk::new();
    for (frame, pair) in [("a", "chelsea_128x192_blur"), ("b", "impulse_48x40")] {
        for (folder, side) in [("renders", "a"), ("truths", "b")] {
            let file = fixture("metrics/png").join(format!("{pair}_{side}.png"));
            desk.put(&format!("{folder}/{frame}.png"), std::fs::read(file).unwrap());
        }
    }
    let all = |more: &[&str]| -> Value {
        let mut arguments = args!["score", "renders", "truths", "--protocol", "all", "--format", "json"];
        arguments.extend(more.iter().map(OsString::from));
        serde_json::from_str(&desk.ok(arguments)).unwrap()
    };
    let found = all(&[]);
    let rows = found["protocols"].as_array().unwrap();
    assert_eq!((rows.len(), &found["frames"]), (PROTOCOLS.len(), &Value::from(2)));
    for (row, protocol) in rows.iter().zip(PROTOCOLS.iter()) {
        assert_eq!(row["protocol"]["id"], protocol.id);
        if protocol.region.needs_mask() {
            assert!(row["not_computed"].as_str().unwrap().contains("mask: none given"), "{row}");
            continue;
        }
        let text =
            desk.ok(args!["score", "renders", "truths", "--protocol", protocol.id, "--format", "json"]);
        let single: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(row["scores"], single["protocol"], "{}", protocol.id);
        let vgg = protocol.lpips.net == LpipsNet::Vgg;
        assert_eq!(row["scores"]["values"]["lpips"].is_number(), !vgg, "{row}");
        assert_eq!(row["scores"]["not_computed"]["lpips"].is_string(), vgg, "{row}");
    }
    let text = desk.ok(args!["score", "renders", "truths", "--protocol", "all"]);
    assert!(text.lines().any(|line| line.starts_with("3dgs@1  ")), "{text}");
    let markdown = desk.ok(args!["score", "renders", "truths", "--protocol", "all", "--format", "markdown"]);
    assert!(markdown.contains("| 3dgs@1 | "), "{markdown}");
    assert!(
        text.contains("3dgs: not computed: lpips: no weights for vgg; expected --lpips-weights FILE"),
        "{text}"
    );
    let threads =
        ["1", "2"].map(|n| desk.ok(args!["score", "renders", "truths", "--protocol", "all", "--threads", n]));
    assert_eq!(threads[0], threads[1]);
    desk.put("vgg.safetensors", made_up_vgg());
    let given = all(&["--lpips-weights", "vgg.safetensors"]);
    for row in given["protocols"].as_array().unwrap().iter().filter(|row| !row["scores"].is_null()) {
        assert!(row["scores"]["values"]["lpips"].as_f64().unwrap() > 0.0, "{row}");
    }
}
