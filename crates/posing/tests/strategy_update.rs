//! Avatars that take over changed parameters in place, and poses into memory of before.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/rig.rs"]
mod rig;

use skinsplat_core::scene::{Avatar, Binding, Gaussians, OwnedPosed, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, PRESETS, PoseOptions, Poser, PosingError, pose};

const N: usize = 3_000;

/// Other values for all that an optimiser changes, of an SH degree of its own. Barycentric coordinates are left alone:
/// they would mix other skinning weights.
fn changed(avatar: &Avatar, seed: u64, sh_degree: usize) -> Avatar {
    let mut noise = rig::Noise(seed);
    let means = avatar.gaussians.means.iter().map(|&mean| mean + noise.vector().as_vec3() * 1e-6).collect();
    let mut changed = avatar.clone();
    changed.gaussians = rig::gaussians(means, seed, sh_degree);
    if let Binding::Face(binding) = &mut changed.binding {
        binding.offsets.iter_mut().for_each(|offset| *offset += 0.01 * noise.next() as f32);
    }
    changed
}

#[test]
fn an_updated_avatar_is_a_freshly_bound_one() {
    let body = rig::body();
    let at = rig::bent(&body, 3, 1.0);
    let posed_body = PosedBody::new(&body, &at).unwrap();
    let static_one = Avatar { binding: Binding::Static, ..rig::on_vertices(&body, N, 1) };
    for avatar in [rig::on_vertices(&body, N, 1), rig::on_faces(&body, N, 1), static_one] {
        let mut updated = BoundAvatar::new(&avatar, &body).unwrap();
        for (seed, degree) in [(5, 3), (6, 0), (7, 2)] {
            let mut next = changed(&avatar, seed, degree);
            if matches!(next.binding, Binding::Vertex(_)) {
                // The nearest faces, and points on them, stay those of the means at binding.
                next.gaussians.means.clone_from(&avatar.gaussians.means);
            }
            updated.update(&next).unwrap();
            let fresh = BoundAvatar::new(&next, &body).unwrap();
            for strategy in rig::strategies() {
                let (a, b) = (pose(&updated, &posed_body, &strategy), pose(&fresh, &posed_body, &strategy));
                assert!(a.unwrap() == b.unwrap(), "{strategy}, degree {degree}");
            }
        }
    }
}

#[test]
fn means_and_coordinates_are_read_again() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 3, 1.0)).unwrap();
    let lbs = PRESETS[0].strategy;
    let free = rig::on_vertices(&body, 50, 2);
    let next = changed(&free, 9, 0);
    let mut updated = BoundAvatar::new(&free, &body).unwrap();
    updated.update(&next).unwrap();
    let fresh = BoundAvatar::new(&next, &body).unwrap();
    let means = |bound: &BoundAvatar| pose(bound, &posed_body, &lbs).unwrap().means;
    assert_eq!(means(&updated), means(&fresh));
    assert_ne!(means(&updated), means(&BoundAvatar::new(&free, &body).unwrap()));

    let seated = rig::on_faces(&body, 50, 2);
    let mut next = seated.clone();
    let Binding::Face(binding) = &mut next.binding else { unreachable!() };
    binding.barycentric.iter_mut().for_each(|[a, b, _]| (*a, *b) = (*a - 0.125, *b + 0.125));
    let mut updated = BoundAvatar::new(&seated, &body).unwrap();
    updated.update(&next).unwrap();
    let fresh = BoundAvatar::new(&next, &body).unwrap();
    assert_eq!(means(&updated), means(&fresh));
    assert_eq!(
        (0..50).map(|i| updated.face(i)).collect::<Vec<_>>(),
        (0..50).map(|i| fresh.face(i)).collect::<Vec<_>>()
    );
    let by_vertices = "quaternion-average+rotation=vertex-average+colour=none".parse().unwrap();
    let turned = |bound: &BoundAvatar| pose(bound, &posed_body, &by_vertices).unwrap().factors;
    assert_eq!(turned(&updated), turned(&fresh));
}

#[test]
fn what_cannot_be_taken_over_is_named() {
    let body = rig::body();
    let avatar = rig::on_faces(&body, 20, 1);
    let before = pose_of(&BoundAvatar::new(&avatar, &body).unwrap(), &body);
    let mut bound = BoundAvatar::new(&avatar, &body).unwrap();
    let mut attempt = |change: &dyn Fn(&mut Avatar), field: &str| {
        let mut next = changed(&avatar, 4, 1);
        change(&mut next);
        match bound.update(&next).unwrap_err() {
            PosingError::Scene(error) => assert_eq!(error.field, field, "{error}"),
            other => panic!("{other}"),
        }
        assert!(pose_of(&bound, &body) == before, "{field}: nothing changes");
    };
    fn binding(avatar: &mut Avatar) -> &mut skinsplat_core::scene::FaceBinding {
        let Binding::Face(binding) = &mut avatar.binding else { unreachable!() };
        binding
    }
    attempt(&|next| next.binding = Binding::Static, "binding");
    attempt(&|next| next.gaussians = Gaussians::default(), "x, y, z");
    attempt(&|next| next.gaussians.rotations.truncate(3), "rot");
    attempt(&|next| next.gaussians.sh_degree = 2, "f_dc/f_rest");
    attempt(&|next| next.gaussians.sh_degree = usize::MAX, "f_rest");
    attempt(&|next| binding(next).offsets.truncate(3), "offset");
    attempt(&|next| binding(next).faces[7] ^= 1, "face[7]");
}

fn pose_of(bound: &BoundAvatar, body: &RestBody) -> OwnedPosed {
    let at = rig::bent(body, 3, 1.0);
    pose(bound, &PosedBody::new(body, &at).unwrap(), &PRESETS[3].strategy).unwrap()
}

#[test]
fn memory_of_before_leaves_no_trace() {
    let body = rig::body();
    let posed_body = PosedBody::new(&body, &rig::bent(&body, 3, 1.0)).unwrap();
    let (mut poser, options) = (Poser::new(), PoseOptions::default());
    for n in [N, 100, 2 * N] {
        for avatar in [rig::on_vertices(&body, n, 1), rig::on_faces(&body, n, 1)] {
            let bound = BoundAvatar::new(&avatar, &body).unwrap();
            for preset in PRESETS {
                let posed = poser.pose(&bound, &posed_body, &preset.strategy, &options).unwrap();
                let fresh = pose(&bound, &posed_body, &preset.strategy).unwrap();
                assert!(posed == fresh.as_posed(), "{}", preset.id);
                let memory = posed.means.as_ptr();
                let again = poser.pose(&bound, &posed_body, &preset.strategy, &options).unwrap();
                assert_eq!(again.means.as_ptr(), memory, "{}", preset.id);
            }
        }
    }
}
