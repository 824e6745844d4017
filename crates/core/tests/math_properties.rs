//! Properties of the maths layer that hold for every input: equivariance, invariances, identities between solvers.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use proptest::prelude::*;
use skinsplat_core::math::average::{self, Solver, Start, average, average_rotation, lanes};
use skinsplat_core::math::dual_quaternion::{self, DualQuaternion};
use skinsplat_core::math::rotation::{self, SignPolicy, angle_between, quaternion_to_matrix};
use skinsplat_core::math::{Matrix3, Quaternion, matrix3, sh};
use std::f64::consts::PI;

const EXACT: [Solver; 3] = [Solver::ClosedForm, Solver::Eigen, Solver::Polar];

fn unit() -> impl Strategy<Value = Quaternion<f64>> {
    prop::array::uniform4(-1.0..1.0_f64)
        .prop_filter("long enough to have a direction", |q| q.iter().map(|c| c * c).sum::<f64>() > 1e-2)
        .prop_map(|q| rotation::normalize(q).unwrap())
}

fn bones() -> impl Strategy<Value = Vec<(Quaternion<f64>, f64)>> {
    prop::collection::vec((unit(), 0.01..1.0_f64), 1..7)
}

fn split(bones: &[(Quaternion<f64>, f64)]) -> (Vec<Quaternion<f64>>, Vec<f64>) {
    bones.iter().copied().unzip()
}

fn solve(bones: &[(Quaternion<f64>, f64)], solver: Solver) -> average::Average<f64> {
    let (quats, weights) = split(bones);
    average(&quats, &weights, solver).unwrap()
}

/// How far rounding may turn an answer that is determined by this gap.
fn tolerance(gap: f64) -> f64 {
    1e-14 / gap.max(1e-12)
}

fn any_matrix() -> impl Strategy<Value = Matrix3<f64>> {
    prop::array::uniform3(prop::array::uniform3(-2.0..2.0_f64))
}

fn blend(bones: &[(Quaternion<f64>, f64)]) -> Matrix3<f64> {
    let mut sum = [[0.0; 3]; 3];
    for &(q, weight) in bones {
        let r = quaternion_to_matrix(q);
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            sum[i][j] += weight * r[i][j];
        }
    }
    sum
}

fn largest_difference(a: Matrix3<f64>, b: Matrix3<f64>) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Length of what is left of the second vector off the first: the condition of Gram-Schmidt.
fn gram_schmidt_residual(m: Matrix3<f64>) -> f64 {
    let length = |v: [f64; 3]| matrix3::dot(v, v).sqrt();
    length(m[0]).min(length(matrix3::cross(m[0], m[1])) / length(m[0]))
}

proptest! {
    #[test]
    fn averages_commute_with_rotations(bones in bones(), left in unit(), right in unit()) {
        let turned: Vec<_> = bones
            .iter()
            .map(|&(q, w)| (rotation::multiply(rotation::multiply(left, q), right), w))
            .collect();
        for solver in EXACT.into_iter().chain([Solver::Nlerp]) {
            let answer = solve(&bones, solver);
            let expected = rotation::multiply(rotation::multiply(left, answer.quat), right);
            let found = solve(&turned, solver);
            // Nlerp jumps where a bone changes its side of the heaviest one.
            let sides = bones.iter().all(|(q, _)| bones.iter().all(|(p, _)| dot(*p, *q).abs() > 1e-9));
            if solver != Solver::Nlerp || sides {
                let condition = if solver == Solver::Nlerp { 1e-2 } else { answer.gap };
                prop_assert!(angle_between(found.quat, expected) < tolerance(condition), "{solver}");
            }
            prop_assert!((found.gap - answer.gap).abs() < 1e-13);
        }
    }

    #[test]
    fn exact_solvers_agree(bones in bones()) {
        let reference = solve(&bones, Solver::Eigen);
        for solver in EXACT {
            let answer = solve(&bones, solver);
            prop_assert!(angle_between(answer.quat, reference.quat) < tolerance(reference.gap), "{solver}");
        }
        let polar = rotation::polar(blend(&bones)).unwrap();
        prop_assert!(angle_between(polar, reference.quat) < tolerance(reference.gap));
        // Another route to a long power iteration.
        let squaring = solve(&bones, Solver::Squaring { doublings: 12 });
        if reference.gap > 0.02 {
            prop_assert!(angle_between(squaring.quat, reference.quat) < tolerance(reference.gap));
        }
    }

    #[test]
    fn the_average_maximises(bones in bones(), rival in unit()) {
        let objective = |q| bones.iter().map(|&(bone, w)| w * dot(bone, q).powi(2)).sum::<f64>();
        for solver in EXACT {
            let answer = solve(&bones, solver).quat;
            prop_assert!(objective(answer) >= objective(rival) - 1e-14);
        }
    }

    #[test]
    fn signs_lengths_order_and_scale_do_not_matter(
        bones in bones(),
        flips in prop::collection::vec((any::<bool>(), 1e-3..1e3_f64), 7),
        scale in 1e-9..1e9_f64,
        rotate in 0..7_usize,
    ) {
        let mut same: Vec<_> = bones
            .iter()
            .zip(flips)
            .map(|(&(q, w), (flip, length))| (q.map(|c| if flip { -c * length } else { c * length }), w * scale))
            .collect();
        let places = rotate % same.len();
        same.rotate_left(places);
        for solver in EXACT {
            let (answer, found) = (solve(&bones, solver), solve(&same, solver));
            prop_assert!(angle_between(answer.quat, found.quat) < tolerance(answer.gap), "{solver}");
        }
    }

    #[test]
    fn a_weight_may_be_split(bones in bones(), share in 0.1..0.9_f64, which in 0..7_usize) {
        let mut parts = bones.clone();
        let which = which % parts.len();
        let (q, weight) = parts[which];
        parts[which].1 = weight * share;
        parts.push((q.map(|c| -c), weight * (1.0 - share)));
        parts.push((unit_x(), 0.0));
        for solver in EXACT {
            let (answer, found) = (solve(&bones, solver), solve(&parts, solver));
            prop_assert!(angle_between(answer.quat, found.quat) < tolerance(answer.gap), "{solver}");
            prop_assert!((answer.gap - found.gap).abs() < 1e-13);
        }
    }

    #[test]
    fn power_iteration_converges(bones in bones()) {
        let exact = solve(&bones, Solver::Eigen);
        let ratio = 1.0 - exact.gap;
        let steps = [2_u32, 5, 15, 50];
        let start = solve(&bones, Solver::Power { steps: 0, start: Start::Heaviest }).quat;
        let along = dot(start, exact.quat).abs();
        for steps in steps {
            let power = Solver::Power { steps, start: Start::Heaviest };
            let error = angle_between(solve(&bones, power).quat, exact.quat);
            // tan of the angle (in R⁴) shrinks by λ2/λ1 a step; the rotation's angle is twice that.
            let tangent = (angle_between(start, exact.quat) / 2.0).tan();
            let bound = 2.0 * (tangent * ratio.powi(steps as i32)).atan();
            prop_assert!(error <= bound + 4.0 * tolerance(exact.gap) / along, "{steps}: {error:e} > {bound:e}");
        }
    }

    #[test]
    fn gram_schmidt_commutes_on_one_side(m in any_matrix(), turn in unit()) {
        let r = quaternion_to_matrix(turn);
        let columns = gram_schmidt_residual(matrix3::transpose(m));
        if columns > 1e-3 {
            let found = rotation::gram_schmidt_columns(matrix3::multiply(r, m)).unwrap();
            let expected = matrix3::multiply(r, rotation::gram_schmidt_columns(m).unwrap());
            prop_assert!(largest_difference(found, expected) < 1e-14 / columns);
        }
        let rows = gram_schmidt_residual(m);
        if rows > 1e-3 {
            let found = rotation::gram_schmidt_rows(matrix3::multiply(m, r)).unwrap();
            let expected = matrix3::multiply(rotation::gram_schmidt_rows(m).unwrap(), r);
            prop_assert!(largest_difference(found, expected) < 1e-14 / rows);
        }
    }

    #[test]
    fn polar_commutes_on_both_sides_and_is_nearest(m in any_matrix(), left in unit(), right in unit()) {
        let nearest = rotation::polar(m).unwrap();
        let [l, r] = [left, right].map(quaternion_to_matrix);
        let turned = rotation::polar(matrix3::multiply(matrix3::multiply(l, m), r)).unwrap();
        let agreement = |q| matrix3::determinant(m).is_finite()
            && trace_of_product(quaternion_to_matrix(q), m) <= trace_of_product(quaternion_to_matrix(nearest), m) + 1e-13;
        prop_assert!(agreement(left) && agreement(right));
        let expected = rotation::multiply(rotation::multiply(left, nearest), right);
        // tr(RᵀM) is stationary at the answer: equally near, up to rounding, even where the answer is not determined.
        let product = matrix3::multiply(matrix3::multiply(l, m), r);
        let loss = trace_of_product(quaternion_to_matrix(expected), product)
            - trace_of_product(quaternion_to_matrix(turned), product);
        prop_assert!(loss.abs() < 1e-13);
    }

    #[test]
    fn conversions_round_trip(q in unit()) {
        let back = rotation::matrix_to_quaternion(quaternion_to_matrix(q));
        prop_assert!(angle_between(q, back) < 4e-15);
        prop_assert!(back[0] >= 0.0);
        let [x, y, z, w] = rotation::nearest_rotation(glam::DMat3::from_quat(glam::DQuat::from_xyzw(q[1], q[2], q[3], q[0]))).to_array();
        prop_assert!(angle_between(q, [w, x, y, z]) < 8e-15);
        for policy in [SignPolicy::NonNegativeW, SignPolicy::LargestPositive, SignPolicy::AlignToFirst] {
            let negative = q.map(|c| -c);
            prop_assert_eq!(policy.apply(q, back), policy.apply(negative, back));
        }
    }

    #[test]
    fn angles_are_accurate(axis in unit(), angle in prop_oneof![1e-12..1e-3_f64, 0.0..PI, PI - 1e-4..PI], at in unit()) {
        let axis = axis_of(axis);
        prop_assume!(axis.is_some());
        let [x, y, z] = axis.unwrap().map(|c| c * (angle / 2.0).sin());
        let turn = [(angle / 2.0).cos(), x, y, z];
        let found = angle_between(rotation::multiply(turn, at), at.map(|c| -c));
        prop_assert!((found - angle).abs() < 2e-15, "{found:e} {angle:e}");
    }

    #[test]
    fn lanes_stand_alone(bones in prop::collection::vec(bones(), 8)) {
        let mut wide = [[0.0_f32; 8]; 9];
        for (lane, bones) in bones.iter().enumerate() {
            let total: f64 = bones.iter().map(|(_, w)| w).sum();
            for (k, entry) in blend(bones).iter().flatten().enumerate() {
                wide[k][lane] = (entry / total) as f32;
            }
        }
        let all = lanes::from_blends(&wide, &[1.0; 8]);
        for (lane, bones) in bones.iter().enumerate() {
            let alone = lanes::from_blends(&wide.map(|entries| [entries[lane]]), &[1.0]);
            prop_assert_eq!(alone.settled[0], all.settled[lane]);
            let [alone, among] = [alone.quats.map(|c| c[0]), all.quats.map(|c| c[lane])];
            prop_assert_eq!(alone, among);
            let exact = solve(bones, Solver::Eigen);
            if all.settled[lane] {
                let error = angle_between(among.map(f64::from), exact.quat);
                prop_assert!(error < 4e-6 / exact.gap, "{error:e}, gap {}", exact.gap);
            } else {
                prop_assert!(exact.gap < 0.1);
            }
        }
    }

    #[test]
    fn sh_rotation_is_a_representation(a in unit(), b in unit()) {
        let product = |a: Quaternion<f64>, b| sh::Rotation::from_quaternion(rotation::multiply(a, b), 3);
        let [first, second] = [a, b].map(|q| sh::Rotation::from_quaternion(q, 3));
        let mut coefficients: Vec<[f64; 3]> = (0..16).map(|i| [f64::from(i), 1.0, -0.5 * f64::from(i % 3)]).collect();
        let mut expected = coefficients.clone();
        second.apply(&mut expected);
        first.apply(&mut expected);
        product(a, b).apply(&mut coefficients);
        for (found, expected) in coefficients.iter().flatten().zip(expected.iter().flatten()) {
            prop_assert!((found - expected).abs() < 2e-13);
        }
        // Orthogonal: D Dᵀ = I.
        let d = first.matrix::<7>();
        for (i, j) in (0..49).map(|k| (k / 7, k % 7)) {
            let product: f64 = (0..7).map(|k| d[i][k] * d[j][k]).sum();
            prop_assert!((product - f64::from(u8::from(i == j))).abs() < 1e-14);
        }
    }

    #[test]
    fn rotated_sh_are_read_in_turned_directions(
        q in unit(),
        direction in unit(),
        coefficients in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 16),
        degree in 0..4_usize,
    ) {
        let direction = axis_of(direction);
        prop_assume!(direction.is_some());
        let direction = direction.unwrap();
        let r = quaternion_to_matrix(q);
        let mut rotated = coefficients.clone();
        sh::Rotation::new(r, degree).apply(&mut rotated[..sh::count(degree)]);
        let found = sh::evaluate(degree, &rotated, direction);
        let expected = sh::evaluate(degree, &coefficients, matrix3::apply(matrix3::transpose(r), direction));
        for channel in 0..3 {
            prop_assert!((found[channel] - expected[channel]).abs() < 2e-14);
        }
        prop_assert_eq!(&rotated[sh::count(degree)..], &coefficients[sh::count(degree)..]);
    }

    #[test]
    fn dual_quaternion_blend_is_rigid(
        motions in prop::collection::vec((unit(), prop::array::uniform3(-1.0..1.0_f64), 0.01..1.0_f64), 1..5),
        left in unit(),
        shift in prop::array::uniform3(-1.0..1.0_f64),
        point in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        let weights: Vec<f64> = motions.iter().map(|m| m.2).collect();
        let plain: Vec<_> = motions.iter().map(|&(q, t, _)| DualQuaternion::new(q, t)).collect();
        let blend = dual_quaternion::blend(&plain, &weights).unwrap();
        prop_assert!((dot(blend.real, blend.real) - 1.0).abs() < 1e-14 && dot(blend.real, blend.dual).abs() < 1e-13);
        // The rotation is nlerp.
        let quats: Vec<_> = motions.iter().map(|m| m.0).collect();
        let nlerp = average_rotation(&quats, &weights, Solver::Nlerp).unwrap();
        prop_assert!(angle_between(nlerp, blend.real) < 1e-12);
        // A motion of the world moves the blend along.
        let world = DualQuaternion::new(left, shift);
        let moved: Vec<_> = motions
            .iter()
            .map(|&(q, t, _)| DualQuaternion::new(rotation::multiply(left, q), world.transform(t)))
            .collect();
        let found = dual_quaternion::blend(&moved, &weights).unwrap().transform(point);
        let expected = world.transform(blend.transform(point));
        let sides = quats.iter().all(|&p| quats.iter().all(|&q| dot(p, q).abs() > 1e-9));
        for k in 0..3 {
            prop_assert!(!sides || (found[k] - expected[k]).abs() < 1e-11);
        }
    }

    #[test]
    fn nothing_panics_and_nothing_is_nan(
        quats in prop::collection::vec(prop::array::uniform4(any_number()), 0..5),
        weights in prop::collection::vec(any_number(), 0..5),
        m in prop::array::uniform3(prop::array::uniform3(any_number())),
    ) {
        let is_unit = |q: Quaternion<f64>| (dot(q, q) - 1.0).abs() < 1e-14;
        let power = Solver::Power { steps: 15, start: Start::Identity };
        for solver in EXACT.into_iter().chain([power, Solver::Squaring { doublings: 5 }, Solver::Nlerp]) {
            if let Some(answer) = average(&quats, &weights, solver) {
                prop_assert!(is_unit(answer.quat) && (0.0..=1.0).contains(&answer.gap), "{solver} {answer:?}");
            }
            let narrow: Vec<_> = quats.iter().map(|q| q.map(|c| c as f32)).collect();
            let narrow_weights: Vec<_> = weights.iter().map(|&w| w as f32).collect();
            if let Some(answer) = average(&narrow, &narrow_weights, solver) {
                let quat = answer.quat.map(f64::from);
                prop_assert!((dot(quat, quat) - 1.0).abs() < 1e-6, "{solver} {answer:?}");
            }
        }
        prop_assert_eq!(rotation::polar(m).is_some(), matrix3::is_finite(m));
        prop_assert!(rotation::polar(m).is_none_or(is_unit));
        prop_assert!(is_unit(rotation::matrix_to_quaternion(m)));
        if let Some(r) = rotation::gram_schmidt_columns(m) {
            prop_assert!((matrix3::determinant(r) - 1.0).abs() < 1e-13);
        }
        let lanes = lanes::from_blends(&m.map(|row| row.map(|c| [c as f32])).as_flattened().try_into().unwrap(), &[1.0]);
        prop_assert!(lanes.quats.iter().all(|c| c[0].is_finite()));
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -2.0..2.0_f64,
        2 => Just(0.0),
        1 => Just(-0.0),
        2 => Just(1.0),
        1 => prop::num::f64::ANY,
    ]
}

/// The direction of the vector part, if it is long enough to have one.
fn axis_of([_, x, y, z]: Quaternion<f64>) -> Option<[f64; 3]> {
    let length = matrix3::dot([x, y, z], [x, y, z]).sqrt();
    (length > 0.1).then(|| [x, y, z].map(|c| c / length))
}

fn unit_x() -> Quaternion<f64> {
    [0.0, 1.0, 0.0, 0.0]
}

fn dot(a: Quaternion<f64>, b: Quaternion<f64>) -> f64 {
    (0..4).map(|k| a[k] * b[k]).sum()
}

fn trace_of_product(r: Matrix3<f64>, m: Matrix3<f64>) -> f64 {
    r.iter().flatten().zip(m.iter().flatten()).map(|(a, b)| a * b).sum()
}
