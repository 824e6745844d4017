//! The shader on whatever adapter there is, against `f64` and against reference values. Without an adapter these tests say that
//! they were skipped, unless `SKINSPLAT_NEEDS_ADAPTER` is set.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]
#![allow(clippy::print_stdout, reason = "says what was skipped, and what was measured")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use serde_json::Value;
use skinsplat_core::math::rotation::{self, angle_between};
use skinsplat_core::math::{Quaternion, dot4};
use skinsplat_shader::batch::{Batch, COEFFICIENTS, Gaussian, Posed};
use skinsplat_shader::errors::{self, Row};
use skinsplat_shader::gpu::{Gpu, GpuError, Skinning};
use skinsplat_shader::{Rotation, cases, reference};
use std::sync::OnceLock;

/// The adapter, opened once. `None`: there is none, and that is allowed.
fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| match Gpu::open(None) {
        Ok(gpu) => Some(gpu),
        Err(GpuError::NoAdapter) if std::env::var_os("SKINSPLAT_NEEDS_ADAPTER").is_none() => None,
        Err(error) => panic!("{error}"),
    });
    if gpu.is_none() {
        println!("skipped: no adapter");
    }
    gpu.as_ref()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().unwrap()
}

fn single<const N: usize>(value: &Value) -> [f32; N] {
    array(value).map(|c| c as f32)
}

/// A unit quaternion as an engine has it; zero ones, which bones without a weight may have, are none.
fn unit(value: &Value) -> Quaternion<f32> {
    rotation::normalize(array(value)).map_or([1.0, 0.0, 0.0, 0.0], |q| q.map(|c| c as f32))
}

fn sh(value: &Value) -> [[f32; 3]; COEFFICIENTS] {
    let flat: [f64; 48] = array(value);
    std::array::from_fn(|k| [0, 1, 2].map(|c| flat[3 * k + c] as f32))
}

const PLAIN: Gaussian =
    Gaussian { mean: [0.1, -0.2, 0.3], rotation: [1.0, 0.0, 0.0, 0.0], scale: [0.03, 0.02, 0.01] };

fn assert_close(found: &[f32], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (f, e) in found.iter().zip(expected) {
        assert!((f64::from(*f) - e).abs() <= tolerance, "{what}: {found:?} instead of {expected:?}");
    }
}

/// What each class may be off by: rounding, magnified by no more than one over what classes it, where that
/// is no sign.
fn check(row: &Row) {
    // Below the smallest bound f32 cannot tell two eigenvalues apart, or a side.
    if row.from == 0.0 {
        return;
    }
    let [mean, rotation, covariance, view, sh, colour] = row.spreads;
    let (factor, rotation_bound): (f64, f64) = match row.rotation {
        Rotation::TwoBones => (1.0 / row.from, 8e-6),
        Rotation::ClosedForm => (1.0 / row.from, 2.5e-5),
        Rotation::Power => (1.0 / row.from, 5e-5),
        _ => (1.0, 4e-5),
    };
    let what = format!("{} {}", row.rotation.name(), row.class);
    assert!(mean.max < 1.5e-6, "{what}: mean {mean:?}");
    let radians = rotation_bound.max(4e-5 / factor).to_radians() * factor;
    assert!(rotation.max.to_radians() < radians, "{what}: rotation {rotation:?}");
    assert!(view.max.to_radians() < radians + 1e-6, "{what}: view {view:?}");
    assert!(covariance.max < 4.0 * radians + 3e-6, "{what}: covariance {covariance:?}");
    assert!(sh.max < 4.0 * radians + 2e-6, "{what}: SH {sh:?}");
    assert!(colour.max < 4.0 * radians + 3e-6, "{what}: colour {colour:?}");
}

#[test]
fn random_blends_are_f64_to_rounding() {
    let Some(gpu) = gpu() else { return };
    let skinning = Skinning::new(gpu).unwrap();
    for (sets, count) in [(1, 100_000), (2, 10_000)] {
        let batch = cases::blends(count, sets, 3 + sets as u64);
        for choice in Rotation::ALL {
            let posed = skinning.pose(&batch, choice).unwrap();
            let rows = errors::measure(&batch, &posed, choice);
            println!("{}: {} influences\n{}", gpu.name, 4 * sets, errors::markdown(&rows));
            assert_eq!(rows.iter().map(|row| row.count).sum::<usize>(), count);
            rows.iter().for_each(check);
        }
    }
}

/// Where the average is a choice, the shader's is one of the averages: it loses nothing of the maximum.
#[test]
fn close_eigenvalues_lose_nothing_of_the_maximum() {
    let Some(gpu) = gpu() else { return };
    let batch = cases::blends(12_000, 1, 8);
    let posed = Skinning::new(gpu).unwrap().pose(&batch, Rotation::ClosedForm).unwrap();
    let mut worst = 0.0_f64;
    for i in 0..batch.len() {
        let best = reference::answer(&batch, i, Rotation::ClosedForm).relative;
        worst = worst
            .max(1.0 - rayleigh(&batch, i, posed.relatives[i].map(f64::from)) / rayleigh(&batch, i, best));
    }
    println!("{}: at most {worst:.1e} of the maximum is lost", gpu.name);
    assert!(worst < 4e-6, "{worst:e}");
}

/// qᵀ A q of Eq. 7.
fn rayleigh(batch: &Batch, i: usize, q: Quaternion<f64>) -> f64 {
    let of_bone = |(joint, weight): (usize, f32)| {
        let own = rotation::normalize(batch.joints[joint].0.map(f64::from)).unwrap();
        f64::from(weight.max(0.0)) * dot4(own, q).powi(2)
    };
    batch.influences(i).map(of_bone).sum::<f64>() / dot4(q, q)
}

#[test]
fn reference_averages() {
    let Some(gpu) = gpu() else { return };
    let files = ["rotation/random.json", "rotation/extreme.json"].map(support::json);
    let values: Vec<&Value> = files.iter().flat_map(|file| file.as_array().unwrap()).collect();
    assert_eq!(values.len(), 508);
    // Up to 55 joints: fourteen sets.
    let mut batch = Batch { influence_sets: 14, ..Batch::new([0.0, 0.0, -3.0]) };
    for value in &values {
        let bones: Vec<_> =
            value["quats_wxyz"].as_array().unwrap().iter().map(|q| (unit(q), [0.0; 3])).collect();
        let weights = numbers(&value["weights"]);
        let total: f64 = weights.iter().sum();
        let weights: Vec<f32> = weights.iter().map(|w| (w / total) as f32).collect();
        batch.push(PLAIN, &bones, &weights, [[0.0; 3]; COEFFICIENTS]);
    }
    let skinning = Skinning::new(gpu).unwrap();
    let exact = skinning.pose(&batch, Rotation::ClosedForm).unwrap();
    let summed = skinning.pose(&batch, Rotation::AlignedSum).unwrap();
    let (mut angles, mut sums) = (0, 0);
    for (i, value) in values.iter().enumerate() {
        let found = exact.relatives[i].map(f64::from);
        let name = &value["name"];
        let best = numbers(&value["eigenvalues_desc"])[0] / numbers(&value["weights"]).iter().sum::<f64>();
        let lost = 1.0 - rayleigh(&batch, i, found) / best;
        assert!(lost < 4e-6, "{name}: {lost:e} of the maximum is lost");
        // Degenerate ones have none.
        if let Some(tolerance) = value["suggested_tol_f32_rad"].as_f64().filter(|&angle| angle < 0.1) {
            let angle = angle_between(found, array(&value["markley_wxyz"]));
            assert!(angle <= tolerance, "{name}: {angle:e} rad, tolerance {tolerance:e}");
            angles += 1;
        }
        if reference::surest_side(&batch, i) > 1e-5 {
            let angle = angle_between(summed.relatives[i].map(f64::from), array(&value["nlerp_maxw_wxyz"]));
            assert!(angle < 2e-5, "{name}: aligned sum off by {angle:e} rad");
            sums += 1;
        }
    }
    println!("{}: {angles} averages and {sums} sums of 508", gpu.name);
    assert!(angles > 440 && sums > 440, "{angles} averages, {sums} sums");
}

#[test]
fn reference_power_steps() {
    let Some(gpu) = gpu() else { return };
    let skinning = Skinning::new(gpu).unwrap();
    let file = support::json("power_iteration/cases.json");
    let mut checked = 0;
    for case in file.as_array().unwrap().iter().filter(|case| case["init_name"] == "max-weight bone") {
        let bones: Vec<_> =
            case["quats_wxyz"].as_array().unwrap().iter().map(|q| (unit(q), [0.0; 3])).collect();
        let weights: Vec<f32> = numbers(&case["weights"]).iter().map(|&w| w as f32).collect();
        for (steps, iterate) in case["iterates"].as_object().unwrap() {
            let mut batch =
                Batch { influence_sets: 2, power_steps: steps.parse().unwrap(), ..Batch::new([0.0; 3]) };
            batch.push(PLAIN, &bones, &weights, [[0.0; 3]; COEFFICIENTS]);
            let found = skinning.pose(&batch, Rotation::Power).unwrap().relatives[0].map(f64::from);
            let angle = angle_between(found, array(iterate));
            assert!(angle < 5e-6, "{steps} steps: {angle:e} rad");
            checked += 1;
        }
    }
    assert!(checked >= 25, "{checked} iterates");
}

#[test]
fn reference_turns_of_sh() {
    let Some(gpu) = gpu() else { return };
    let file = support::json("sh/sh_rotation.json");
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 46);
    let mut batch = Batch::new([0.0, 0.0, -3.0]);
    for case in cases {
        batch.push(PLAIN, &[(unit(&case["quat_wxyz"]), [0.0; 3])], &[1.0], sh(&case["sh_16x3"]));
    }
    let posed = Skinning::new(gpu).unwrap().pose(&batch, Rotation::ClosedForm).unwrap();
    for (turned, case) in posed.turned_sh.iter().zip(cases) {
        let expected = numbers(&case["sh_rotated_16x3"]);
        assert_close(turned.as_flattened(), &expected, 4e-6, case["name"].as_str().unwrap());
    }
}

/// Eq. 6 to 9 end to end. Inputs are rounded to f32, which moves the average by as much over its gap.
#[test]
fn reference_gaussians_end_to_end() {
    let Some(gpu) = gpu() else { return };
    let skinning = Skinning::new(gpu).unwrap();
    let file = support::json("gs_math/skinned_end_to_end.json");
    let cases = file.as_array().unwrap();
    assert_eq!(cases.len(), 30);
    for case in cases {
        let mut batch = Batch::new(single(&case["cam_pos"]));
        let rotations = case["bone_quats_wxyz"].as_array().unwrap().iter().map(unit);
        let translations = case["bone_trans"].as_array().unwrap().iter().map(single);
        let bones: Vec<_> = rotations.zip(translations).collect();
        let weights: Vec<f32> = numbers(&case["weights"]).iter().map(|&w| w as f32).collect();
        batch.influence_sets = bones.len().div_ceil(4);
        let scale: [f32; 3] = single(&case["scale"]);
        let gaussian = Gaussian { mean: single(&case["mean"]), rotation: unit(&case["quat_wxyz"]), scale };
        batch.push(gaussian, &bones, &weights, sh(&case["sh_16x3"]));
        let posed = skinning.pose(&batch, Rotation::ClosedForm).unwrap();
        check_end_to_end(&posed, case, f64::from(scale.into_iter().fold(0.0, f32::max)));
        let summed = skinning.pose(&batch, Rotation::AlignedSum).unwrap();
        check_covariance(
            &summed,
            &case["variants"]["cov_nlerp"],
            1e-5,
            f64::from(scale[0].max(scale[1]).max(scale[2])),
        );
    }
}

fn check_end_to_end(posed: &Posed, case: &Value, largest_scale: f64) {
    let tolerance = 2e-6_f64.max(6e-7 / case["eig_gap"].as_f64().unwrap());
    assert_close(&posed.means[0], &numbers(&case["posed_mean_eq6"]), 1e-6, "posed_mean_eq6");
    for (found, field) in [(posed.relatives[0], "blended_quat_eq7"), (posed.quaternions[0], "posed_quat_eq8")]
    {
        let angle = angle_between(found.map(f64::from), array(&case[field]));
        assert!(angle < 4.0 * tolerance, "{field}: {angle:e} rad");
    }
    check_covariance(posed, &case["cov_markley"], 4.0 * tolerance, largest_scale);
    let sh = numbers(&case["posed_sh_eq9_16x3"]);
    let largest = sh.iter().fold(1.0_f64, |m, c| m.max(c.abs()));
    assert_close(posed.turned_sh[0].as_flattened(), &sh, 6.0 * largest * tolerance, "posed_sh_eq9_16x3");
    assert_close(
        &posed.colours[0],
        &numbers(&case["rgb_skinned"]),
        24.0 * largest * tolerance,
        "rgb_skinned",
    );
}

fn check_covariance(posed: &Posed, expected: &Value, tolerance: f64, largest_scale: f64) {
    let e = numbers(expected);
    let upper = if e.len() == 6 { e } else { vec![e[0], e[1], e[2], e[4], e[5], e[8]] };
    assert_close(&posed.covariances[0], &upper, tolerance * largest_scale.powi(2), "covariance");
}
