//! Spherical harmonics against reference values: `fixtures/sh`, `fixtures/goldens`.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;
#[path = "../../../tests/support/values.rs"]
mod values;

use serde_json::Value;
use skinsplat_core::math::{Real, matrix3, sh};
use support::json;
use values::{difference, matrix, numbers};

fn triples<T: Real>(value: &Value) -> Vec<[T; 3]> {
    numbers(value).chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(T::from_f64)).collect()
}

fn band_errors<T: Real>(rotation: &sh::Rotation<T>, case: &Value) -> f64 {
    let d1 = difference(rotation.matrix::<3>().into_iter().flatten(), &case["D1"]);
    let d2 = difference(rotation.matrix::<5>().into_iter().flatten(), &case["D2"]);
    let d3 = difference(rotation.matrix::<7>().into_iter().flatten(), &case["D3"]);
    d1.max(d2).max(d3)
}

/// Worst errors of (D1..D3, rotated coefficients, evaluations) over the rotation cases.
fn rotation_errors<T: Real>() -> [f64; 3] {
    let file = json("sh/sh_rotation.json");
    let cases = file["cases"].as_array().unwrap();
    let mut worst_errors = [0.0_f64; 3];
    let mut count = 0;
    for case in cases {
        let rotation = sh::Rotation::<T>::new(matrix(&case["rotmat"]), 3);
        let canonical = triples::<T>(&case["sh_16x3"]);
        let mut rotated = canonical.clone();
        rotation.apply(&mut rotated);
        let evaluate = |coefficients: &[[T; 3]], turned: bool| -> Vec<T> {
            let dirs = triples::<T>(&case["dirs"]);
            let dir = |d: [T; 3]| if turned { matrix3::apply(matrix(&case["rotmat"]), d) } else { d };
            dirs.into_iter().flat_map(|d| sh::evaluate(3, coefficients, dir(d))).collect()
        };
        let errors = [
            band_errors(&rotation, case),
            difference(rotated.iter().copied().flatten(), &case["sh_rotated_16x3"]),
            difference(evaluate(&canonical, false), &case["eval_canonical_dirs"])
                .max(difference(evaluate(&rotated, true), &case["eval_rotated_at_R_dirs"]))
                .max(difference(evaluate(&canonical, true), &case["eval_unrotated_sh_at_R_dirs"])),
        ];
        for (total, error) in worst_errors.iter_mut().zip(errors) {
            *total = total.max(error);
        }
        count += 1;
    }
    assert_eq!(count, 46, "cases in sh_rotation.json");
    worst_errors
}

#[test]
fn rotation_in_f64() {
    let errors = rotation_errors::<f64>();
    println!(
        "sh rotation f64: D {:.2e}, coefficients {:.2e}, evaluations {:.2e}",
        errors[0], errors[1], errors[2]
    );
    // Coefficients are of size 3 and rows of D of length 1: some ten roundings each.
    assert!(errors[0] < 4e-15 && errors[1] < 1e-14 && errors[2] < 2e-14, "{errors:?}");
}

#[test]
fn rotation_in_f32() {
    let errors = rotation_errors::<f32>();
    println!(
        "sh rotation f32: D {:.2e}, coefficients {:.2e}, evaluations {:.2e}",
        errors[0], errors[1], errors[2]
    );
    assert!(errors[0] < 2e-6 && errors[1] < 4e-6 && errors[2] < 8e-6, "{errors:?}");
}

fn basis_error<T: Real>() -> f64 {
    let file = json("sh/sh_basis.json");
    let dirs = triples::<T>(&file["dirs"]);
    assert_eq!(dirs.len(), 36, "directions in sh_basis.json");
    let full = difference(dirs.iter().flat_map(|&d| sh::basis(3, d)), &file["basis_n_x16"]);
    for &dir in &dirs {
        let all = sh::basis(3, dir);
        for degree in 0..3 {
            let part = sh::basis(degree, dir);
            let (low, high) = part.split_at(sh::count(degree));
            assert!(low == &all[..low.len()] && high.iter().all(|&b| b == T::ZERO));
        }
    }
    full
}

#[test]
fn basis() {
    let (f64_error, f32_error) = (basis_error::<f64>(), basis_error::<f32>());
    println!("sh basis: f64 {f64_error:.2e}, f32 {f32_error:.2e}");
    assert!(f64_error < 2e-15 && f32_error < 1e-6);
}

#[test]
fn golden_rotation() {
    let file = json("goldens/goldens.json");
    let golden = &file["sh_rot"];
    let rotation = sh::Rotation::<f64>::new(matrix(&golden["R"]), 3);
    // The golden was solved by least squares: its own D1 is about 1e-14 from P1 R P1ᵀ.
    assert!(band_errors(&rotation, golden) < 3e-14);
    let mut coefficients: Vec<[f64; 3]> =
        numbers(&golden["coeffs_in"]).into_iter().map(|c| [c, -c, 2.0 * c]).collect();
    rotation.apply(&mut coefficients);
    for (channel, factor) in [1.0, -1.0, 2.0].into_iter().enumerate() {
        let found = coefficients.iter().map(|c| c[channel] / factor);
        assert!(difference(found, &golden["coeffs_out"]) < 5e-14);
    }
}
