//! Rotations that somebody else has computed, in place of a strategy's.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use skinsplat_core::math::rotation::{conjugate, multiply, normalize};
use skinsplat_core::scene::{Avatar, AvatarGradient, Binding, PosedBody, PosedGradient};
use skinsplat_posing::{
    BoundAvatar, ColourChoice, CovarianceChoice, PoseOptions, Poser, PosingError, Strategy,
};

const N: usize = 300;

/// R of every Gaussian as a strategy made it.
fn rotations(avatar: &Avatar, posed: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let relative = |(i, q): (usize, &[f32; 4])| {
        let canonical = avatar.gaussians.unit_rotation(i).map(f64::from);
        normalize(multiply(q.map(f64::from), conjugate(canonical))).unwrap().map(|c| c as f32)
    };
    posed.iter().enumerate().map(relative).collect()
}

fn gradient_of(
    avatar: &Avatar,
    bound: &BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
    options: &PoseOptions<'_>,
    upstream: &PosedGradient,
) -> AvatarGradient {
    let mut gradient = AvatarGradient::default();
    gradient.reset(&avatar.gaussians, matches!(avatar.binding, Binding::Face(_)));
    let gaussians = &avatar.gaussians;
    Poser::new().backward(bound, body, strategy, options, gaussians, upstream, &mut gradient).unwrap();
    gradient
}

#[test]
fn the_average_by_hand_poses_as_the_average() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 7, 1.0)).unwrap();
    for avatar in [rig::on_vertices(&body, N, 3), rig::on_faces(&body, N, 3)] {
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        for colour in [ColourChoice::RotateSh, ColourChoice::ViewRotation] {
            let strategy = Strategy { colour, ..Strategy::preset("quaternion-average").unwrap() };
            let (mut one, mut other) = (Poser::new(), Poser::new());
            let expected = one.pose(&bound, &posed_body, &strategy, &PoseOptions::default()).unwrap();
            let own = rotations(&avatar, expected.rotations.unwrap());
            // What the strategy itself would do is not read.
            let base = Strategy { rotation: "face-haha-scaled".parse().unwrap(), ..strategy };
            let options = PoseOptions { rotations: Some(&own), ..PoseOptions::default() };
            let found = other.pose(&bound, &posed_body, &base, &options).unwrap();
            assert_eq!(found.means, expected.means);
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-6);
            for (a, b) in found.factors.iter().zip(expected.factors) {
                assert!(close(&a.to_cols_array(), &b.to_cols_array()));
            }
            assert!(close(found.sh.as_flattened(), expected.sh.as_flattened()));
            assert_eq!(found.view_frames.is_some(), colour == ColourChoice::ViewRotation);
            for (a, b) in found.view_frames.iter().zip(&expected.view_frames) {
                assert!(a.iter().zip(*b).all(|(a, b)| close(&a.to_cols_array(), &b.to_cols_array())));
            }

            let upstream = PosedGradient {
                means: expected.means.to_vec(),
                factors: expected.factors.to_vec(),
                opacities: expected.opacities.to_vec(),
                sh: expected.sh.to_vec(),
                ..PosedGradient::default()
            };
            let none = PoseOptions::default();
            let by_strategy = gradient_of(&avatar, &bound, &posed_body, &strategy, &none, &upstream);
            let by_hand = gradient_of(&avatar, &bound, &posed_body, &base, &options, &upstream);
            assert!(close(by_hand.rotations.as_flattened(), by_strategy.rotations.as_flattened()));
            assert_eq!((by_hand.means, by_hand.log_scales.len()), (by_strategy.means, N));
        }
    }
}

#[test]
fn rotations_that_do_not_fit_are_named() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 7, 1.0)).unwrap();
    let bound = BoundAvatar::new(&rig::on_vertices(&body, N, 3), &body).unwrap();
    let strategy = Strategy::preset("lbs").unwrap();
    let field = |rotations: &[[f32; 4]]| {
        let options = PoseOptions { rotations: Some(rotations), ..PoseOptions::default() };
        match Poser::new().pose(&bound, &posed_body, &strategy, &options).unwrap_err() {
            PosingError::Scene(error) => error.field,
            other => panic!("{other}"),
        }
    };
    assert_eq!(field(&[[1.0, 0.0, 0.0, 0.0]; N - 1]), "rotations");
    for bad in [[2.0, 0.0, 0.0, 0.0], [0.0; 4], [f32::NAN; 4]] {
        let mut rotations = [[1.0, 0.0, 0.0, 0.0]; N];
        rotations[17] = bad;
        assert_eq!(field(&rotations), "rotations[17]");
    }
}

/// A body without faces has no face frames, and needs none where rotations are given; a disc still does.
#[test]
fn what_is_not_read_is_not_asked_for() {
    let mut body = rig::body();
    let avatar = rig::on_vertices(&body, N, 3);
    body.faces.clear();
    body.uv = None;
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 7, 1.0)).unwrap();
    let rotations = [[1.0, 0.0, 0.0, 0.0]; N];
    let options = PoseOptions { rotations: Some(&rotations), ..PoseOptions::default() };
    let strategy = Strategy::preset("face-tbn").unwrap();
    let mut poser = Poser::new();
    assert!(poser.pose(&bound, &posed_body, &strategy, &PoseOptions::default()).is_err());
    let posed = poser.pose(&bound, &posed_body, &strategy, &options).unwrap();
    assert_eq!(posed.rotations.unwrap(), avatar.gaussians.unit_rotations());
    let discs = Strategy { covariance: CovarianceChoice::Surfel, ..strategy };
    assert!(poser.pose(&bound, &posed_body, &discs, &options).is_err());
}
