//! Subjects in the layouts of other people, written by other people's libraries (tests/data/make/layouts.py): the same person
//! through every layout, answers of NumPy where the person is made up, and what damaged folders say.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "layouts/bad_folders.rs"]
mod bad_folders;
#[path = "layouts/betas.rs"]
mod betas;
#[path = "layouts/made_up.rs"]
mod made_up;
#[path = "layouts/names.rs"]
mod names;
#[path = "../../../tests/support/mod.rs"]
mod support;
#[path = "../../../tests/support/files.rs"]
mod support_files;

use skinsplat_core::scene::PosedBody;
use skinsplat_data::folder::Options;
use skinsplat_data::layouts::{Layout, Request, Split};
use skinsplat_data::{Capture, Error, Sequence, Subject};
use std::path::{Path, PathBuf};

/// A folder of tests/data/small/layouts.
fn place(name: &str) -> PathBuf {
    support::data("small/layouts").join(name)
}

/// A body model of the Blender set.
fn model(name: &str) -> Option<PathBuf> {
    Some(support::data("blender/models").join(name))
}

/// What the person of the Blender set is trained and tested on.
const SPLIT: Split = Split { train: [0, 5, 1], test: [6, 7, 1] };

fn load(
    layout: &str,
    folder: &Path,
    model: Option<PathBuf>,
    split: Option<&Split>,
) -> Result<Subject, Error> {
    let options = Options { model, ..Options::default() };
    (Layout::named(layout).unwrap().load)(&Request { folder, split, options: &options })
}

fn ava(layout: &str, name: &str) -> Subject {
    load(layout, &place(name), model("anny_smpl24.npz"), Some(&SPLIT)).unwrap()
}

/// Posed vertices of a frame.
fn posed(sequence: &Sequence, frame: usize) -> Vec<glam::DVec3> {
    let pose = &sequence.poses[sequence.frames[frame].pose];
    let body = PosedBody::new(&sequence.body, pose).unwrap();
    body.mesh().vertices.iter().map(|v| v.as_dvec3()).collect()
}

/// That two sequences show the same: vertices, their pixels, pictures and masks.
#[track_caller]
fn assert_same(a: &Sequence, b: &Sequence, what: &str) {
    assert_eq!(a.frames.len(), b.frames.len(), "{what}");
    for frame in 0..a.frames.len() {
        let (p, q) = (posed(a, frame), posed(b, frame));
        let far = p.iter().zip(&q).map(|(p, q)| (*p - *q).length()).fold(0.0, f64::max);
        assert!(far < 1e-5, "{what}, frame {frame}: vertices {far} m apart");
        let camera = |s: &Sequence| s.cameras[s.frames[frame].camera].clone();
        let (c, d) = (camera(a), camera(b));
        for point in p.iter().step_by(997) {
            let (u, v) = (c.project(*point).unwrap().0, d.project(*point).unwrap().0);
            assert!((u - v).length() < 1e-4, "{what}, frame {frame}: {u} and {v}");
        }
        let (s, t) = (a.truth(frame).unwrap(), b.truth(frame).unwrap());
        let levels = |x: f32, y: f32| (x - y).abs() * 255.0;
        let off = s.rgb.pixels().as_flattened().iter().zip(t.rgb.pixels().as_flattened());
        let off = off.map(|(x, y)| levels(*x, *y)).fold(0.0, f32::max);
        assert!(off < 1.01, "{what}, frame {frame}: colours {off} levels apart");
        let different = s.alpha.values().iter().zip(t.alpha.values()).filter(|(x, y)| x != y).count();
        assert!(different == 0, "{what}, frame {frame}: {different} mask pixels differ");
    }
}

#[test]
fn one_person_is_the_same_through_every_layout() {
    let own = load("folder", &place("folder/ava"), model("anny_smpl24.npz"), None).unwrap();
    for (layout, name) in [
        ("peoplesnapshot", "peoplesnapshot/ava"),
        ("peoplesnapshot-raw", "peoplesnapshot-raw/ava"),
        ("neuman", "neuman/ava"),
        ("neuman", "neuman/own"),
    ] {
        let other = ava(layout, name);
        assert_eq!(other.capture, Capture::Monocular);
        assert_same(&own.train[0], &other.train[0], name);
        assert_same(&own.test[0], &other.test[0], name);
        let times: Vec<usize> = other.test[0].frames.iter().map(|frame| frame.time).collect();
        assert_eq!(times, [6, 7], "{name}");
    }
}

#[test]
fn a_person_with_fingers_is_the_same_as_in_x_humans() {
    let model = model("anny_smplx55.npz");
    let own = load("folder", &place("folder/hands"), model.clone(), None).unwrap();
    let other = load("xhumans", &place("xhumans/00099"), model, None).unwrap();
    assert_eq!(other.capture, Capture::Hands);
    let ids: Vec<&str> = other.sequences().map(|sequence| sequence.id.as_str()).collect();
    assert_eq!(ids, ["train/Take4", "test/Take10"]);
    assert_same(&own.train[0], &other.train[0], "train/Take4");
    assert_same(&own.test[0], &other.test[0], "test/Take10");
    let times: Vec<usize> = other.train[0].frames.iter().map(|frame| frame.time).collect();
    assert_eq!(times, [11, 12, 14, 15, 16]);
    let camera = &other.train[0].cameras[0];
    assert_eq!((camera.width, camera.height, camera.cy), (64, 64, 32.0), "the middle rows");
}

#[test]
fn what_was_guessed_or_left_out_is_said() {
    let notes = |subject: &Subject| subject.notes.join("\n");
    let own = notes(&ava("neuman", "neuman/own"));
    for part in ["distortion", "alignments.npy"] {
        assert!(own.contains(part), "{own}");
    }
    let hugs = notes(&ava("neuman", "neuman/ava"));
    assert!(hugs.contains("masks of sam_segmentations are called otherwise"), "{hugs}");
    let raw = notes(&ava("peoplesnapshot-raw", "peoplesnapshot-raw/ava"));
    for part in ["undistorted", "gender"] {
        assert!(raw.contains(part), "{raw}");
    }
}

#[test]
fn digests_tell_frames_apart_and_not_layouts_of_paths() {
    let subject = ava("peoplesnapshot-raw", "peoplesnapshot-raw/ava");
    let digests: Vec<String> = subject.sequences().map(|sequence| sequence.digest().unwrap()).collect();
    assert_ne!(digests[0], digests[1]);
    let again = ava("peoplesnapshot-raw", "peoplesnapshot-raw/ava");
    assert_eq!(again.train[0].digest().unwrap(), digests[0]);
}
