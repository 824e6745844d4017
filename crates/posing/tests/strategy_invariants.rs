//! What must hold for every strategy, whatever the avatar and the pose.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DMat3, DQuat, DVec3, Mat3};
use proptest::prelude::*;
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, OwnedPosed, Pose, PosedBody, RestBody, SkinWeights};
use skinsplat_posing::{
    BoundAvatar, ColourChoice, CovarianceChoice, PRESETS, RotationChoice, Strategy, pose,
};

fn strategy(spec: &str) -> Strategy {
    spec.parse().unwrap()
}

fn posed(bound: &BoundAvatar, body: &RestBody, at: &Pose, strategy: &Strategy) -> OwnedPosed {
    pose(bound, &PosedBody::new(body, at).unwrap(), strategy).unwrap()
}

fn avatars(body: &RestBody, seed: u64) -> [BoundAvatar; 2] {
    [rig::on_vertices(body, 60, seed), rig::on_faces(body, 60, seed)]
        .map(|avatar| BoundAvatar::new(&avatar, body).unwrap())
}

/// Largest difference of entries.
fn distance(a: &Mat3, b: &Mat3) -> f32 {
    (*a - *b).abs().to_cols_array().into_iter().fold(0.0, f32::max)
}

fn covariance(factor: &Mat3) -> DMat3 {
    factor.as_dmat3() * factor.as_dmat3().transpose()
}

/// The colour of Gaussian `i` seen along `direction`.
fn seen(posed: &OwnedPosed, i: usize, direction: DVec3) -> DVec3 {
    let frame = posed.view_frames.as_ref().map_or(DMat3::IDENTITY, |frames| frames[i].as_dmat3());
    let direction = (frame * direction).normalize().to_array();
    let count = sh::count(posed.sh_degree);
    let own: Vec<[f64; 3]> = posed.sh[i * count..(i + 1) * count].iter().map(|c| c.map(f64::from)).collect();
    DVec3::from_array(sh::evaluate(posed.sh_degree, &own, direction))
}

fn proper(strategy: &Strategy) -> bool {
    let by_average = strategy.covariance == CovarianceChoice::RotateByAverage;
    by_average
        || matches!(strategy.covariance, CovarianceChoice::Rotate | CovarianceChoice::Surfel)
            && strategy.rotation.to_string() != "matrix-to-quaternion-raw"
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn proper_strategies_give_rotations(seed in any::<u64>(), bend in 0.0..3.1f64) {
        let body = rig::body();
        let at = rig::bent(&body, seed, bend);
        for bound in avatars(&body, seed) {
            for strategy in rig::strategies().iter().filter(|s| proper(s)) {
                let result = posed(&bound, &body, &at, strategy);
                let rotations = result.rotations.as_ref().unwrap();
                for (i, (q, m)) in rotations.iter().zip(&result.factors).enumerate() {
                    let norm = q.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
                    prop_assert!((norm - 1.0).abs() < 2e-6, "{strategy}: |q| = {norm}");
                    let m = m.as_dmat3();
                    let scales = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
                    let r = m * DMat3::from_diagonal(scales.recip());
                    let error = (r.transpose() * r - DMat3::IDENTITY).abs().to_cols_array();
                    prop_assert!(error.iter().all(|e| *e < 1e-5), "{strategy}, Gaussian {i}: RᵀR");
                    prop_assert!((r.determinant() - 1.0).abs() < 1e-5, "{strategy}, Gaussian {i}: det");
                    let quat = glam::Quat::from_xyzw(q[1], q[2], q[3], q[0]).normalize();
                    prop_assert!(distance(&Mat3::from_quat(quat), &r.as_mat3()) < 1e-5, "{strategy}: q is R");
                }
            }
        }
    }

    #[test]
    fn a_motion_of_the_world_moves_everything(seed in any::<u64>(), bend in 0.0..1.2f64) {
        let body = rig::body();
        let at = rig::bent(&body, seed, bend);
        let mut noise = rig::Noise(seed ^ 1);
        let (turn, shift) = (DQuat::from_scaled_axis(noise.vector() * 2.0), noise.vector());
        let moved = rig::moved(&at, turn, shift);
        let q = DMat3::from_quat(turn);
        for bound in avatars(&body, seed) {
            for strategy in rig::strategies() {
                let (here, there) = (posed(&bound, &body, &at, &strategy), posed(&bound, &body, &moved, &strategy));
                let by_blend = matches!(
                    strategy.covariance, CovarianceChoice::Affine | CovarianceChoice::AffineConjugate);
                for i in 0..here.len() {
                    let mean = turn * here.means[i].as_dvec3() + shift;
                    prop_assert!(there.means[i].as_dvec3().distance(mean) < 3e-6, "{strategy}: mean {i}");
                    if by_blend || rig::equivariant(strategy.rotation) {
                        let expected = q * covariance(&here.factors[i]) * q.transpose();
                        let size = here.factors[i].as_dmat3().to_cols_array().iter().map(|c| c * c).sum::<f64>();
                        let error = (covariance(&there.factors[i]) - expected).abs().to_cols_array();
                        let worst = error.iter().fold(0.0f64, |m, &e| m.max(e));
                        prop_assert!(worst < 2e-4 * size, "{strategy}: covariance {i}, {worst:e} of {size:e}");
                    }
                    let by_blend = matches!(
                        strategy.colour, ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse);
                    let direction = noise.vector().normalize();
                    if strategy.colour == ColourChoice::None {
                        prop_assert_eq!(seen(&there, i, direction), seen(&here, i, direction));
                    } else if by_blend || rig::equivariant(strategy.rotation) {
                        let error = seen(&there, i, turn * direction).distance(seen(&here, i, direction));
                        prop_assert!(error < 2e-3, "{strategy}: colour {i}, {error:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn one_bone_leaves_nothing_to_choose(seed in any::<u64>()) {
        let body = rig::body();
        let at = rig::bent(&body, seed, 3.1);
        let mut avatar = rig::on_vertices(&body, 40, seed);
        let rows = (0..40).map(|i| [((seed as usize).wrapping_add(i) % rig::JOINTS, 1.0)]);
        avatar.binding = Binding::Vertex(SkinWeights::from_rows(rows, rig::JOINTS).unwrap());
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let base = strategy("quaternion-average");
        let average = posed(&bound, &body, &at, &base);
        for strategy in rig::strategies().iter().filter(|s| !s.rotation.needs_faces()) {
            let other = posed(&bound, &body, &at, &Strategy { rotation: strategy.rotation, ..base });
            for i in 0..40 {
                let scale = average.factors[i].x_axis.length().max(average.factors[i].y_axis.length());
                let scale = scale.max(average.factors[i].z_axis.length());
                let error = distance(&average.factors[i], &other.factors[i]);
                prop_assert!(error < 3e-6 * scale, "{strategy}: {error:e} of {scale:e}");
                prop_assert!(average.means[i].distance(other.means[i]) < 2e-6, "{strategy}");
            }
        }
        for exact in ["gram-schmidt-columns", "gram-schmidt-rows", "lbs-polar"] {
            let other = Strategy { rotation: exact.parse().unwrap(), ..base };
            prop_assert_eq!(&posed(&bound, &body, &at, &other), &average);
        }
    }

    #[test]
    fn the_sign_of_a_quaternion_says_nothing(seed in any::<u64>()) {
        let body = rig::body();
        let at = rig::bent(&body, seed, 1.5);
        let mut negated_pose = at.clone();
        negated_pose.locals.iter_mut().step_by(2).for_each(|local| local.rotation = -local.rotation);
        for avatar in [rig::on_vertices(&body, 30, seed), rig::on_faces(&body, 30, seed)] {
            let mut negated = avatar.clone();
            negated.gaussians.rotations.iter_mut().step_by(3).for_each(|q| *q = q.map(|c| -c));
            let (bound, other) =
                (BoundAvatar::new(&avatar, &body).unwrap(), BoundAvatar::new(&negated, &body).unwrap());
            for strategy in rig::strategies() {
                let a = posed(&bound, &body, &at, &strategy);
                let b = posed(&other, &body, &negated_pose, &strategy);
                prop_assert!(a.factors == b.factors && a.means == b.means && a.sh == b.sh, "{strategy}");
                prop_assert_eq!(&a.view_frames, &b.view_frames, "{}", strategy);
            }
        }
    }

    #[test]
    fn gaussians_do_not_know_their_neighbours(seed in any::<u64>()) {
        let body = rig::body();
        let at = rig::bent(&body, seed, 1.5);
        let avatar = rig::on_vertices(&body, 50, seed);
        let Binding::Vertex(weights) = &avatar.binding else { unreachable!() };
        let order: Vec<usize> = (0..50).map(|i| (i * 37 + 11) % 50).collect();
        let own = &avatar.gaussians;
        let rows = order.iter().map(|&i| {
            let (joints, weights) = weights.row(i);
            joints.iter().map(|&j| usize::from(j)).zip(weights.iter().copied()).collect::<Vec<_>>()
        });
        let permuted = Avatar {
            binding: Binding::Vertex(SkinWeights::from_rows(rows, rig::JOINTS).unwrap()),
            gaussians: Gaussians {
                means: order.iter().map(|&i| own.means[i]).collect(),
                rotations: order.iter().map(|&i| own.rotations[i]).collect(),
                log_scales: order.iter().map(|&i| own.log_scales[i]).collect(),
                opacity_logits: order.iter().map(|&i| own.opacity_logits[i]).collect(),
                sh_degree: 3,
                sh: order.iter().flat_map(|&i| own.sh[i * 16..(i + 1) * 16].to_vec()).collect(),
            },
        };
        let (a, b) = (BoundAvatar::new(&avatar, &body).unwrap(), BoundAvatar::new(&permuted, &body).unwrap());
        for strategy in rig::strategies() {
            let (a, b) = (posed(&a, &body, &at, &strategy), posed(&b, &body, &at, &strategy));
            for (k, &i) in order.iter().enumerate() {
                prop_assert!(a.means[i] == b.means[k] && a.factors[i] == b.factors[k], "{strategy}");
                prop_assert!(a.sh[i * 16..(i + 1) * 16] == b.sh[k * 16..(k + 1) * 16], "{strategy}");
                prop_assert_eq!(a.opacities[i], b.opacities[k]);
                let frame = |p: &OwnedPosed, i: usize| p.view_frames.as_ref().map(|f| f[i]);
                prop_assert_eq!(frame(&a, i), frame(&b, k));
            }
        }
    }

    #[test]
    fn the_polar_factor_of_the_blend_is_the_quaternion_average(seed in any::<u64>(), bend in 0.0..1.6f64) {
        let body = rig::body();
        let at = rig::bent(&body, seed, bend);
        for bound in avatars(&body, seed) {
            let average = posed(&bound, &body, &at, &strategy("quaternion-average"));
            for rotation in ["lbs-polar", "eigen", "polar"] {
                let rotation: RotationChoice = rotation.parse().unwrap();
                let other = Strategy { rotation, ..strategy("quaternion-average") };
                let other = posed(&bound, &body, &at, &other);
                let (a, b) = (average.rotations.as_ref().unwrap(), other.rotations.as_ref().unwrap());
                for (a, b) in a.iter().zip(b) {
                    let angle = angle_between(a.map(f64::from), b.map(f64::from));
                    // Rounding of the blend to f32, over the gap.
                    prop_assert!(angle < 1e-5, "{rotation}: {angle:e}");
                }
            }
        }
    }

    #[test]
    fn rotated_sh_are_sh_read_along_the_direction_turned_back(seed in any::<u64>()) {
        let body = rig::body();
        let at = rig::bent(&body, seed, 2.0);
        let mut noise = rig::Noise(seed);
        for bound in avatars(&body, seed) {
            for rotation in rig::strategies().iter().map(|s| s.rotation) {
                let base = Strategy { rotation, ..strategy("quaternion-average") };
                let by_view = Strategy { colour: ColourChoice::ViewRotation, ..base };
                let (a, b) = (posed(&bound, &body, &at, &base), posed(&bound, &body, &at, &by_view));
                prop_assert!(a.view_frames.is_none() && b.view_frames.is_some());
                for i in 0..a.len() {
                    let direction = noise.vector().normalize();
                    let error = seen(&a, i, direction).distance(seen(&b, i, direction));
                    prop_assert!(error < 1e-5, "{rotation}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn the_rest_pose_changes_nothing() {
    let body = rig::body();
    let rest = Pose::rest(&body.skeleton);
    for avatar in [rig::on_vertices(&body, 80, 3), rig::on_faces(&body, 80, 3)] {
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let expected = OwnedPosed::from_static(&avatar.gaussians);
        for strategy in rig::strategies() {
            let found = posed(&bound, &body, &rest, &strategy);
            for i in 0..80 {
                assert!(found.means[i].distance(expected.means[i]) < 1e-6, "{strategy}: mean {i}");
                // The two that change the canonical Gaussian have tests of their own.
                if matches!(strategy.covariance, CovarianceChoice::Rotate | CovarianceChoice::Affine) {
                    let scale =
                        expected.factors[i].to_cols_array().iter().fold(0.0f32, |m, c| m.max(c.abs()));
                    let error = distance(&found.factors[i], &expected.factors[i]);
                    assert!(error < 3e-6 * scale, "{strategy}: factor {i}, {error:e} of {scale:e}");
                }
                let direction = DVec3::new(0.3, -0.5, 0.8).normalize();
                let error = seen(&found, i, direction).distance(seen(&expected, i, direction));
                assert!(error < 1e-5, "{strategy}: colour {i}, {error:e}");
            }
            assert_eq!(found.opacities, expected.opacities);
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let body = rig::body();
    let at = rig::bent(&body, 5, 1.5);
    let with_threads = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let pools = [1, 2, 5].map(with_threads);
    for avatar in [rig::on_vertices(&body, 7_000, 6), rig::on_faces(&body, 7_000, 6)] {
        let bounds = pools.each_ref().map(|pool| pool.install(|| BoundAvatar::new(&avatar, &body).unwrap()));
        for preset in PRESETS {
            let [one, others @ ..] = [0, 1, 2]
                .map(|k: usize| pools[k].install(|| posed(&bounds[k], &body, &at, &preset.strategy)));
            others.iter().for_each(|other| assert_eq!(*other, one, "{}", preset.id));
        }
    }
}

/// `scale * LBS + transl` as a scaled root: a similarity of everything, under every strategy.
#[test]
fn a_body_that_is_scaled_as_a_whole_carries_its_gaussians_along() {
    let body = rig::body();
    for (seed, scale) in [(3, 1.25), (4, 0.01), (5, 100.0)] {
        let at = rig::bent(&body, seed, 1.0);
        let mut scaled = at.clone();
        scaled.locals[0].scale = DVec3::splat(scale);
        scaled.locals[0].translation *= scale;
        for bound in avatars(&body, seed) {
            for strategy in rig::strategies() {
                let (plain, large) =
                    (posed(&bound, &body, &at, &strategy), posed(&bound, &body, &scaled, &strategy));
                let (t, s) = (at.translation.as_vec3(), scale as f32);
                for i in 0..plain.len() {
                    let off = (large.means[i] - t) / s - (plain.means[i] - t);
                    assert!(
                        off.length() < 1e-3 / s.min(1.0) * 0.02 + 2e-4,
                        "{strategy}, {scale}: mean {i} by {off}"
                    );
                    let size = distance(&plain.factors[i], &Mat3::ZERO);
                    let off = distance(&(large.factors[i] * (1.0 / s)), &plain.factors[i]);
                    assert!(off < 2e-3 * size, "{strategy}, {scale}: factor {i} by {off} of {size}");
                    let direction = DVec3::new(0.3, -0.5, 0.8).normalize();
                    let off = (seen(&plain, i, direction) - seen(&large, i, direction)).length();
                    assert!(off < 5e-3, "{strategy}, {scale}: colour {i} by {off}");
                }
            }
        }
    }
}

/// Factors that are all 1 change no bit, and unequal ones are said.
#[test]
fn scales_of_one_cost_nothing_and_unequal_ones_are_named() {
    let body = rig::body();
    let mut at = rig::bent(&body, 9, 1.0);
    let posed_body = PosedBody::new(&body, &at).unwrap();
    let average = strategy("quaternion-average");
    assert_eq!(average.ignored_scale(&posed_body), None);
    at.locals[2].scale = DVec3::new(1.0, 1.2, 1.0);
    let posed_body = PosedBody::new(&body, &at).unwrap();
    assert_eq!(average.ignored_scale(&posed_body), Some(2));
    assert_eq!(strategy("quaternion-average+covariance=affine").ignored_scale(&posed_body), None);
}
