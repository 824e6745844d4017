//! Rotation averaging and projections against reference values: `fixtures/rotation`. Every exact solver in both
//! precisions; every case is counted.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]
#![expect(clippy::print_stdout, reason = "reports the worst errors under --nocapture")]

#[path = "../../../tests/support/mod.rs"]
mod support;
#[path = "../../../tests/support/values.rs"]
mod values;

use serde_json::Value;
use skinsplat_core::math::average::{Solver, average, average_rotation, lanes};
use skinsplat_core::math::rotation::{self, angle_between, quaternion_to_matrix};
use skinsplat_core::math::{Matrix3, Quaternion, Real, matrix3};
use std::collections::BTreeMap;
use support::json;
use values::{difference, dot, matrix, numbers, quaternion};

/// The exact solvers: they answer Eq. 7 to rounding.
const EXACT: [Solver; 3] = [Solver::ClosedForm, Solver::Eigen, Solver::Polar];

/// The reference values hold the angle to the answer only where the problem is at least this well determined; below,
/// the reference set asks for the Rayleigh quotient instead.
const ANGLE_GAP: f64 = 1e-8;

/// One problem of `fixtures/rotation`, in both precisions.
struct Case {
    name: String,
    value: Value,
    quats: Vec<Quaternion<f64>>,
    weights: Vec<f64>,
}

impl Case {
    fn new(value: &Value) -> Self {
        let quats = value["quats_wxyz"].as_array().unwrap().iter().map(quaternion).collect();
        let name = value["name"].as_str().unwrap().to_owned();
        Self { name, value: value.clone(), quats, weights: numbers(&value["weights"]) }
    }

    fn number(&self, field: &str) -> f64 {
        self.value[field].as_f64().unwrap_or_else(|| panic!("{}: {field}", self.name))
    }

    fn is_degenerate(&self) -> bool {
        self.value["degenerate"].as_bool().unwrap()
    }

    fn total_weight(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// The bones in the precision `T`. Weights are divided by their sum where `f32` cannot hold them (1e-160, 1e90).
    fn bones<T: Real>(&self) -> (Vec<Quaternion<T>>, Vec<T>) {
        let total = self.total_weight();
        let held = (1e-30..1e30).contains(&total) || T::EPSILON.to_f64() < 1e-10;
        let scale = if held { 1.0 } else { total };
        let quats = self.quats.iter().map(|q| q.map(T::from_f64)).collect();
        (quats, self.weights.iter().map(|w| T::from_f64(w / scale)).collect())
    }

    /// The reference blend over the total weight, in the precision `T`.
    fn blend<T: Real>(&self) -> Matrix3<T> {
        let total = self.total_weight();
        matrix::<f64>(&self.value["lbs"]).map(|row| row.map(|c| T::from_f64(c / total)))
    }

    /// qᵀ A q / λ1 with A = Σ w q qᵀ in f64.
    fn rayleigh(&self, quat: Quaternion<f64>) -> f64 {
        let terms = self.quats.iter().zip(&self.weights);
        let value: f64 = terms.map(|(&q, w)| w * dot(q, quat).powi(2) / dot(q, q)).sum();
        value / dot(quat, quat) / self.eigenvalues()[0]
    }

    fn eigenvalues(&self) -> Vec<f64> {
        numbers(&self.value["eigenvalues_desc"])
    }

    /// The angle tolerance that the reference suggests.
    fn tolerance<T: Real>(&self) -> f64 {
        let double = T::EPSILON.to_f64() < 1e-10;
        self.number(if double { "suggested_tol_f64_rad" } else { "suggested_tol_f32_rad" })
    }
}

fn cases() -> Vec<Case> {
    let counted = |file: &str, expected: usize| {
        let value = json(file);
        let cases: Vec<Case> = value.as_array().unwrap().iter().map(Case::new).collect();
        assert_eq!(cases.len(), expected, "cases in {file}");
        cases
    };
    let mut all = counted("rotation/random.json", 384);
    all.extend(counted("rotation/extreme.json", 124));
    all
}

/// The angle, and the share of the tolerance that it uses.
#[derive(Clone, Copy, Default)]
struct Worst {
    angle: f64,
    share: f64,
}

impl Worst {
    fn add(&mut self, angle: f64, tolerance: f64) {
        // An angle cannot tell more than a right answer where the tolerance is a whole turn.
        if tolerance < 1.0 {
            self.angle = self.angle.max(angle);
            self.share = self.share.max(angle / tolerance);
        }
    }
}

/// Checks one answer to Eq. 7 and reports which check applied.
fn check_average<T: Real>(case: &Case, quat: Quaternion<T>, worst: &mut Worst, what: &str) -> &'static str {
    let quat = quat.map(Real::to_f64);
    let length = quat.iter().map(|c| c * c).sum::<f64>().sqrt();
    assert!((length - 1.0).abs() < 4.0 * T::EPSILON.to_f64(), "{}: {what}: length {length}", case.name);
    // A Rayleigh quotient is second order in the angle: it loses the tie tolerance at most, and rounding.
    let rounding = if T::EPSILON.to_f64() < 1e-10 { 1e-14 } else { 24.0 * T::EPSILON.to_f64() };
    let rayleigh = case.rayleigh(quat);
    assert!(rayleigh >= 1.0 - rounding, "{}: {what}: Rayleigh 1 - {:e}", case.name, 1.0 - rayleigh);
    if case.is_degenerate() {
        let basis = case.value["top_eigenspace_basis_wxyz"].as_array().unwrap();
        let along = |axis: &Value| (0..4).map(|k| quat[k] * quaternion::<f64>(axis)[k]).sum::<f64>();
        let inside = basis.iter().map(|axis| along(axis).powi(2)).sum::<f64>();
        assert!((inside - 1.0).abs() < 8.0 * T::EPSILON.to_f64(), "{}: {what}: {inside}", case.name);
        return "eigenspace";
    }
    if case.number("gap_rel") < ANGLE_GAP {
        return "rayleigh";
    }
    let expected = quaternion::<f64>(&case.value["markley_wxyz"]);
    let (angle, tolerance) = (angle_between(quat, expected), case.tolerance::<T>());
    assert!(angle <= tolerance, "{}: {what}: {angle:e} rad, tolerance {tolerance:e}", case.name);
    worst.add(angle, tolerance);
    // The sign rule, where rounding cannot choose another largest component.
    let mut sizes = expected.map(f64::abs);
    sizes.sort_by(f64::total_cmp);
    if sizes[3] - sizes[2] > 2.0 * tolerance {
        let aligned: f64 = quat.iter().zip(&expected).map(|(a, b)| a * b).sum();
        assert!(aligned > 0.0, "{}: {what}: sign", case.name);
    }
    "angle"
}

fn exact_solvers<T: Real>(precision: &str) {
    let cases = cases();
    for solver in EXACT {
        let mut worst = Worst::default();
        let mut checks = BTreeMap::new();
        for case in &cases {
            let (quats, weights) = case.bones::<T>();
            let answer = average(&quats, &weights, solver).unwrap();
            assert_eq!(average_rotation(&quats, &weights, solver), Some(answer.quat));
            let check = check_average(case, answer.quat, &mut worst, &format!("{solver} {precision}"));
            *checks.entry(check).or_insert(0) += 1;
            let gap = case.number("gap_rel");
            let error = (answer.gap.to_f64() - gap).abs();
            assert!(error < 8.0 * T::EPSILON.to_f64(), "{}: gap {} for {gap}", case.name, answer.gap);
            if !(1e-1..1e2).contains(&(gap / (16.0 * T::EPSILON.to_f64()))) {
                assert_eq!(answer.unique, gap > 16.0 * T::EPSILON.to_f64(), "{}: unique", case.name);
            }
        }
        assert_eq!(checks.values().sum::<usize>(), 508);
        // The suggested tolerance is 32 eps / gap; a sound solver stays far below.
        assert!(worst.share < 0.2, "{solver} {precision}: {:.3} of tolerance", worst.share);
        println!(
            "{solver} {precision}: worst {:.2e} rad, {:.3} of tolerance, {checks:?}",
            worst.angle, worst.share
        );
    }
}

#[test]
fn exact_solvers_in_f64() {
    exact_solvers::<f64>("f64");
}

#[test]
fn exact_solvers_in_f32() {
    exact_solvers::<f32>("f32");
}

/// `polar` of the reference's own blend is the reference's average, wherever the blend still determines it.
fn polar_of_reference_blend<T: Real>(precision: &str) {
    let mut worst = Worst::default();
    let mut checks = BTreeMap::new();
    for case in cases() {
        let quat = rotation::polar(case.blend::<T>()).unwrap();
        let check = check_average(&case, signed(quat), &mut worst, &format!("polar of lbs, {precision}"));
        *checks.entry(check).or_insert(0) += 1;
        assert!(case.number_or_zero("polar_so3_minus_markley_fro_50digits") < 1e-20, "{}", case.name);
    }
    assert_eq!(checks.values().sum::<usize>(), 508);
    println!(
        "polar of lbs {precision}: worst {:.2e} rad, {:.3} of tolerance, {checks:?}",
        worst.angle, worst.share
    );
}

impl Case {
    fn number_or_zero(&self, field: &str) -> f64 {
        if self.is_degenerate() { 0.0 } else { self.number(field) }
    }
}

fn signed<T: Real>(q: Quaternion<T>) -> Quaternion<T> {
    rotation::SignPolicy::LargestPositive.apply(q, q)
}

#[test]
fn polar_of_the_reference_blend() {
    polar_of_reference_blend::<f64>("f64");
    polar_of_reference_blend::<f32>("f32");
}

/// Gram-Schmidt, PyTorch3D's conversion, the rotation matrix of the average and nlerp.
fn projections<T: Real>(precision: &str, expected_ill_posed: usize) {
    let epsilon = T::EPSILON.to_f64();
    let mut worst =
        BTreeMap::from([("columns", 0.0_f64), ("rows", 0.0), ("raw", 0.0), ("nlerp", 0.0), ("matrix", 0.0)]);
    let mut ill_posed = 0;
    for case in cases() {
        let blend = case.blend::<T>();
        let mut note = |what: &'static str, error: f64, tolerance: f64| {
            assert!(error <= tolerance, "{} {what} {precision}: {error:e} > {tolerance:e}", case.name);
            let entry = worst.get_mut(what).unwrap();
            *entry = entry.max(error / tolerance);
        };
        for (what, field, found) in [
            ("columns", "gram_schmidt_cols", rotation::gram_schmidt_columns(blend)),
            ("rows", "gram_schmidt_rows", rotation::gram_schmidt_rows(blend)),
        ] {
            // The residual of the second vector says what rounding of the blend does to the answer.
            let residual = residual(&case, what);
            match found {
                Some(found) if !case.value[field].is_null() => {
                    // The reference lost digits of weight_sum_1e-160 to underflow: its matrix is no rotation.
                    let defect = orthogonality_defect(matrix(&case.value[field]));
                    assert!(defect < 1e-15 / residual || case.name == "weight_sum_1e-160", "{}", case.name);
                    let tolerance = 16.0 * epsilon / residual + defect;
                    note(what, difference(found.into_iter().flatten(), &case.value[field]), tolerance);
                }
                Some(_) => assert!(residual < 64.0 * epsilon, "{} {what}: should be ill-posed", case.name),
                None => {
                    let undecided = epsilon > 1e-10 && residual < 1e-4;
                    assert!(case.value[field].is_null() || undecided, "{} {what}: ill-posed", case.name);
                    ill_posed += 1;
                }
            }
        }
        check_raw_conversion::<T>(&case, &mut note);
        let (quats, weights) = case.bones::<T>();
        let nlerp = average_rotation(&quats, &weights, Solver::Nlerp).unwrap().map(Real::to_f64);
        let expected = quaternion::<f64>(&case.value["nlerp_maxw_wxyz"]);
        let nearest = |to: Quaternion<f64>, among: &[Quaternion<f64>]| {
            among.iter().map(|&q| angle_between(q, to)).fold(f64::INFINITY, f64::min)
        };
        let sums = case.nlerp_sums(epsilon);
        assert!(nearest(expected, &sums) < 1e-7, "{}", case.name);
        let angle = if sums.len() == 1 { angle_between(nlerp, expected) } else { nearest(nlerp, &sums) };
        // The sum is at least as long as the heaviest bone's share.
        let heaviest = weights.iter().fold(0.0_f64, |m, w| m.max(w.to_f64()));
        let total: f64 = weights.iter().map(|w| w.to_f64()).sum();
        note("nlerp", angle, 16.0 * epsilon * total / heaviest);
        if !case.is_degenerate() {
            let found = quaternion_to_matrix(quaternion::<T>(&case.value["markley_wxyz"]));
            note(
                "matrix",
                difference(found.into_iter().flatten(), &case.value["markley_rotmat"]),
                8.0 * epsilon,
            );
        }
    }
    assert_eq!(ill_posed, expected_ill_posed);
    println!("projections {precision}: share of tolerance {worst:?}, {ill_posed} ill-posed");
}

/// PyTorch3D's conversion, of the blend as it stands (not divided by the total weight). Where two candidates are equally
/// large up to rounding, either is right.
fn check_raw_conversion<T: Real>(case: &Case, note: &mut impl FnMut(&'static str, f64, f64)) {
    let epsilon = T::EPSILON.to_f64();
    let blend = matrix::<T>(&case.value["lbs"]);
    let raw = rotation::matrix_to_quaternion_raw(blend).map(Real::to_f64);
    if !matrix3::is_finite(blend) {
        // 1e90 does not fit into f32: infinite in, not finite out.
        assert!(case.name == "weight_sum_1e+90" && epsilon > 1e-10 && raw.iter().any(|c| !c.is_finite()));
        return;
    }
    let candidates = raw_candidates(&matrix::<f64>(&case.value["lbs"]));
    let largest = candidates.iter().map(|(size, _)| *size).fold(0.0, f64::max);
    let rivals: Vec<usize> = (0..4).filter(|&i| candidates[i].0 > largest * (1.0 - 8.0 * epsilon)).collect();
    assert!(rivals.contains(&(case.value["p3d_branch"].as_u64().unwrap() as usize)), "{}", case.name);
    if rivals.len() == 1 {
        note(
            "raw",
            difference(raw, &case.value["p3d_matrix_to_quaternion_raw_wxyz"]),
            4.0 * epsilon * largest,
        );
        let norm = raw.iter().map(|c| c * c).sum::<f64>().sqrt();
        note("raw", (norm - case.number("p3d_raw_norm")).abs(), 4.0 * epsilon * largest);
    } else {
        let error = |i: usize| (0..4).map(|k| (raw[k] - candidates[i].1[k]).abs()).fold(0.0, f64::max);
        let error = rivals.into_iter().map(error).fold(f64::INFINITY, f64::min);
        note("raw", error, 4.0 * epsilon * largest);
    }
}

/// (twice the own component, candidate) for w, x, y, z, written from the definition.
fn raw_candidates(m: &Matrix3<f64>) -> [(f64, Quaternion<f64>); 4] {
    let diagonal = [m[0][0], m[1][1], m[2][2]];
    let size = |signs: [f64; 3]| (1.0 + matrix3::dot(signs, diagonal)).max(0.0).sqrt();
    let sizes = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(size);
    let [wx, wy, wz] = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let [xy, xz, yz] = [m[1][0] + m[0][1], m[2][0] + m[0][2], m[2][1] + m[1][2]];
    let [w, x, y, z] = sizes.map(|s| s * s);
    let rows = [[w, wx, wy, wz], [wx, x, xy, xz], [wy, xy, y, yz], [wz, xz, yz, z]];
    [0, 1, 2, 3].map(|i| (sizes[i], rows[i].map(|c| c / (2.0 * sizes[i].max(0.1)))))
}

/// Largest entry of |m mᵀ − I|.
fn orthogonality_defect(m: Matrix3<f64>) -> f64 {
    let product = matrix3::multiply(m, matrix3::transpose(m));
    let identity = matrix3::identity::<f64>();
    product.iter().flatten().zip(identity.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// What is left of the second row or column off the first, over the longest entry.
fn residual(case: &Case, what: &str) -> f64 {
    let m = case.blend::<f64>();
    let m = if what == "columns" { matrix3::transpose(m) } else { m };
    let length = |v: [f64; 3]| matrix3::dot(v, v).sqrt();
    let first = length(m[0]);
    first.min(length(matrix3::cross(m[0], m[1])) / first.max(1e-300))
}

impl Case {
    /// A = Σ w q qᵀ over the total weight, in f64.
    fn outer_sum(&self) -> [[f64; 4]; 4] {
        let mut a = [[0.0; 4]; 4];
        for (q, weight) in self.quats.iter().zip(&self.weights) {
            for (i, j) in (0..16).map(|k| (k / 4, k % 4)) {
                a[i][j] += weight / self.total_weight() * q[i] * q[j] / dot(*q, *q);
            }
        }
        a
    }

    /// Σ w q on the side of the heaviest bone; more than one sum where a bone is so near a right angle (in R⁴) to the
    /// heaviest that rounding chooses its side.
    fn nlerp_sums(&self, epsilon: f64) -> Vec<Quaternion<f64>> {
        let heaviest =
            (0..self.weights.len()).rev().max_by(|&i, &j| self.weights[i].total_cmp(&self.weights[j]));
        let reference = self.quats[heaviest.unwrap()];
        let mut sums = vec![[0.0; 4]];
        for (q, weight) in self.quats.iter().zip(&self.weights) {
            let along: f64 = (0..4).map(|k| q[k] * reference[k]).sum();
            let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
            let term = q.map(|c| c * weight / self.total_weight() / length);
            let moved = |sums: &[Quaternion<f64>], sign: f64| -> Vec<Quaternion<f64>> {
                sums.iter().map(|sum| [0, 1, 2, 3].map(|k| sum[k] + sign * term[k])).collect()
            };
            let other = moved(&sums, -1.0_f64.copysign(along));
            sums = moved(&sums, 1.0_f64.copysign(along));
            if along.abs() < 8.0 * epsilon {
                sums.extend(other);
            }
        }
        sums
    }
}

#[test]
fn projections_in_f64() {
    // 22 cases, columns and rows.
    projections::<f64>("f64", 44);
}

#[test]
fn projections_in_f32() {
    // Seven more have a residual below the floor of f32.
    projections::<f32>("f32", 58);
}

/// Weights that leave the range of f32 have a documented answer: none.
#[test]
fn weights_beyond_f32() {
    let mut none = 0;
    for case in cases() {
        let quats: Vec<Quaternion<f32>> = case.quats.iter().map(|q| q.map(|c| c as f32)).collect();
        let weights: Vec<f32> = case.weights.iter().map(|&w| w as f32).collect();
        let answer = average(&quats, &weights, Solver::ClosedForm);
        assert_eq!(answer.is_none(), !(1e-40..1e38).contains(&case.total_weight()), "{}", case.name);
        none += usize::from(answer.is_none());
    }
    assert_eq!(none, 2, "weight_sum_1e-160 and weight_sum_1e+90");
}

/// The lane kernel: every lane that settles is right, only ill-determined ones do not settle.
#[test]
fn lanes_in_f32() {
    let cases = cases();
    let mut worst = Worst::default();
    let mut rescued = 0;
    for chunk in cases.chunks(16) {
        let mut blends = [[0.0_f32; 16]; 9];
        let mut sums = [[0.0_f32; 16]; 10];
        for (lane, case) in chunk.iter().enumerate() {
            for (k, &entry) in case.blend::<f32>().iter().flatten().enumerate() {
                blends[k][lane] = entry;
            }
            let a = case.outer_sum();
            let upper = (0..4).flat_map(|i| (i..4).map(move |j| a[i][j]));
            for (k, entry) in upper.enumerate() {
                sums[k][lane] = entry as f32;
            }
        }
        let answers = [lanes::from_blends(&blends, &[1.0; 16]), lanes::from_outer_sums(&sums)];
        for (lanes, what) in answers.iter().zip(["lanes of blends", "lanes of sums"]) {
            for (lane, case) in chunk.iter().enumerate() {
                let quat = [0, 1, 2, 3].map(|k| lanes.quats[k][lane]);
                if lanes.settled[lane] {
                    check_average(case, quat, &mut worst, what);
                } else {
                    assert!(case.number("gap_rel") < 0.08, "{}: not settled", case.name);
                    assert_eq!(quat, rotation::identity::<f32>());
                    rescued += 1;
                }
            }
            assert!(
                lanes.settled[chunk.len()..]
                    .iter()
                    .zip(&lanes.quats[0][chunk.len()..])
                    .all(|(s, w)| !s || *w == 1.0)
            );
        }
    }
    println!(
        "lanes f32: worst {:.2e} rad, {:.3} of tolerance, {rescued} not settled",
        worst.angle, worst.share
    );
}
