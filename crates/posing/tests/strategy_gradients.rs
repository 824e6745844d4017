//! The adjoint of posing against differences of posing itself, for every strategy and every kind of parameter.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/posing_gradients.rs"]
mod posing_gradients;
#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::DVec3;
use posing_gradients::{Case, Parameter, chooses, kinds, upstream};
use skinsplat_core::scene::{Avatar, AvatarGradient, Binding, PosedBody, PosedGradient};
use skinsplat_posing::{
    ClampChoice, ColourChoice, CovarianceChoice, LbsProjection, PRESETS, PoseOptions, Poser, PosingError,
    RotationChoice, Strategy, pose,
};

const N: usize = 80;

/// The avatar with the lower bands of its SH.
fn with_degree(mut avatar: Avatar, degree: usize) -> Avatar {
    let (count, kept) = (avatar.gaussians.sh_count(), (degree + 1).pow(2));
    let bands = avatar.gaussians.sh.chunks(count).flat_map(|own| own[..kept].to_vec()).collect();
    (avatar.gaussians.sh, avatar.gaussians.sh_degree) = (bands, degree);
    avatar
}

/// Every kind of parameter but SH. f32 rounding of the outputs over the step leaves 4e-5; curvature adds to it next to
/// places where the strategy chooses, and where the corners' normals nearly cancel (see
/// [`positions_on_faces_in_f64`]).
fn assert_parameters(case: &Case<'_>, strategy: &Strategy, seed: u64) {
    let upstream = upstream(&pose(&case.bound, case.body, strategy).unwrap(), seed);
    for kind in kinds(matches!(case.avatar.binding, Binding::Face(_))) {
        let curved = chooses(strategy) || matches!(kind[0], Parameter::Barycentric(_));
        // On this body weights jump from vertex to vertex: `push_forward.rs` follows means on one where they do not.
        if rig::pushes(strategy) && matches!(kind[0], Parameter::Mean(_) | Parameter::Offset) {
            continue;
        }
        let tolerance = if curved { 2e-4 } else { 5e-5 };
        let (error, switching) = case.error(strategy, &upstream, &kind);
        assert!(error < tolerance, "{strategy}: {kind:?} is off by {error:e}");
        assert!(switching * 7 <= case.bound.len(), "{strategy}: {kind:?}, {switching} switch");
    }
}

/// SH are linear in SH: ⟨J v, u⟩ = ⟨v, Jᵀ u⟩ for any v in the place of the coefficients.
fn assert_sh(case: &Case<'_>, strategy: &Strategy, seed: u64) {
    let upstream = upstream(&pose(&case.bound, case.body, strategy).unwrap(), seed);
    let gradient = case.gradient(strategy, &upstream);
    let mut noise = rig::Noise(seed ^ 77);
    for _ in 0..3 {
        let mut direction = case.avatar.clone();
        direction.gaussians.sh.iter_mut().for_each(|c| *c = noise.vector().as_vec3().to_array());
        let mut bound = case.bound.clone();
        bound.update(&direction).unwrap();
        let moved = pose(&bound, case.body, strategy).unwrap();
        let count = direction.gaussians.sh_count();
        for i in 0..bound.len() {
            let own = i * count..(i + 1) * count;
            let dot = |a: &[[f32; 3]], b: &[[f32; 3]]| {
                let products = a[own.clone()].as_flattened().iter().zip(b[own.clone()].as_flattened());
                products.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()
            };
            let (forth, back) = (dot(&moved.sh, &upstream.sh), dot(&direction.gaussians.sh, &gradient.sh));
            assert!((forth - back).abs() < 2e-6 * count as f64, "{strategy}: SH of {i}, {forth} and {back}");
        }
    }
}

fn avatars(body: &PosedBody<'_>, seed: u64) -> [Avatar; 2] {
    [rig::on_vertices(body.rest, N, seed), rig::on_faces(body.rest, N, seed)]
}

#[test]
fn every_preset_and_every_degree() {
    let rest = rig::body();
    let at = rig::bent(&rest, 8, 1.2);
    let body = PosedBody::new(&rest, &at).unwrap();
    for (seed, preset) in (0..).zip(PRESETS) {
        for avatar in avatars(&body, seed) {
            for degree in 0..=3 {
                let case = Case::new(with_degree(avatar.clone(), degree), &body);
                assert_parameters(&case, &preset.strategy, seed);
                assert_sh(&case, &preset.strategy, seed);
            }
        }
    }
}

#[test]
fn every_choice_of_every_axis() {
    let rest = rig::body();
    let at = rig::bent(&rest, 4, 0.9);
    let body = PosedBody::new(&rest, &at).unwrap();
    for (seed, strategy) in (0..).zip(rig::strategies()) {
        for avatar in avatars(&body, seed) {
            let case = Case::new(with_degree(avatar, 2), &body);
            assert_parameters(&case, &strategy, seed);
            assert_sh(&case, &strategy, seed);
        }
    }
}

/// Joints that scale: log scales, offsets and means of dual quaternions grow along, and their derivatives with them.
#[test]
fn every_choice_on_joints_that_scale() {
    let rest = rig::body();
    let at = rig::scaled(&rig::bent(&rest, 4, 0.9), 6);
    let body = PosedBody::new(&rest, &at).unwrap();
    for (seed, strategy) in (0..).zip(rig::strategies()) {
        for avatar in avatars(&body, seed) {
            let case = Case::new(with_degree(avatar, 1), &body);
            assert_parameters(&case, &strategy, seed);
            assert_sh(&case, &strategy, seed);
        }
    }
}

#[test]
fn no_preset_and_no_choice_is_missed() {
    let all = rig::strategies();
    assert!(PRESETS.iter().all(|preset| all.contains(&preset.strategy)));
    for rotation in RotationChoice::named() {
        assert!(
            all.iter().any(|s| s.rotation == rotation && s.colour == ColourChoice::RotateSh),
            "{rotation}"
        );
        assert!(
            all.iter().any(|s| s.rotation == rotation && s.covariance == CovarianceChoice::Surfel),
            "{rotation}"
        );
    }
    assert!(CovarianceChoice::ALL.iter().all(|&choice| all.iter().any(|s| s.covariance == choice)));
    assert!(ColourChoice::ALL.iter().all(|&choice| all.iter().any(|s| s.colour == choice)));
    assert!(ClampChoice::ALL.iter().all(|&choice| all.iter().any(|s| s.clamp == choice)));
    // R depends on R_c here, so the SH that turn with it do: not reached by a preset.
    let converted = |s: &&Strategy| s.rotation == RotationChoice::Lbs(LbsProjection::MatrixToQuaternion);
    assert!(all.iter().filter(converted).any(|s| s.colour == ColourChoice::RotateSh));
}

/// `Σ b v + unit(Σ b n) offset` in f64, and its central differences.
#[test]
fn positions_on_faces_in_f64() {
    let rest = rig::body();
    let body = PosedBody::new(&rest, &rig::bent(&rest, 4, 0.9)).unwrap();
    let mesh = body.mesh();
    for seed in 0..10 {
        let case = Case::new(rig::on_faces(&rest, N, seed), &body);
        let strategy = PRESETS[0].strategy;
        let upstream = upstream(&pose(&case.bound, &body, &strategy).unwrap(), seed);
        let gradient = case.gradient(&strategy, &upstream);
        let Binding::Face(binding) = &case.avatar.binding else { unreachable!() };
        for i in 0..N {
            let corners = rest.faces[binding.faces[i] as usize].map(|v| v as usize);
            let loss = |[a, b, c, offset]: [f64; 4]| {
                let mix = |values: &[glam::Vec3]| -> DVec3 {
                    corners.iter().zip([a, b, c]).map(|(&v, b)| values[v].as_dvec3() * b).sum()
                };
                let point = mix(&mesh.vertices) + mix(&mesh.normals).normalize() * offset;
                point.dot(upstream.means[i].as_dvec3())
            };
            let [a, b, c] = binding.barycentric[i].map(f64::from);
            let at = [a, b, c, f64::from(binding.offsets[i])];
            let [x, y, z] = gradient.barycentric[i];
            for (k, found) in [x, y, z, gradient.offsets[i]].into_iter().enumerate() {
                let slope = |h: f64| {
                    let mut ends = [at; 2];
                    (ends[0][k], ends[1][k]) = (at[k] + h, at[k] - h);
                    (loss(ends[0]) - loss(ends[1])) / (2.0 * h)
                };
                let expected = (4.0 * slope(1e-4) - slope(2e-4)) / 3.0;
                assert!((f64::from(found) - expected).abs() < 2e-6, "{i}, {k}: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn joints_that_scale_are_followed() {
    let rest = rig::body();
    let mut at = rig::bent(&rest, 6, 0.8);
    at.locals[1].scale = DVec3::new(1.3, 0.8, 1.1);
    at.locals[3].scale = DVec3::splat(0.7);
    let body = PosedBody::new(&rest, &at).unwrap();
    // What engines do is drawn, not fitted: the derivative of a normalised conversion under unequal scales is off by 5e-3.
    for (seed, preset) in (0..).zip(PRESETS.iter().filter(|preset| !preset.is_engine())) {
        for avatar in avatars(&body, seed) {
            assert_parameters(&Case::new(avatar, &body), &preset.strategy, seed);
        }
    }
}

/// Every number of a gradient.
fn entries(gradient: &AvatarGradient) -> Vec<f32> {
    let AvatarGradient { means, rotations, log_scales, opacity_logits, sh, barycentric, offsets } = gradient;
    let vectors = means.iter().chain(log_scales).flat_map(|v| v.to_array());
    let arrays = sh.iter().chain(barycentric).flatten().chain(rotations.iter().flatten());
    vectors.chain(arrays.chain(opacity_logits).chain(offsets).copied()).collect()
}

#[test]
fn static_avatars_are_followed_too() {
    let rest = rig::body();
    let body = PosedBody::new(&rest, &rig::bent(&rest, 6, 0.8)).unwrap();
    let mut avatar = rig::on_vertices(&rest, N, 2);
    avatar.binding = Binding::Static;
    let case = Case::new(avatar, &body);
    for preset in PRESETS {
        assert_parameters(&case, &preset.strategy, 1);
        assert_sh(&case, &preset.strategy, 1);
    }
}

#[test]
fn a_body_shrunk_to_a_point_has_finite_gradients() {
    let rest = rig::body();
    let mut at = rig::bent(&rest, 6, 0.8);
    at.locals[0].scale = DVec3::ZERO;
    let body = PosedBody::new(&rest, &at).unwrap();
    for avatar in avatars(&body, 3) {
        let case = Case::new(avatar, &body);
        for strategy in rig::strategies() {
            let posed = pose(&case.bound, &body, &strategy).unwrap();
            let gradient = case.gradient(&strategy, &upstream(&posed, 4));
            assert!(entries(&gradient).iter().all(|g| g.is_finite()), "{strategy}");
        }
    }
}

#[test]
fn frames_of_a_batch_add_up() {
    let rest = rig::body();
    for avatar in [rig::on_vertices(&rest, N, 5), rig::on_faces(&rest, N, 5)] {
        for preset in PRESETS {
            let mut sum = AvatarGradient::default();
            let face_bound = matches!(avatar.binding, Binding::Face(_));
            sum.reset(&avatar.gaussians, face_bound);
            let mut expected = vec![0.0; entries(&sum).len()];
            for seed in 0..3 {
                let body = PosedBody::new(&rest, &rig::bent(&rest, seed, 1.0)).unwrap();
                let case = Case::new(avatar.clone(), &body);
                let upstream = upstream(&pose(&case.bound, &body, &preset.strategy).unwrap(), seed);
                let Case { bound, .. } = &case;
                let (strategy, options) = (&preset.strategy, PoseOptions::default());
                Poser::new()
                    .backward(bound, &body, strategy, &options, &avatar.gaussians, &upstream, &mut sum)
                    .unwrap();
                let one = entries(&case.gradient(&preset.strategy, &upstream));
                expected.iter_mut().zip(one).for_each(|(sum, own)| *sum += own);
            }
            assert_eq!(entries(&sum), expected, "{}", preset.id);
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let rest = rig::body();
    let body = PosedBody::new(&rest, &rig::bent(&rest, 5, 1.5)).unwrap();
    let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for avatar in [rig::on_vertices(&rest, 5_000, 6), rig::on_faces(&rest, 5_000, 6)] {
        let moved = Parameter::Rotation(1).moved(&avatar, 1.0).0;
        for preset in PRESETS {
            let [one, two] = pools.each_ref().map(|pool| {
                pool.install(|| {
                    let mut case = Case::new(avatar.clone(), &body);
                    case.bound.update(&moved).unwrap();
                    case.avatar = moved.clone();
                    let posed = pose(&case.bound, &body, &preset.strategy).unwrap();
                    entries(&case.gradient(&preset.strategy, &upstream(&posed, 1)))
                        .iter()
                        .map(|g| g.to_bits())
                        .collect::<Vec<_>>()
                })
            });
            assert!(one == two, "{}", preset.id);
        }
    }
}

#[test]
fn arrays_that_do_not_fit_are_named() {
    let rest = rig::body();
    let body = PosedBody::new(&rest, &rig::bent(&rest, 5, 0.5)).unwrap();
    let case = Case::new(rig::on_faces(&rest, N, 1), &body);
    let strategy = PRESETS[0].strategy;
    let good = upstream(&pose(&case.bound, &body, &strategy).unwrap(), 1);
    let mut fitting = AvatarGradient::default();
    fitting.reset(&case.avatar.gaussians, true);
    let attempt = |upstream: &PosedGradient, avatar: &Avatar, mut gradient: AvatarGradient| {
        let before = gradient.clone();
        let Case { bound, .. } = &case;
        let (gaussians, options) = (&avatar.gaussians, PoseOptions::default());
        let result =
            Poser::new().backward(bound, &body, &strategy, &options, gaussians, upstream, &mut gradient);
        assert_eq!(gradient, before);
        match result.unwrap_err() {
            PosingError::Scene(error) => error.field,
            other => panic!("{other}"),
        }
    };
    let mut short = good.clone();
    short.factors.pop();
    assert_eq!(attempt(&short, &case.avatar, fitting.clone()), "gradient of the factors");
    let lower = with_degree(case.avatar.clone(), 1);
    assert_eq!(attempt(&good, &lower, fitting.clone()), "f_dc/f_rest");
    let mut not_embedded = fitting.clone();
    not_embedded.offsets.clear();
    assert_eq!(attempt(&good, &case.avatar, not_embedded), "gradient of offset");
}
