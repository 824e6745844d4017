//! Bodies and poses of other people's layouts, against the vertices that the smplx package makes of them
//! (tests/data/make/bodies.py).

use crate::support::data;
use skinsplat_core::scene::PosedBody;
use skinsplat_data::npz::Archive;
use skinsplat_data::{body, poses};
use std::path::PathBuf;

fn small(name: &str) -> PathBuf {
    data("small/bodies").join(name)
}

/// Posed vertices, frame after frame, and what was said on the way.
fn posed(model: &str, motion: &str) -> (Vec<f64>, Vec<String>) {
    let body::Loaded { body, mut notes } = body::read(&small(model)).unwrap();
    let track = poses::load(&small(motion)).unwrap();
    let (rest, shaped) = body::shape(&body, &track.betas, &track.expression).unwrap();
    notes.extend(shaped);
    notes.extend(track.notes_for(&rest.skeleton));
    let poses = track.poses(&rest.skeleton).unwrap();
    let vertices = poses.iter().flat_map(|pose| {
        let body = PosedBody::new(&rest, pose).unwrap();
        body.mesh().vertices.iter().flat_map(|v| v.to_array().map(f64::from)).collect::<Vec<_>>()
    });
    (vertices.collect(), notes)
}

#[test]
fn posed_vertices_are_those_of_the_smplx_package() {
    let mut expected = Archive::open(&small("expected.npz"), "vertices").unwrap();
    let cases = expected.names();
    assert_eq!(cases.len(), 13);
    for case in cases {
        let (motion, model) = case.split_once('/').unwrap();
        let answer = expected.require(&case, "T,V,3").unwrap().values;
        let (found, notes) = posed(model, motion);
        let size = answer.iter().fold(1.0f64, |size, v| size.max(v.abs()));
        let error = found.iter().zip(&answer).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{case}: {error:.1e} m at most of {size:.1}; {notes:?}");
        assert!(found.len() == answer.len() && error < 1e-5 * (size / 8.0).max(1.0), "{case}: {error:e}");
    }
}

#[test]
fn the_pickle_of_2015_is_the_same_body() {
    let expected = body::read(&small("smpl.npz")).unwrap();
    let found = body::read(&small("smpl.pkl")).unwrap();
    assert_eq!(found, expected);
    assert_eq!(found.body.rest.skeleton.names[23], "right_hand");
    let selected = body::load(&small("smpl_select.pkl")).unwrap();
    assert_eq!(selected.shape, expected.body.shape, "a slice of a longer constant");
}

#[test]
fn what_was_assumed_is_said() {
    let notes = |model: &str, motion: &str| posed(model, motion).1.join("\n");
    assert_eq!(notes("smpl.npz", "smpl_poses.npz"), "");
    assert!(
        notes("smpl.npz", "smpl_short_betas_poses.npz")
            .contains("betas: 4 values for a model of 10 directions")
    );
    assert!(notes("smplx.npz", "smplx_body_only_poses.npz").contains("mean hands are added"));
    assert!(!notes("smplx.npz", "smplx_flat_poses.npz").contains("mean hands"), "the file says so");
    let amass = notes("smplh.npz", "amass_poses.npz");
    assert!(
        amass.contains("without the body model's mean hands") && amass.contains("not read: dmpls"),
        "{amass}"
    );
    assert!(notes("smpl.npz", "hugs_poses.npz").contains("scaled by 1.25, varying"));
    let track = poses::load(&small("amass_poses.npz")).unwrap();
    assert_eq!((track.gender.as_deref(), track.framerate), (Some("neutral"), Some(120.0)));
    // Any body: the fingers of SMPL-H are left out on SMPL and find their joints on SMPL-X.
    assert!(
        notes("smpl.npz", "amass_poses.npz").contains("left_hand_pose, right_hand_pose: a body of 24 joints")
    );
    let betas = notes("smpl.npz", "amass_poses.npz");
    assert!(betas.contains("betas: 16 values for a model of 10 directions; the last 6 left out"), "{betas}");
    let body = body::load(&small("smplx.npz")).unwrap();
    let on_x = track.poses(&body.rest.skeleton).unwrap();
    let body_h = body::load(&small("smplh.npz")).unwrap();
    let on_h = track.poses(&body_h.rest.skeleton).unwrap();
    for frame in 0..2 {
        let turned = |pose: &skinsplat_core::scene::Pose, joint: usize| pose.locals[joint].rotation;
        assert_eq!(turned(&on_x[frame], 25), turned(&on_h[frame], 22), "left index");
        assert_eq!(turned(&on_x[frame], 54), turned(&on_h[frame], 51), "right thumb");
        assert_eq!(turned(&on_x[frame], 22), glam::DQuat::IDENTITY, "the jaw rests");
    }
}

#[test]
fn principal_hands_need_a_model_that_has_them() {
    let track = poses::load(&small("smplx_principal_poses.npz")).unwrap();
    let without = body::load(&data("small/tiny/models/body.npz")).unwrap();
    assert_eq!(track.poses(&without.rest.skeleton).unwrap_err().field(), "jaw_pose");
    let mut body = body::load(&small("smplx.npz")).unwrap();
    body.rest.skeleton.hands = None;
    let error = track.poses(&body.rest.skeleton).unwrap_err();
    assert_eq!(error.field(), "left_hand_pose");
    assert!(
        error.to_string().contains("6 principal coefficients for a body model with 0 components"),
        "{error}"
    );
}
