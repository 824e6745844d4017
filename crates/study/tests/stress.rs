//! What `stress` promises: exact solvers hold everywhere, no cell is NaN, the same bits on any number of threads; and the
//! remedy for jumps.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use skinsplat_core::math::rotation::{angle_between, conjugate, multiply};
use skinsplat_core::math::{Quaternion, average, rotation};
use skinsplat_core::scene::{Avatar, Binding, Pose, PosedBody, RestBody, SkinWeights};
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, RotationChoice, Strategy};
use skinsplat_study::stress::table::{Cell, Findings, Verdict};
use skinsplat_study::stress::{Report, Section};

fn examined(section: Section) -> Findings {
    section.examine(true).unwrap().findings
}

#[test]
fn exact_solvers_hold_on_every_hard_average() {
    let findings = examined(Section::Averages);
    let exact = ["closed-form", "eigen", "polar", "lbs-polar"];
    let (own, others): (Vec<_>, Vec<_>) =
        findings.rows.iter().partition(|row| exact.contains(&row.subject.as_str()));
    assert!(own.len() > 400, "{}", own.len());
    for row in own {
        assert_eq!(row.verdict, Verdict::Holds, "{row:?}");
        assert_eq!((row.finite, row.deterministic), (Cell::Flag(true), Cell::Flag(true)), "{row:?}");
    }
    // The examination can tell: these are known to break.
    for broken in ["power-15", "gram-schmidt-columns", "matrix-to-quaternion-raw"] {
        assert!(others.iter().any(|row| row.subject == broken && row.verdict == Verdict::Breaks), "{broken}");
        assert!(findings.thresholds.iter().any(|threshold| threshold.subject == broken), "{broken}");
    }
    // 15 steps from the heavier of two equal bones leave tan φ = tan(θ/4) tan²(θ/4)^15 of the quaternion's angle, which
    // is half that of the rotation: one degree at 162.5°.
    let edge = findings.thresholds.iter().find(|t| t.subject == "power-15" && t.family == "to 180°");
    let edge = edge.unwrap().breaks_at;
    let tangent = (0.25 * (180.0 - edge).to_radians()).tan();
    let degrees = 2.0 * (tangent * tangent.powi(30)).atan().to_degrees();
    assert!((degrees - 1.0).abs() < 1e-3, "{edge}: {degrees}");
}

#[test]
fn every_cell_has_a_value_or_a_word_and_every_thread_count_the_same() {
    let sections = [Section::Averages, Section::Poses, Section::Faces, Section::Scales];
    let report = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Report::new(true, sections.map(examined).to_vec(), Vec::new()))
    };
    let (one, two) = (report(1), report(2));
    assert_eq!(one.json(), two.json());
    assert_eq!(one.markdown(), two.markdown());
    let csv = one.csv();
    let rows: usize = one.sections.iter().map(|s| s.rows.len()).sum();
    assert_eq!(csv.lines().count(), rows + 1);
    for table in one.sections.iter().flat_map(|s| &s.tables) {
        table.check().unwrap();
    }
    for row in one.sections.iter().flat_map(|s| &s.rows) {
        for cell in [row.rotation_error, row.error, row.equivariance, row.jump] {
            assert!(cell.value().is_none_or(f64::is_finite) && cell != Cell::Word(""), "{row:?}");
        }
        assert_ne!(row.deterministic, Cell::Flag(false), "{row:?}");
    }
    for text in [csv, one.markdown(), one.json()] {
        assert!(!text.contains("NaN") && !text.contains("null"), "a number without a word");
    }
}

/// One Gaussian per row of weights.
fn probes(body: &RestBody, rows: &[Vec<(usize, f32)>]) -> BoundAvatar {
    let mut avatar: Avatar = rig::on_vertices(body, rows.len(), 3);
    avatar.gaussians.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    avatar.binding = Binding::Vertex(SkinWeights::from_rows(rows.to_vec(), rig::JOINTS).unwrap());
    BoundAvatar::new(&avatar, body).unwrap()
}

fn twisted(body: &RestBody, degrees: [f64; rig::JOINTS]) -> Pose {
    let angles = degrees.map(|d| DVec3::X * d.to_radians());
    Pose::from_axis_angles(&body.skeleton, &angles, DVec3::ZERO)
}

/// The largest change from pose to pose of any Gaussian, degrees.
fn jump(body: &RestBody, bound: &BoundAvatar, poses: &[Pose], rotation: &str, follows: bool) -> f64 {
    let rotation: RotationChoice = rotation.parse().unwrap();
    let strategy = Strategy { rotation, ..Strategy::preset("quaternion-average").unwrap() };
    let (mut before, mut lift, mut worst): (Option<Vec<Quaternion<f32>>>, Option<JointLift>, f64) =
        (None, None, 0.0);
    for pose in poses {
        let posed_body = PosedBody::new(body, pose).unwrap();
        let next = JointLift::next(lift.as_ref().filter(|_| follows), &posed_body);
        let (mut poser, options) =
            (Poser::new(), PoseOptions { lift: Some(&next), ..PoseOptions::default() });
        let posed = poser.pose(bound, &posed_body, &strategy, &options).unwrap();
        let turns = posed.rotations.unwrap().to_vec();
        for (a, b) in before.iter().flatten().zip(&turns) {
            worst = worst.max(angle_between(a.map(f64::from), b.map(f64::from)).to_degrees());
        }
        (before, lift) = (Some(turns), Some(next));
    }
    worst
}

#[test]
fn signs_from_rest_carry_a_chain_through_180_degrees() {
    let body = rig::body();
    let bound = probes(&body, &[vec![(0, 0.5), (4, 0.5)], (0..5).map(|j| (j, 0.2)).collect()]);
    // Each joint turns by 80°, the last against the first by 320°.
    let poses: Vec<Pose> =
        (0..=160).map(|i| 0.5 * f64::from(i)).map(|d| twisted(&body, [0.0, d, d, d, d])).collect();
    assert!(jump(&body, &bound, &poses, "closed-form", false) > 80.0);
    // The largest honest change: half of 4 × 0.5° per frame, and a little where the terms of five bones cancel.
    let rest = jump(&body, &bound, &poses, "lifted-sum", false);
    assert!(rest < 3.0, "{rest}");
}

#[test]
fn signs_from_the_frame_before_carry_a_joint_through_180_degrees() {
    let body = rig::body();
    let bound = probes(&body, &[vec![(0, 0.5), (1, 0.5)], vec![(0, 0.6), (1, 0.4)]]);
    let poses: Vec<Pose> = (0..=350).map(|i| twisted(&body, [0.0, f64::from(i), 0.0, 0.0, 0.0])).collect();
    for stateless in ["closed-form", "lifted-sum", "nlerp"] {
        assert!(jump(&body, &bound, &poses, stateless, false) > 80.0, "{stateless}");
    }
    let previous = jump(&body, &bound, &poses, "lifted-sum", true);
    assert!(previous < 6.0, "{previous}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Turning the world turns every quaternion and no relative sign, also exactly at 180°.
    #[test]
    fn lifts_follow_turns_of_the_world(seed in any::<u64>(), half_turns in any::<bool>()) {
        let body = rig::body();
        let mut noise = rig::Noise(seed);
        let pi = std::f64::consts::PI;
        let at = if half_turns {
            let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::X, DVec3::Y];
            Pose::from_axis_angles(&body.skeleton, &axes.map(|a| a * pi), DVec3::ZERO)
        } else {
            rig::bent(&body, seed, 3.0)
        };
        let turn = DQuat::from_scaled_axis(noise.vector() * 2.0);
        let moved = rig::moved(&at, turn, noise.vector());
        let [here, there] = [&at, &moved].map(|pose| JointLift::from_rest(&PosedBody::new(&body, pose).unwrap()));
        let relative = |lift: &JointLift| {
            let q = lift.quaternions();
            (1..q.len()).map(|j| multiply(conjugate(q[0]), q[j])).collect::<Vec<_>>()
        };
        for (a, b) in relative(&here).iter().zip(relative(&there)) {
            let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            prop_assert!(off < 1e-12, "{a:?} {b:?}");
        }
        // Following oneself changes nothing.
        let posed = PosedBody::new(&body, &at).unwrap();
        prop_assert_eq!(here.following(&posed), here);
    }

    /// Nearby bones: the sum is the average to second order in the angle.
    #[test]
    fn the_lifted_sum_is_the_average_of_nearby_bones(seed in any::<u64>(), bend in 0.01..0.2f64) {
        let body = rig::body();
        let bound = probes(&body, &[(0..5).map(|j| (j, 0.2)).collect(), vec![(1, 0.7), (2, 0.3)]]);
        let at = rig::bent(&body, seed, bend);
        let posed_body = PosedBody::new(&body, &at).unwrap();
        let lift = JointLift::from_rest(&posed_body);
        let of = |rotation: &str| {
            let strategy = Strategy {
                rotation: rotation.parse().unwrap(),
                ..Strategy::preset("quaternion-average").unwrap()
            };
            let options = PoseOptions { lift: Some(&lift), ..PoseOptions::default() };
            Poser::new().pose(&bound, &posed_body, &strategy, &options).unwrap().rotations.unwrap().to_vec()
        };
        for (a, b) in of("lifted-sum").iter().zip(of("closed-form")) {
            let off = angle_between(a.map(f64::from), b.map(f64::from));
            // The two differ by the third order of the spread, which is at most 4 joints × √3 × bend.
            prop_assert!(off < 0.2 * (4.0 * 3f64.sqrt() * bend).powi(3) + 1e-6, "{off:e}");
        }
    }

    /// Half turns: neither the sign that a quaternion came with nor a turn of the world changes what nlerp answers.
    #[test]
    fn nlerp_has_a_rule_at_180_degrees(axis in prop::array::uniform3(-1.0..1.0f64), world in prop::array::uniform4(-1.0..1.0f64)) {
        let q = rotation::normalize([0.0, axis[0], axis[1], axis[2]]);
        let world = rotation::normalize(world);
        let mut sizes = axis.map(f64::abs);
        sizes.sort_by(f64::total_cmp);
        prop_assume!(sizes[2] > 0.1 && sizes[2] - sizes[1] > 1e-3 && world.is_some());
        let (q, world) = (q.unwrap(), world.unwrap());
        let weights = [0.6f32, 0.4];
        let answer = |quats: [Quaternion<f64>; 2]| {
            let quats = quats.map(|q| q.map(|c| c as f32));
            let solver = average::Solver::Nlerp;
            average::average_rotation(&quats, &weights, solver).unwrap().map(f64::from)
        };
        let own = answer([rotation::identity(), q]);
        let negated = answer([rotation::identity(), q.map(|c| -c)]);
        prop_assert!(angle_between(own, negated) < 1e-6);
        let turned = answer([world, multiply(world, q)]);
        prop_assert!(angle_between(multiply(world, own), turned) < 1e-5);
    }
}
