//! What avatars and motions need, and that no bound is ever exceeded: every bounded solver and projection against the
//! exact average, in `f64` and as posed in `f32`, on random and on adverse rigs, weights and poses.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DVec3, Vec3};
use proptest::prelude::{ProptestConfig, TestCaseError, any, prop_assert, proptest};
use proptest::strategy::Strategy as _;
use rig::Noise;
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::math::rotation::{
    angle_between, conjugate, gram_schmidt_columns, gram_schmidt_rows, matrix_to_quaternion,
    matrix_to_quaternion_raw, multiply, normalize, quaternion_to_matrix,
};
use skinsplat_core::math::{Matrix3, Quaternion};
use skinsplat_core::scene::{Avatar, Binding, Pose, PosedBody, RestBody, Skeleton, SkinWeights};
use skinsplat_posing::needs::{Needs, PoseBounds};
use skinsplat_posing::{BoundAvatar, LbsProjection, RotationChoice, Strategy, pose};

/// How far apart the bones of a Gaussian are, and how their weights are drawn.
#[derive(Clone, Copy, Debug)]
struct Shape {
    bones: usize,
    /// Largest angle of a joint to the identity, radians.
    bend: f64,
    /// Weights are powers of uniform numbers: large exponents leave one heavy bone.
    exponent: f64,
    /// All joints turn about one axis: bones of a hinge, where the bounds of two bones are near.
    hinge: bool,
}

fn shapes() -> impl proptest::strategy::Strategy<Value = Shape> {
    (1usize..7, 0.0f64..1.0, 0.1f64..6.0, any::<bool>()).prop_map(|(bones, bend, exponent, hinge)| Shape {
        bones,
        // As many small angles as large ones.
        bend: 3.2 * bend * bend,
        exponent,
        hinge,
    })
}

const GAUSSIANS: usize = 24;

/// Joints without parents, so that a pose sets their rotations one by one, and Gaussians on `bones` of them.
struct Rig {
    body: RestBody,
    avatar: Avatar,
    pose: Pose,
    rows: Vec<Vec<(usize, f32)>>,
}

fn make(shape: Shape, seed: u64) -> Rig {
    let mut noise = Noise(seed);
    for _ in 0..8 {
        noise.next();
    }
    let joints = shape.bones + 1;
    let skeleton = Skeleton::from_joint_positions(
        vec![String::new(); joints],
        vec![None; joints],
        &vec![DVec3::ZERO; joints],
    )
    .unwrap();
    let mut rows = Vec::new();
    for _ in 0..GAUSSIANS {
        let first = usize::from(noise.next() > 0.0);
        let raw: Vec<f64> =
            (0..shape.bones).map(|_| (0.5 + 0.5 * noise.next()).max(1e-6).powf(shape.exponent)).collect();
        let sum: f64 = raw.iter().sum();
        rows.push(raw.iter().enumerate().map(|(k, w)| (first + k, (w / sum) as f32)).collect::<Vec<_>>());
    }
    let weights = SkinWeights::from_rows(rows.clone(), joints).unwrap();
    let axis = noise.vector().normalize();
    let angles: Vec<DVec3> = (0..joints)
        .map(|_| {
            let turn = if shape.hinge { axis } else { noise.vector().normalize() };
            turn * shape.bend * noise.next()
        })
        .collect();
    let pose = Pose::from_axis_angles(&skeleton, &angles, DVec3::ZERO);
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let on_first = SkinWeights::from_rows(vec![vec![(0, 1.0)]; 3], joints).unwrap();
    let body = RestBody {
        skeleton,
        vertices,
        faces: vec![[0, 1, 2]],
        weights: on_first,
        uv: None,
        pose_directions: Vec::new(),
    };
    let means = (0..GAUSSIANS).map(|i| Vec3::splat(i as f32)).collect();
    let avatar = Avatar { gaussians: rig::gaussians(means, seed, 1), binding: Binding::Vertex(weights) };
    Rig { body, avatar, pose, rows }
}

/// The bones of a Gaussian in `f64`.
fn bones(rig: &Rig, body: &PosedBody<'_>, i: usize) -> (Vec<Quaternion<f64>>, Vec<f64>) {
    let quat = |j: usize| {
        let q = body.joints[j].rotation;
        [q.w, q.x, q.y, q.z]
    };
    rig.rows[i].iter().filter(|(_, w)| *w > 0.0).map(|&(j, w)| (quat(j), f64::from(w))).unzip()
}

fn blend(quats: &[Quaternion<f64>], weights: &[f64]) -> Matrix3<f64> {
    let mut sum = [[0.0; 3]; 3];
    for (q, w) in quats.iter().zip(weights) {
        let r = quaternion_to_matrix(*q);
        (0..3).for_each(|i| (0..3).for_each(|j| sum[i][j] += w * r[i][j]));
    }
    sum
}

/// What a rotation choice answers in `f64`, relative to the rest pose.
fn in_f64(
    choice: RotationChoice,
    quats: &[Quaternion<f64>],
    weights: &[f64],
    canonical: Quaternion<f64>,
) -> Option<Quaternion<f64>> {
    match choice {
        RotationChoice::QuaternionAverage(solver) => average_rotation(quats, weights, solver),
        RotationChoice::Lbs(projection) => {
            let b = blend(quats, weights);
            match projection {
                LbsProjection::GramSchmidtColumns => gram_schmidt_columns(b).map(matrix_to_quaternion),
                LbsProjection::GramSchmidtRows => gram_schmidt_rows(b).map(matrix_to_quaternion),
                LbsProjection::Polar => skinsplat_core::math::rotation::polar(b),
                LbsProjection::MatrixToQuaternion | LbsProjection::MatrixToQuaternionRaw => {
                    let turned = skinsplat_core::math::matrix3::multiply(b, quaternion_to_matrix(canonical));
                    let posed = normalize(matrix_to_quaternion_raw(turned))?;
                    Some(multiply(posed, conjugate(canonical)))
                }
            }
        }
        _ => None,
    }
}

/// Choices whose bound is a number on at least some rigs.
fn bounded() -> Vec<RotationChoice> {
    let more = [
        "power-3-first",
        "power-1-ones",
        "power-2-identity",
        "power-0-nlerp",
        "power-0-column",
        "squaring-0",
    ];
    let mut all = Needs::listed();
    all.extend(more.iter().map(|id| id.parse::<RotationChoice>().unwrap()));
    all
}

/// The largest ratio of error to bound for each choice, and that no bound is exceeded in `f64`.
fn check_f64(rig: &Rig) -> Result<Vec<f64>, TestCaseError> {
    let bound = BoundAvatar::new(&rig.avatar, &rig.body).unwrap();
    let body = PosedBody::new(&rig.body, &rig.pose).unwrap();
    let bounds = PoseBounds::new(&bound, &body);
    let choices = bounded();
    let mut tightness = vec![0.0f64; choices.len()];
    for i in 0..GAUSSIANS {
        let (quats, weights) = bones(rig, &body, i);
        let exact = average_rotation(&quats, &weights, Solver::Eigen).unwrap();
        let canonical = rig.avatar.gaussians.unit_rotation(i).map(f64::from);
        let canonical = normalize(canonical).unwrap();
        for (choice, tightness) in choices.iter().zip(&mut tightness) {
            let limit = bounds.exact_degrees(*choice);
            if !limit.is_finite() {
                continue;
            }
            let Some(answer) = in_f64(*choice, &quats, &weights, canonical) else { continue };
            let error = angle_between(answer, exact).to_degrees();
            // Rounding of f64, over the gap.
            let slack = 1e-12 / bounds.gap().max(1e-4);
            prop_assert!(error <= limit + slack.max(1e-10), "{choice}: {error} > {limit}, {:?}", rig.rows[i]);
            *tightness = tightness.max(error / limit.max(1e-6));
        }
    }
    Ok(tightness)
}

/// What was drawn, relative to the exact average, is within the bound with its allowance for rounding.
fn check_f32(rig: &Rig, choices: &[RotationChoice]) -> Result<f64, TestCaseError> {
    let bound = BoundAvatar::new(&rig.avatar, &rig.body).unwrap();
    let body = PosedBody::new(&rig.body, &rig.pose).unwrap();
    let bounds = PoseBounds::new(&bound, &body);
    let base = Strategy::preset("quaternion-average").unwrap();
    let mut worst = 0.0f64;
    for &rotation in choices {
        let limit = bounds.degrees(rotation);
        if !limit.is_finite() {
            continue;
        }
        let posed = pose(&bound, &body, &Strategy { rotation, ..base }).unwrap();
        for (i, q) in posed.rotations.as_ref().unwrap().iter().enumerate() {
            let (quats, weights) = bones(rig, &body, i);
            let exact = average_rotation(&quats, &weights, Solver::ClosedForm).unwrap();
            let canonical = rig.avatar.gaussians.unit_rotation(i).map(f64::from);
            let error = angle_between(q.map(f64::from), multiply(exact, canonical)).to_degrees();
            prop_assert!(
                error <= limit,
                "{rotation}: {error} > {limit} (gap {}), {:?}",
                bounds.gap(),
                rig.rows[i]
            );
            worst = worst.max(error / limit);
        }
    }
    Ok(worst)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_bound_is_exceeded_in_f64(shape in shapes(), seed in any::<u64>()) {
        check_f64(&make(shape, seed))?;
    }

    #[test]
    fn no_bound_is_exceeded_as_posed(shape in shapes(), seed in any::<u64>()) {
        check_f32(&make(shape, seed), &bounded())?;
    }
}

/// Bounds that are equalities are reached, and the others are not idle: two bones, thousands of rigs.
#[test]
fn bounds_are_near_for_two_bones() {
    let choices = bounded();
    let mut tightness = vec![0.0f64; choices.len()];
    for seed in 0..3000 {
        let wave = (seed as f64 * 0.618).fract();
        let shape =
            Shape { bones: 2, bend: 0.2 + 1.3 * wave, exponent: 0.2 + 3.0 * wave, hinge: seed % 2 == 0 };
        for (own, found) in tightness.iter_mut().zip(check_f64(&make(shape, seed)).unwrap()) {
            *own = own.max(found);
        }
    }
    for (choice, tightness) in choices.iter().zip(&tightness) {
        let least = match choice.to_string().as_str() {
            "power-0" | "power-1" | "power-2" | "power-4" => 0.999,
            "nlerp" | "power-0-nlerp" => 0.95,
            "gram-schmidt-columns" | "gram-schmidt-rows" => 0.7,
            "matrix-to-quaternion" => 0.8,
            "squaring-0" | "power-0-column" => 0.4,
            _ => 0.0,
        };
        assert!(*tightness >= least, "{choice}: the error is at most {tightness} of the bound");
    }
}

/// Counts, degrees and joints of an avatar that is small enough to count by hand.
#[test]
fn needs_of_a_hand_made_avatar() {
    let body = rig::body();
    let rows =
        [vec![(1, 1.0f32)], vec![(1, 0.5), (3, 0.5)], vec![(1, 0.25), (2, 0.25), (3, 0.5)], vec![(1, 1.0)]];
    let weights = SkinWeights::from_rows(rows, rig::JOINTS).unwrap();
    let mut gaussians = rig::gaussians(vec![Vec3::ZERO; 4], 1, 3);
    for own in gaussians.sh.chunks_exact_mut(16) {
        own[4..].fill([0.0; 3]);
    }
    gaussians.sh[16 + 8] = [0.0, 1e-3, 0.0];
    let bound = BoundAvatar::new(&Avatar { gaussians, binding: Binding::Vertex(weights) }, &body).unwrap();
    let turned = |angle: f64| {
        let mut angles = [DVec3::ZERO; rig::JOINTS];
        angles[3] = DVec3::Z * angle;
        Pose::from_axis_angles(&body.skeleton, &angles, DVec3::ZERO)
    };
    let poses = [turned(0.2), turned(1.0), turned(-0.3)];
    let needs = Needs::new(&bound, &body, &poses, &Needs::listed(), 0.5).unwrap();
    assert_eq!((needs.gaussians, needs.poses), (4, 3));
    assert_eq!((needs.sh_degree_stored, needs.sh_degree_present), (3, 2));
    assert_eq!(needs.influences, [0, 2, 1, 1]);
    assert_eq!(needs.joints_used, [1, 2, 3]);
    let pairs: Vec<_> = needs.pairs.iter().map(|pair| (pair.joints, pair.gaussians)).collect();
    assert_eq!(pairs, [([1, 2], 1), ([1, 3], 2), ([2, 3], 1)]);
    assert!((needs.worst_angle.value - 1f64.to_degrees()).abs() < 1e-9 && needs.worst_angle.pose == 1);
    // Both blended Gaussians hang half on either side of the joint: gap cos(t/2).
    for gap in [needs.gap.unwrap(), needs.gap_bound] {
        assert!((gap.value - 0.5f64.cos()).abs() < 1e-9 && gap.pose == 1, "{gap:?}");
    }
    // At rest everything is exact but for rounding.
    let rest = Needs::new(&bound, &body, &[], &Needs::listed(), 0.5).unwrap();
    assert_eq!(rest.verdict.cheapest.unwrap().rotation.to_string(), "power-0");
    assert!(rest.worst_angle.value == 0.0 && rest.gap.unwrap().value > 1.0 - 1e-12);
}

/// The gap that branch and bound finds is the smallest of all Gaussians in all poses.
#[test]
fn the_smallest_gap_is_found() {
    for seed in 0..40 {
        let shape = Shape {
            bones: 2 + seed as usize % 4,
            bend: 0.05 * seed as f64,
            exponent: 1.0,
            hinge: seed % 3 == 0,
        };
        let rig = make(shape, seed);
        let bound = BoundAvatar::new(&rig.avatar, &rig.body).unwrap();
        let poses = [rig.pose.clone(), Pose::rest(&rig.body.skeleton)];
        let needs = Needs::new(&bound, &rig.body, &poses, &[], 0.5).unwrap();
        let body = PosedBody::new(&rig.body, &rig.pose).unwrap();
        let smallest = (0..GAUSSIANS)
            .map(|i| {
                let (quats, weights) = bones(&rig, &body, i);
                let sum: f64 = weights.iter().sum();
                let mut outer = [[0.0; 4]; 4];
                for (q, w) in quats.iter().zip(&weights) {
                    (0..4).for_each(|i| (0..4).for_each(|j| outer[i][j] += w / sum * q[i] * q[j]));
                }
                let values = skinsplat_core::math::average::eigen::SymmetricEigen::new(outer).values;
                values[0] - values[1]
            })
            .fold(1.0, f64::min);
        let found = needs.gap.unwrap().value;
        assert!((found - smallest).abs() < 1e-7, "{found} {smallest}");
        assert!(needs.gap_bound.value <= smallest + 1e-7);
    }
}

/// Keeping fewer influences moves the average by no more than its bound.
#[test]
fn fewer_influences_stay_within_their_bound() {
    for seed in 0..600 {
        let shape = Shape {
            bones: 2 + seed as usize % 5,
            bend: 0.003 * seed as f64,
            exponent: 3.0,
            hinge: seed % 2 == 0,
        };
        let rig = make(shape, seed);
        let bound = BoundAvatar::new(&rig.avatar, &rig.body).unwrap();
        let body = PosedBody::new(&rig.body, &rig.pose).unwrap();
        let bounds = PoseBounds::new(&bound, &body);
        for (kept, i) in (1..=4).flat_map(|kept| (0..GAUSSIANS).map(move |i| (kept, i))) {
            let limit = bounds.fewer_influences(kept);
            let (quats, weights) = bones(&rig, &body, i);
            let exact = average_rotation(&quats, &weights, Solver::Eigen).unwrap();
            let mut order: Vec<usize> = (0..weights.len()).collect();
            order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
            let (quats, weights): (Vec<_>, Vec<_>) =
                order.iter().take(kept).map(|&j| (quats[j], weights[j])).unzip();
            let fewer = average_rotation(&quats, &weights, Solver::Eigen).unwrap();
            let error = angle_between(fewer, exact).to_degrees();
            assert!(error <= limit + 1e-9, "{kept} of {}: {error} > {limit}", order.len());
        }
    }
}
