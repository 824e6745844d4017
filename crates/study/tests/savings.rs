//! What is left out where it is not needed changes nothing that is claimed not to change.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::DVec3;
use proptest::prelude::{ProptestConfig, any, prop_assert, prop_assert_eq, proptest};
use skinsplat_core::scene::{Camera, PosedBody};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy, pose};
use skinsplat_render::View;
use skinsplat_render::splat::{Renderer, render};
use skinsplat_study::trade::savings::{Options, Same, measure};

#[test]
fn every_saving_keeps_what_it_claims() {
    let options = Options { resolution: 96, edge: 0.08, poses: 2, runs: 1, ..Options::default() };
    let savings = measure(&options).unwrap();
    assert_eq!(savings.len(), 9);
    for saving in &savings {
        assert!(!matches!(saving.result, Same::Different { .. }), "{}: {}", saving.what, saving.result);
        assert!(saving.without.low > 0.0 && saving.with.low > 0.0, "{}", saving.what);
    }
    let identical = savings.iter().filter(|saving| saving.result == Same::Identical).count();
    assert_eq!(identical, 7, "{savings:#?}");
    let again = measure(&options).unwrap();
    for (a, b) in savings.iter().zip(&again) {
        assert_eq!((&a.what, &a.result), (&b.what, &b.result));
    }
}

#[test]
fn unknown_subjects_are_refused_by_name() {
    let error = measure(&Options { subject: "nobody".into(), ..Options::default() }).unwrap_err().to_string();
    assert!(error.contains("nobody") && error.contains("stripes"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Any camera, also within the body: the image of Gaussians that were left out where the camera does not look.
    #[test]
    fn what_is_not_seen_is_not_missed(
        seed in any::<u64>(),
        eye in proptest::array::uniform3(-1.5f64..1.5),
        focal in 5.0f64..400.0,
        shift in -60.0f64..60.0,
    ) {
        let body = rig::body();
        let avatar = rig::on_vertices(&body, 300, seed);
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let posed_body = PosedBody::new(&body, &rig::bent(&body, seed, 1.0)).unwrap();
        let target = DVec3::new(0.4, 0.0, 0.01 * shift);
        let mut camera = Camera::look_at(DVec3::from_array(eye), target, DVec3::Y, focal, 72, 40);
        camera.cx += shift;
        let view = View::new(&camera);
        for spec in ["quaternion-average", "quaternion-average+colour=view-rotation", "lbs", "view-canonical"] {
            let strategy: Strategy = spec.parse().unwrap();
            let mut renderer = Renderer::new();
            // Memory of another pose must not shine through.
            let mut poser = Poser::new();
            let all = poser.pose(&bound, &posed_body, &strategy, &PoseOptions::default()).unwrap();
            let full = renderer.render(&all, &view).unwrap().clone();
            let visible = renderer.visible();
            let options = PoseOptions { seen_by: Some(&camera), ..PoseOptions::default() };
            let seen = poser.pose(&bound, &posed_body, &strategy, &options).unwrap();
            prop_assert!(&full == renderer.render(&seen, &view).unwrap(), "{spec}");
            prop_assert_eq!(visible, renderer.visible());
        }
    }

    /// Bands of zeros, dropped.
    #[test]
    fn zero_bands_change_no_bit(seed in any::<u64>(), degree in 0usize..4) {
        let body = rig::body();
        let mut avatar = rig::on_vertices(&body, 200, seed);
        for own in avatar.gaussians.sh.chunks_exact_mut(16) {
            own[(degree + 1).pow(2)..].fill([0.0; 3]);
        }
        let stored = BoundAvatar::new(&avatar, &body).unwrap();
        prop_assert_eq!(stored.sh_degree_present(), degree);
        let needed = stored.clone().without_zero_bands();
        let posed_body = PosedBody::new(&body, &rig::bent(&body, seed, 1.0)).unwrap();
        let camera = Camera::look_at(DVec3::new(0.4, 0.3, 1.2), DVec3::X * 0.4, DVec3::Y, 60.0, 64, 48);
        for strategy in [Strategy::preset("quaternion-average").unwrap(), Strategy::preset("lbs").unwrap()] {
            let image = |bound: &BoundAvatar| {
                let posed = pose(bound, &posed_body, &strategy).unwrap();
                render(&posed.as_posed(), &View::new(&camera)).unwrap()
            };
            prop_assert!(image(&stored) == image(&needed), "{strategy}");
        }
    }
}
