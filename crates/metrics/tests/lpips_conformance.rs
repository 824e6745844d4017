//! LPIPS against reference values that PyTorch computed in f64, tap by tap, and against a direct evaluation in f64.
//!
//! VGG-16's weights (59 MB) are not in the repository: its tests run if `REPRODUCE_LPIPS_WEIGHTS` names the file, and say
//! so on standard error if not. Its layers are tested with made-up weights in any case.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use serde_json::Value;
use sha2::{Digest, Sha256};
use skinsplat_data::frames::load_image;
use skinsplat_lpips_alex::SAFETENSORS as ALEX_BYTES;
use skinsplat_metrics::lpips::convolution::{Convolution, ConvolutionShape};
use skinsplat_metrics::lpips::weights::{self, GivenNetwork, Networks};
use skinsplat_metrics::lpips::{FeatureMap, Features, Network, OneFrame, network_input};
use skinsplat_metrics::{InputRange, LpipsNet, LpipsVariant, MetricsError, PerceptualDistance, Planes};
use std::io::Write;
use std::path::{Path, PathBuf};

/// f32 features against f64: the largest deviation over all cases is 2e-7.
const TOLERANCE: f64 = 1e-6;

fn planes(path: &Path) -> Planes {
    Planes::new(&load_image(path).unwrap().0, "image").unwrap()
}

/// The file with VGG's weights; says so if there is none.
fn vgg_file(test: &str) -> Option<PathBuf> {
    let file = std::env::var_os("REPRODUCE_LPIPS_WEIGHTS").map(PathBuf::from);
    if file.is_none() {
        // Not eprintln!, which the test runner would swallow.
        let note = format!(
            "{test}: NOT RUN for VGG-16: REPRODUCE_LPIPS_WEIGHTS does not name lpips_vgg.safetensors\n"
        );
        std::io::stderr().write_all(note.as_bytes()).unwrap();
    }
    file
}

fn read(file: &Path) -> GivenNetwork {
    let network = Network::from_safetensors(&std::fs::read(file).unwrap()).unwrap();
    GivenNetwork { network, digest: String::new() }
}

/// The networks to test and their weights.
fn networks(test: &str) -> (Vec<LpipsNet>, Networks) {
    let file = vgg_file(test);
    let nets = if file.is_some() { LpipsNet::ALL.to_vec() } else { vec![LpipsNet::Alex] };
    (nets, Networks::new(file.map(|file| read(&file))))
}

fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let off = (found - expected).abs();
    assert!(off <= tolerance, "{what}: {found}, expected {expected}, off by {off:e}");
}

#[test]
fn the_weights_in_the_program_are_the_authentic_ones() {
    let digest: String = Sha256::digest(ALEX_BYTES).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(digest, "00d05375ace26c1bbd5ac29311d047fc23ebeccb6429ac0fca35a7c698aaceb4");
    assert_eq!(weights::embedded().net(), LpipsNet::Alex);
}

#[test]
fn distances_agree_with_the_reference() {
    let (nets, networks) = networks("distances_agree_with_the_reference");
    let expected = support::json("metrics/expected.json");
    let (mut compared, mut refused) = (0, 0);
    for (name, pair) in expected["pairs"].as_object().unwrap() {
        let [a, b] = [0, 1]
            .map(|i| planes(&support::fixture(&format!("metrics/{}", pair["files"][i].as_str().unwrap()))));
        let frame = OneFrame::new(&networks);
        for variant in LpipsVariant::ALL.into_iter().filter(|variant| nets.contains(&variant.net)) {
            let key = variant.id().replace('-', "_");
            let what = format!("{name} {key}");
            match (frame.distance(&a, &b, variant), &pair["lpips"][&key]) {
                (found, Value::Number(number)) => {
                    assert_close(found.unwrap(), number.as_f64().unwrap(), TOLERANCE, &what);
                    compared += 1;
                }
                (found, reference) => {
                    assert!(reference.as_str().unwrap().starts_with("error"), "{what}");
                    assert!(matches!(found, Err(MetricsError::TooSmall { .. })), "{what}: {found:?}");
                    refused += 1;
                }
            }
        }
    }
    let per_net = compared / nets.len();
    assert!(per_net >= 20 && refused >= 4, "{compared} compared, {refused} refused");
}

#[test]
fn the_published_example() {
    let (nets, networks) = networks("the_published_example");
    let folder = support::fixture("lpips_example");
    let [truth, p0, p1] = ["ref", "p0", "p1"].map(|name| planes(&folder.join(format!("ex_{name}.png"))));
    let expected = support::json("lpips_example/expected.json");
    for net in nets {
        let frame = OneFrame::new(&networks);
        let network = skinsplat_metrics::lpips::NetworkSource::network(&networks, net).unwrap();
        let features = |image: &Planes| network.features(&network_input(image, InputRange::Pm1));
        for (name, image) in [("ex_p0", &p0), ("ex_p1", &p1)] {
            let expected = &expected[format!("{}/{name}", net.id())];
            let variant = LpipsVariant { net, range: InputRange::Pm1 };
            let found = frame.distance(image, &truth, variant).unwrap();
            assert_close(found, expected["f64"].as_f64().unwrap(), TOLERANCE, name);
            let layers = network.layer_distances(&features(image), &features(&truth));
            for (layer, reference) in layers.iter().zip(expected["per_layer"].as_array().unwrap()) {
                assert_close(*layer, reference.as_f64().unwrap(), TOLERANCE, name);
            }
        }
    }
    // As printed by the authors.
    let alex = |image: &Planes| {
        let variant = LpipsVariant { net: LpipsNet::Alex, range: InputRange::Pm1 };
        format!("{:.3}", OneFrame::new(&networks).distance(image, &truth, variant).unwrap())
    };
    assert_eq!((alex(&p0), alex(&p1)), ("0.722".to_owned(), "0.138".to_owned()));
}

#[test]
fn taps_agree_with_the_reference() {
    let (nets, networks) = networks("taps_agree_with_the_reference");
    let expected = support::json("metrics/lpips_taps_astro64.json");
    let image = planes(&support::fixture("metrics/png/taps_astro64.png"));
    for net in nets {
        let expected = &expected[net.id()];
        let input = network_input(&image, InputRange::Pm1);
        probe(&input, &expected["scaled_input_probe"], 1e-7, "scaled input");
        let network = skinsplat_metrics::lpips::NetworkSource::network(&networks, net).unwrap();
        let Features { taps } = network.features(&input);
        let references = expected["taps"].as_array().unwrap();
        assert_eq!(taps.len(), references.len());
        for (k, (tap, reference)) in taps.iter().zip(references).enumerate() {
            let what = format!("{} tap {k}", net.id());
            let shape: Vec<u64> = [tap.channels, tap.height, tap.width].map(|n| n as u64).to_vec();
            assert_eq!(reference["shape"], serde_json::json!(shape), "{what}");
            let count = tap.values.len() as f64;
            let values = || tap.values.iter().map(|&value| f64::from(value));
            let number = |name: &str| reference[name].as_f64().unwrap();
            let mean = values().sum::<f64>() / count;
            let square = values().map(|value| value * value).sum::<f64>();
            assert_close(mean, number("mean"), 1e-5 * number("mean"), &what);
            let variance = square / count - mean * mean;
            // Both conventions of the divisor.
            assert_close(variance.sqrt(), number("std"), 1e-5 * number("std") + 1.0 / count, &what);
            assert_close(square.sqrt(), number("l2"), 1e-5 * number("l2"), &what);
            assert_close(values().fold(0.0, f64::max), number("max"), 1e-5 * number("max"), &what);
            let zeros = values().filter(|&value| value == 0.0).count() as f64 / count;
            assert_close(zeros, number("zero_fraction"), 2e-5, &what);
            probe(tap, &reference["probes"], 1e-5 * number("max"), &what);
        }
    }
}

/// Checks values at (channel, row, column).
fn probe(map: &FeatureMap, probes: &Value, tolerance: f64, what: &str) {
    let probes = probes.as_array().unwrap();
    assert!(!probes.is_empty());
    for probe in probes {
        let at = |i: usize| probe[i].as_u64().unwrap() as usize;
        let found = f64::from(map.at(at(2), at(1))[at(0)]);
        assert_close(found, probe[3].as_f64().unwrap(), tolerance, &format!("{what} {probe}"));
    }
}

/// Numbers in [-1, 1] from a linear congruential generator.
fn noise(seed: u64, count: usize) -> Vec<f32> {
    let mut state = seed;
    let next = |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    (0..count).map(next).collect()
}

fn noise_map(seed: u64, width: usize, height: usize, channels: usize) -> FeatureMap {
    FeatureMap { width, height, channels, values: noise(seed, width * height * channels) }
}

/// The definition of a rectified convolution, in f64.
fn naive(shape: ConvolutionShape, weights: &[f32], bias: &[f32], input: &FeatureMap) -> Vec<f64> {
    let ConvolutionShape { inputs, outputs, kernel, stride, padding } = shape;
    let (width, height) = (shape.output_size(input.width), shape.output_size(input.height));
    let mut values = Vec::new();
    for (y, x, o) in
        (0..height * width * outputs).map(|i| (i / outputs / width, i / outputs % width, i % outputs))
    {
        let mut sum = f64::from(bias[o]);
        for (ky, kx) in (0..kernel * kernel).map(|tap| (tap / kernel, tap % kernel)) {
            let (row, column) = (
                (y * stride + ky) as isize - padding as isize,
                (x * stride + kx) as isize - padding as isize,
            );
            if row < 0 || column < 0 || row >= input.height as isize || column >= input.width as isize {
                continue;
            }
            for (c, value) in input.at(column as usize, row as usize).iter().enumerate() {
                let weight = weights[((o * inputs + c) * kernel + ky) * kernel + kx];
                sum += f64::from(weight) * f64::from(*value);
            }
        }
        values.push(sum.max(0.0));
    }
    values
}

#[test]
fn convolutions_are_their_definition() {
    let shape = |inputs, outputs, kernel, stride, padding| ConvolutionShape {
        inputs,
        outputs,
        kernel,
        stride,
        padding,
    };
    for (seed, (shape, width, height)) in [
        (shape(3, 64, 11, 4, 2), 47, 35),
        (shape(64, 192, 5, 1, 2), 7, 9),
        (shape(3, 64, 3, 1, 1), 31, 17),
        (shape(40, 33, 3, 1, 1), 13, 5),
        (shape(5, 7, 1, 1, 0), 4, 3),
        (shape(2, 40, 3, 2, 0), 3, 40),
    ]
    .into_iter()
    .enumerate()
    {
        let depth = shape.inputs * shape.kernel * shape.kernel;
        let (weights, bias) = (noise(seed as u64, shape.outputs * depth), noise(99, shape.outputs));
        let input = noise_map(seed as u64 + 50, width, height, shape.inputs);
        let found = Convolution::new(shape, &weights, &bias).rectified(&input);
        let expected = naive(shape, &weights, &bias, &input);
        assert_eq!(found.values.len(), expected.len(), "{shape:?}");
        for (i, (&found, expected)) in found.values.iter().zip(expected).enumerate() {
            // Sums of `depth` products below 1, in f32.
            let tolerance = 1e-7 * depth as f64;
            assert_close(f64::from(found), expected, tolerance, &format!("{shape:?} value {i}"));
        }
    }
}

/// VGG-16 with made-up weights that keep the size of the features, through every layer, against the same in f64.
#[test]
fn every_layer_of_vgg_is_where_it_belongs() {
    let tensors: Vec<Vec<f32>> = LpipsNet::Vgg
        .tensors()
        .iter()
        .enumerate()
        .map(|(i, (_, shape))| {
            let fan_in: usize = shape[1..].iter().product();
            let scale = if shape.len() == 4 && shape[2] == 3 { (6.0 / fan_in as f32).sqrt() } else { 0.1 };
            noise(i as u64, shape.iter().product()).iter().map(|value| value * scale).collect()
        })
        .collect();
    let network = Network::new(LpipsNet::Vgg, &tensors);
    let input = noise_map(7, 18, 21, 3);
    let Features { taps } = network.features(&input);
    // Tap, convolutions before it; a 2 x 2 maximum between taps.
    let (mut current, mut tensor) = (input, 0);
    for (k, (tap, convolutions)) in taps.iter().zip([2, 2, 3, 3, 3]).enumerate() {
        if k > 0 {
            current = halved(&current);
        }
        for _ in 0..convolutions {
            let outputs = tensors[tensor + 1].len();
            let shape =
                ConvolutionShape { inputs: current.channels, outputs, kernel: 3, stride: 1, padding: 1 };
            let values = naive(shape, &tensors[tensor], &tensors[tensor + 1], &current);
            let values = values.into_iter().map(|value| value as f32).collect();
            current = FeatureMap { channels: outputs, values, ..current };
            tensor += 2;
        }
        assert_eq!((tap.width, tap.height, tap.channels), (current.width, current.height, current.channels));
        let largest = current.values.iter().copied().fold(0.0, f32::max);
        assert!(largest > 0.1, "tap {k} has died out");
        for (i, (&found, &expected)) in tap.values.iter().zip(&current.values).enumerate() {
            let what = format!("tap {k} value {i}");
            assert_close(f64::from(found), f64::from(expected), 1e-5 * f64::from(largest), &what);
        }
    }
    assert_eq!(tensor, 26);
}

fn halved(map: &FeatureMap) -> FeatureMap {
    let (width, height) = (map.width / 2, map.height / 2);
    let mut values = Vec::new();
    for (y, x, c) in (0..height * width * map.channels)
        .map(|i| (i / map.channels / width, i / map.channels % width, i % map.channels))
    {
        let window = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(dx, dy)| map.at(2 * x + dx, 2 * y + dy)[c]);
        values.push(window.into_iter().fold(f32::MIN, f32::max));
    }
    FeatureMap { width, height, channels: map.channels, values }
}

fn embedded_distance(a: &Planes, b: &Planes) -> Result<f64, MetricsError> {
    let networks = Networks::default();
    OneFrame::new(&networks).distance(a, b, LpipsVariant { net: LpipsNet::Alex, range: InputRange::Pm1 })
}

fn pattern(width: usize, height: usize, phase: f32) -> Planes {
    let pixel = |i: usize| {
        let (x, y) = ((i % width) as f32, (i / width) as f32);
        [0.13, 0.41, 0.07].map(|f| 0.5 + 0.5 * (x * f + phase).sin() * (y * f * 0.7).cos())
    };
    let image = skinsplat_core::scene::Image::new(width, height, (0..width * height).map(pixel).collect());
    Planes::new(&image.unwrap(), "image").unwrap()
}

#[test]
fn every_thread_count_gives_the_same_bits() {
    let (a, b) = (pattern(157, 71, 0.0), pattern(157, 71, 0.3));
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| embedded_distance(&a, &b).unwrap()).to_bits()
    };
    assert!([2, 3, 8].into_iter().all(|threads| bits(threads) == bits(1)));
}

#[test]
fn kept_features_change_nothing() {
    let networks = Networks::default();
    let truth = pattern(64, 48, 0.0);
    let frame = OneFrame::new(&networks);
    for i in 0..7 {
        let render = pattern(64, 48, 0.1 * (i % 6) as f32);
        let variant = LpipsVariant { net: LpipsNet::Alex, range: InputRange::Pm1 };
        let found = frame.distance(&render, &truth, variant).unwrap();
        assert_eq!(found.to_bits(), embedded_distance(&render, &truth).unwrap().to_bits(), "{i}");
        assert_eq!(found == 0.0, i % 6 == 0, "{i}");
    }
}

#[test]
fn what_cannot_be_computed_is_said() {
    let (small, enough) = (pattern(30, 64, 0.0), pattern(31, 31, 0.0));
    let error = embedded_distance(&small, &small).unwrap_err().to_string();
    assert_eq!(error, "lpips_alex_pm1: the scored image has 30x64 pixels; expected at least 31x31");
    assert_eq!(embedded_distance(&enough, &enough), Ok(0.0));
    assert!(matches!(embedded_distance(&small, &enough), Err(MetricsError::SizeMismatch { .. })));
    let networks = Networks::default();
    let vgg = LpipsVariant { net: LpipsNet::Vgg, range: InputRange::Raw01 };
    let error = OneFrame::new(&networks).distance(&enough, &enough, vgg).unwrap_err().to_string();
    assert_eq!(error, "lpips: no weights for vgg; expected --lpips-weights FILE with the vgg network");
}
