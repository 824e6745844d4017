//! Power iteration and whole worked examples against reference values: `fixtures/power_iteration`, `fixtures/goldens`.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]
#![expect(clippy::print_stdout, reason = "reports the worst errors under --nocapture")]

#[path = "../../../tests/support/mod.rs"]
mod support;
#[path = "../../../tests/support/values.rs"]
mod values;

use serde_json::Value;
use skinsplat_core::math::average::{self, Solver, Start, average, average_rotation};
use skinsplat_core::math::rotation::{self, angle_between, quaternion_to_matrix};
use skinsplat_core::math::{Matrix3, Quaternion, Real, matrix3};
use std::collections::BTreeMap;
use support::json;
use values::{difference, dot, matrix, numbers, quaternion};

/// The exact solvers: they answer Eq. 7 to rounding.
const EXACT: [Solver; 3] = [Solver::ClosedForm, Solver::Eigen, Solver::Polar];

/// The iterates of `fixtures/power_iteration`, by start vector.
fn power_iteration<T: Real>(precision: &str) {
    let file = json("power_iteration/cases.json");
    let cases = file.as_array().unwrap();
    let mut counts = BTreeMap::new();
    let mut worst = 0.0_f64;
    for case in cases {
        let quats: Vec<Quaternion<T>> =
            case["quats_wxyz"].as_array().unwrap().iter().map(quaternion).collect();
        let weights: Vec<T> = numbers(&case["weights"]).into_iter().map(T::from_f64).collect();
        let start = match case["init_name"].as_str().unwrap() {
            "max-weight bone" => Start::Heaviest,
            "nlerp" => Start::Nlerp,
            "ones/2" => Start::Ones,
            "column of A with largest diagonal" => Start::LargestColumn,
            "identity (1,0,0,0)" => Start::Identity,
            "first bone" => Start::First,
            other => panic!("start {other}"),
        };
        let a = numbers(&case["A"]);
        let a = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| T::from_f64(a[4 * i + j])));
        for (steps, iterate) in case["iterates"].as_object().unwrap() {
            let steps: u32 = steps.parse().unwrap();
            // Rounding moves an iterate by a few ulp and, where the start is nearly orthogonal to the answer, by as much
            // more as the iteration then amplifies.
            let along = dot(quaternion(&case["init_wxyz"]), quaternion(&case["exact_wxyz"])).abs();
            let tolerance = 8.0 * T::EPSILON.to_f64() / along.clamp(1e-3, 1.0);
            let iterate_of = average::power_iterate(a, quaternion(&case["init_wxyz"]), steps);
            let error = difference(iterate_of, iterate);
            assert!(error < tolerance, "{start:?} {steps} {precision}: {error:e}, tolerance {tolerance:e}");
            let solver = Solver::Power { steps, start };
            let quat = average_rotation(&quats, &weights, solver).unwrap();
            let angle = angle_between(quat.map(Real::to_f64), quaternion::<f64>(iterate));
            assert!(angle < 4.0 * tolerance, "{solver} {precision}: {angle:e}, tolerance {tolerance:e}");
            worst = worst.max(angle);
            *counts.entry(steps).or_insert(0) += 1;
        }
    }
    assert_eq!(cases.len(), 36, "cases in power_iteration/cases.json");
    assert_eq!(counts, BTreeMap::from([1, 2, 5, 15, 100].map(|steps| (steps, 36))));
    println!("power iteration {precision}: worst {worst:.2e} rad off the reference's iterate");
}

#[test]
fn power_iteration_by_start() {
    power_iteration::<f64>("f64");
    power_iteration::<f32>("f32");
}

/// The paper's 15 steps: the error against the exact answer is the one that the reference measured.
#[test]
fn fifteen_steps_fall_short_as_measured() {
    let file = json("power_iteration/cases.json");
    for case in file.as_array().unwrap() {
        let exact = quaternion::<f64>(&case["exact_wxyz"]);
        let a = numbers(&case["A"]);
        let a = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| a[4 * i + j]));
        let iterate = average::power_iterate(a, quaternion(&case["init_wxyz"]), 15);
        let measured = case["err15_rad"].as_f64().unwrap();
        let (error, bound) = (angle_between(iterate, exact), case["bound15_rad"].as_f64().unwrap());
        assert!((error - measured).abs() < 1e-14 + 1e-6 * measured, "{error:e} {measured:e}");
        assert!(error <= bound + 1e-14);
    }
}

fn half_angle_z(q: Quaternion<f64>) -> f64 {
    2.0 * q[3].abs().atan2(q[0].abs()).to_degrees()
}

/// `goldens.json`: two bones about z, 50/50, and a three-bone blend.
#[test]
fn goldens() {
    let file = json("goldens/goldens.json");
    let rows = file["two_bone_z_5050"].as_array().unwrap();
    assert_eq!(rows.len(), 8, "rows of two_bone_z_5050");
    for row in rows {
        let degrees = row["theta"].as_f64().unwrap();
        let half = degrees.to_radians() / 2.0;
        let quats = [[1.0, 0.0, 0.0, 0.0], [half.cos(), 0.0, 0.0, half.sin()]];
        let weights = [0.5, 0.5];
        let number = |field: &str| row[field].as_f64().unwrap();
        for solver in EXACT {
            let quat = average_rotation(&quats, &weights, solver).unwrap();
            // The golden came from a solver in doubles: good to rounding over the gap cos(theta/2).
            let tolerance = 1e-13 / half.cos();
            assert!((half_angle_z(quat) - number("avg_angle")).abs() < tolerance, "{solver} {degrees}");
            assert!((half_angle_z(quat) - number("polar_angle")).abs() < tolerance, "{solver} {degrees}");
            assert!((half_angle_z(quat) - degrees / 2.0).abs() < tolerance, "{solver} {degrees}");
        }
        let power = Solver::Power { steps: 15, start: Start::Identity };
        let power = average_rotation(&quats, &weights, power).unwrap();
        assert!((half_angle_z(power) - number("power15_angle")).abs() < 1e-12, "{degrees}");
        let matrices = quats.map(quaternion_to_matrix);
        let blend = [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (matrices[0][i][j] + matrices[1][i][j])));
        let hugs = rotation::matrix_to_quaternion_raw(blend);
        assert!(difference(hugs, &row["hugs_q"]) < 4e-16, "{degrees}");
        assert!((half_angle_z(hugs) - number("hugs_angle_if_normalised")).abs() < 1e-13, "{degrees}");
        let drawn = rotation::quaternion_to_matrix_raw(hugs);
        let scale = drawn[0][0].hypot(drawn[1][0]);
        assert!((scale - number("hugs_inplane_scale")).abs() < 4e-16, "{degrees}");
        let nearest = rotation::polar(drawn).unwrap();
        assert!((half_angle_z(nearest) - number("hugs_angle_rasterised")).abs() < 1e-13, "{degrees}");
        assert!((blend[0][0].hypot(blend[1][0]) - number("lbs_inplane_scale")).abs() < 4e-16, "{degrees}");
    }
    three_bone_golden(&file["three_bone"], &file["viewdir"]);
}

fn three_bone_golden(golden: &Value, view: &Value) {
    let bones: Vec<Matrix3<f64>> = golden["bones"].as_array().unwrap().iter().map(matrix).collect();
    let weights = numbers(&golden["w"]);
    let quats: Vec<_> = bones.iter().map(|&bone| rotation::matrix_to_quaternion(bone)).collect();
    let blend = matrix::<f64>(&golden["blend"]);
    let close = |found: Matrix3<f64>, field: &str| {
        let error = difference(found.into_iter().flatten(), &golden[field]);
        assert!(error < 4e-15, "{field}: {error:e}");
    };
    close(
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| weights[k] * bones[k][i][j]).sum::<f64>())),
        "blend",
    );
    close(rotation::gram_schmidt_columns(blend).unwrap(), "gs_cols");
    close(rotation::gram_schmidt_rows(blend).unwrap(), "gs_rows");
    close(quaternion_to_matrix(rotation::polar(blend).unwrap()), "polar");
    let rest = matrix::<f64>(&golden["Rc"]);
    let hugs = rotation::matrix_to_quaternion_raw(matrix3::multiply(blend, rest));
    assert!(difference(hugs, &golden["hugs_q"]) < 1e-15);
    close(rotation::quaternion_to_matrix_raw(hugs), "hugs_R");
    for solver in EXACT {
        let average = average(&quats, &weights, solver).unwrap();
        assert!(angle_between(average.quat, quaternion(&golden["markley_q"])) < 4e-15, "{solver}");
        let eigenvalues = numbers(&golden["eig"]);
        assert!((average.gap - (1.0 - eigenvalues[2] / eigenvalues[3])).abs() < 1e-14, "{solver}");
        let skinned = rotation::multiply(average.quat, rotation::matrix_to_quaternion(rest));
        assert!(angle_between(skinned, quaternion(&golden["skinned_q"])) < 4e-15, "{solver}");
    }
    let direction: [f64; 3] = numbers(&view["d"]).try_into().unwrap();
    let canonical = |m: Matrix3<f64>| {
        let v = matrix3::apply(matrix3::transpose(m), direction);
        v.map(|c| c / matrix3::dot(v, v).sqrt())
    };
    assert!(difference(canonical(blend), &view["BTd"]) < 4e-15);
    let average = average_rotation(&quats, &weights, Solver::ClosedForm).unwrap();
    assert!(difference(canonical(quaternion_to_matrix(average)), &view["RTd"]) < 4e-15);
}
