//! What `check` finds in data that is right, and in data that was damaged in a known way.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use glam::DVec3;
use skinsplat_check::{self as check, Finding, Kind, SequenceFit};
use skinsplat_core::scene::{Camera, Mask, Pose, RestBody};
use skinsplat_data::folder::Options;
use skinsplat_data::{Error, FrameGenerator, FrameRef, FrameSource, Sequence, Subject, Truth};
use std::path::Path;
use std::sync::Arc;

/// A sequence of a Blender subject, its images in memory at a fifth of their size.
fn original(subject: &str) -> Sequence {
    let folder = support::data("blender/datasets").join(subject);
    let subject = Subject::load(Path::new(&folder), &Options::default()).unwrap();
    subject.train[0].reduced(200).held().unwrap()
}

fn checked(sequence: &Sequence) -> (SequenceFit, Vec<Finding>) {
    let frames: Vec<usize> = (0..sequence.frames.len()).collect();
    check::sequence(sequence, &frames)
}

fn kinds(sequence: &Sequence) -> Vec<Kind> {
    checked(sequence).1.iter().map(|finding| finding.kind).collect()
}

/// The truths of another sequence, changed.
#[derive(Debug)]
struct Changed(Vec<Option<Truth>>);

impl FrameGenerator for Changed {
    fn truth(&self, frame: usize) -> Result<Truth, Error> {
        let missing = || Error::invalid("frame.png", "image", "missing", "an image");
        self.0[frame].clone().ok_or_else(missing)
    }

    fn key(&self) -> Result<String, Error> {
        Ok("changed".into())
    }
}

fn with_truths(sequence: &Sequence, change: impl Fn(usize, Truth) -> Option<Truth>) -> Sequence {
    let truths = (0..sequence.frames.len()).map(|i| change(i, sequence.truth(i).unwrap())).collect();
    let generator: Arc<dyn FrameGenerator> = Arc::new(Changed(truths));
    let source = |frame| FrameSource::Generated { generator: Arc::clone(&generator), frame };
    let frame = |(i, old): (usize, &FrameRef)| FrameRef { source: source(i), ..old.clone() };
    let frames = sequence.frames.iter().enumerate().map(frame).collect();
    Sequence { frames, ..sequence.clone() }
}

fn with_masks(sequence: &Sequence, change: impl Fn(usize, &Mask) -> Mask) -> Sequence {
    with_truths(sequence, |i, truth| Some(Truth { alpha: change(i, &truth.alpha), ..truth }))
}

fn with_cameras(sequence: &Sequence, change: impl Fn(&Camera) -> Camera) -> Sequence {
    let cameras: Vec<Camera> = sequence.cameras.iter().map(change).collect();
    Sequence { cameras: cameras.into(), ..sequence.clone() }
}

/// The body in another size, about its middle; the skeleton stays.
fn with_body(sequence: &Sequence, factor: f64) -> Sequence {
    let body = &sequence.body;
    let centre = body.vertices.iter().sum::<DVec3>() / body.vertices.len() as f64;
    let vertices = body.vertices.iter().map(|v| centre + factor * (*v - centre)).collect();
    let body = RestBody { vertices, ..RestBody::clone(body) };
    Sequence { body: Arc::new(body), ..sequence.clone() }
}

/// The model in another size, skeleton and all.
fn with_model(sequence: &Sequence, factor: f64) -> Sequence {
    let body = &sequence.body;
    let mut skeleton = body.skeleton.clone();
    skeleton.rest_locals.iter_mut().for_each(|local| local.translation *= factor);
    skeleton.inverse_binds.iter_mut().for_each(|bind| bind.translation *= factor);
    let old = &body.skeleton.rest_locals;
    let grown = |pose: &Pose| {
        let mut pose = pose.clone();
        for ((local, old), new) in pose.locals.iter_mut().zip(old).zip(&skeleton.rest_locals) {
            local.translation += new.translation - old.translation;
        }
        pose
    };
    let poses: Vec<Pose> = sequence.poses.iter().map(grown).collect();
    let vertices = body.vertices.iter().map(|v| factor * *v).collect();
    let body = RestBody { vertices, skeleton: skeleton.clone(), ..RestBody::clone(body) };
    Sequence { body: Arc::new(body), poses: poses.into(), ..sequence.clone() }
}

/// Frame i takes the pose of frame `of(i)`.
fn with_poses(sequence: &Sequence, of: impl Fn(usize) -> usize) -> Sequence {
    let last = sequence.frames.len() - 1;
    let pose = |i: usize| sequence.frames[of(i).min(last)].pose;
    let frames =
        sequence.frames.iter().enumerate().map(|(i, f)| FrameRef { pose: pose(i), ..f.clone() }).collect();
    Sequence { frames, ..sequence.clone() }
}

/// Every frame under a camera of its own, as structure from motion has them.
fn with_own_cameras(sequence: &Sequence) -> Sequence {
    let camera = |(i, frame): (usize, &FrameRef)| {
        let shared = &sequence.cameras[frame.camera];
        Camera { cx: shared.cx + 1e-7 * i as f64, ..shared.clone() }
    };
    let cameras: Vec<Camera> = sequence.frames.iter().enumerate().map(camera).collect();
    let frame = |(camera, old): (usize, &FrameRef)| FrameRef { camera, ..old.clone() };
    let frames = sequence.frames.iter().enumerate().map(frame).collect();
    Sequence { frames, cameras: cameras.into(), ..sequence.clone() }
}

#[test]
fn nothing_is_found_in_data_that_is_right() {
    for subject in ["snapshot_ava", "multiview_ben", "xhands_ava"] {
        let (fit, findings) = checked(&original(subject));
        assert!(fit.mean_iou.unwrap() > 0.85, "{subject}: {:?}", fit.mean_iou);
        assert!(findings.is_empty(), "{subject}: {findings:?}");
        assert!(fit.frames.iter().all(|frame| frame.silhouette_iou.unwrap() > 0.6), "{subject}");
    }
}

#[test]
fn every_damage_is_found_by_its_kind() {
    let sequence = original("snapshot_ava");
    let inverted = |mask: &Mask| {
        Mask::new(mask.width(), mask.height(), mask.values().iter().map(|v| 1.0 - v).collect()).unwrap()
    };
    let empty = |mask: &Mask| Mask::filled(mask.width(), mask.height(), 0.0);
    assert_eq!(kinds(&with_masks(&sequence, |_, mask| inverted(mask))), [Kind::InvertedMasks]);
    let one_empty = with_masks(&sequence, |i, mask| if i == 2 { empty(mask) } else { mask.clone() });
    assert_eq!(kinds(&one_empty), [Kind::EmptyMask]);
    assert_eq!(kinds(&with_truths(&sequence, |i, truth| (i != 1).then_some(truth))), [Kind::MissingFrames]);
    for shift in [1, 2] {
        assert_eq!(kinds(&with_poses(&sequence, |i| i + shift)), [Kind::FrameOffset], "{shift} early");
        assert_eq!(
            kinds(&with_poses(&sequence, |i| i.saturating_sub(shift))),
            [Kind::FrameOffset],
            "{shift} late"
        );
    }
    let n = sequence.frames.len();
    assert_eq!(
        kinds(&with_poses(&sequence, |i| (7 * i + 3) % n)),
        [Kind::FrameOffset],
        "another order, {n} frames"
    );
    for subject in ["snapshot_ava", "multiview_ben", "xhands_ava"] {
        let sequence = original(subject);
        for factor in [0.8, 0.9, 1.1, 1.2] {
            let zoomed = |c: &Camera| Camera { fx: c.fx * factor, fy: c.fy * factor, ..c.clone() };
            let at = format!("{subject} {factor}");
            assert_eq!(kinds(&with_cameras(&sequence, zoomed)), [Kind::Camera], "focal length, {at}");
            // The vertices alone, under the skeleton of the other size: by more it is not whole any more.
            if subject == "snapshot_ava" && (factor - 1.0_f64).abs() < 0.15 {
                assert_eq!(kinds(&with_body(&sequence, factor)), [Kind::WrongGenderOrModel], "body, {at}");
            }
            assert_eq!(kinds(&with_model(&sequence, factor)), [Kind::WrongGenderOrModel], "model, {at}");
        }
    }
    for shift in [-12.0, 12.0] {
        let moved = |c: &Camera| Camera { cx: c.cx + shift, ..c.clone() };
        assert_eq!(kinds(&with_cameras(&sequence, moved)), [Kind::Camera], "principal point {shift}");
    }
    let far = |c: &Camera| Camera { cx: 0.95 * f64::from(c.width), ..c.clone() };
    assert!(kinds(&with_cameras(&sequence, far)).contains(&Kind::Camera), "principal point at the edge");
    for factor in [0.4, 1.6, 2.5] {
        let zoomed = |c: &Camera| Camera { fx: c.fx * factor, fy: c.fy * factor, ..c.clone() };
        assert_eq!(kinds(&with_cameras(&sequence, zoomed)), [Kind::Camera], "focal length {factor}");
    }
    let all_empty = checked(&with_masks(&sequence, |_, mask| empty(mask))).1;
    assert!(all_empty[0].kind == Kind::EmptyMask && all_empty[0].spoils, "{all_empty:?}");
    let whole = |mask: &Mask| Mask::filled(mask.width(), mask.height(), 1.0);
    let meaningless = checked(&with_masks(&sequence, |_, mask| whole(mask))).1;
    assert!(meaningless.iter().any(|finding| finding.spoils), "{meaningless:?}");
    let still: Vec<Pose> = sequence.poses.iter().map(|_| Pose::rest(&sequence.body.skeleton)).collect();
    let still = checked(&Sequence { poses: still.into(), ..sequence.clone() }).1;
    assert!(still.iter().any(|finding| finding.spoils), "{still:?}");
    let away = |pose: &Pose| Pose { translation: pose.translation + DVec3::X * 50.0, ..pose.clone() };
    let poses: Vec<Pose> = sequence.poses.iter().map(away).collect();
    let gone = Sequence { poses: poses.into(), ..sequence.clone() };
    assert_eq!(kinds(&gone), [Kind::BodyOutOfView]);
}

#[test]
fn poses_of_other_frames_are_found_under_cameras_that_move() {
    for subject in ["snapshot_ava", "xhands_ava"] {
        let sequence = with_own_cameras(&original(subject));
        assert_eq!(kinds(&sequence), [], "{subject}");
        let last = sequence.frames.len() - 1;
        let offset = [Kind::FrameOffset];
        assert_eq!(kinds(&with_poses(&sequence, |i| i + 1)), offset, "{subject}: early");
        assert_eq!(kinds(&with_poses(&sequence, |i| i.saturating_sub(1))), offset, "{subject}: late");
        assert_eq!(kinds(&with_poses(&sequence, |i| last - i)), offset, "{subject}: backwards");
    }
}

#[test]
fn neighbours_that_are_not_looked_at_tell_of_a_shift() {
    let sequence = with_own_cameras(&original("snapshot_ava"));
    let some: Vec<usize> = (0..sequence.frames.len()).step_by(2).collect();
    let shifted = with_poses(&sequence, |i| i + 1);
    let (_, findings) = check::sequence(&shifted, &some);
    assert_eq!(findings.iter().map(|f| f.kind).collect::<Vec<_>>(), [Kind::FrameOffset], "{findings:?}");
}

#[test]
fn damage_to_a_part_is_found() {
    let sequence = original("snapshot_ava");
    let n = sequence.frames.len();
    let found = |sequence: &Sequence, kind: Kind, detail: &str| {
        let (_, findings) = checked(sequence);
        let kinds: Vec<Kind> = findings.iter().map(|f| f.kind).collect();
        assert!(kinds == [kind] && findings[0].detail.contains(detail), "{kind} {detail}: {findings:?}");
    };
    let inverted = |mask: &Mask| {
        Mask::new(mask.width(), mask.height(), mask.values().iter().map(|v| 1.0 - v).collect()).unwrap()
    };
    let one = with_masks(&sequence, |i, mask| if i == 3 { inverted(mask) } else { mask.clone() });
    found(&one, Kind::InvertedMasks, &format!("1 of {n} frames"));
    let half = with_masks(&sequence, |i, mask| if i % 2 == 0 { inverted(mask) } else { mask.clone() });
    found(&half, Kind::InvertedMasks, &format!("{} of {n} frames", n / 2));
    let full = with_masks(&sequence, |i, mask| match i {
        5 => Mask::filled(mask.width(), mask.height(), 1.0),
        _ => mask.clone(),
    });
    found(&full, Kind::MaskRange, "covers the image");
    let swapped = with_poses(&sequence, |i| match i {
        2 => 3,
        3 => 2,
        i => i,
    });
    found(&swapped, Kind::FrameOffset, &format!("2 of {n} frames"));
    let other_mask = with_truths(&sequence, |i, truth| match i {
        4 => Some(Truth { alpha: sequence.truth(6).unwrap().alpha, ..truth }),
        _ => Some(truth),
    });
    found(&other_mask, Kind::FrameOffset, &format!("1 of {n} frames"));
    let lost = with_poses(&sequence, |i| if i < n / 2 - 1 { i } else { i + 1 });
    found(&lost, Kind::FrameOffset, "1 frame early from");
}

#[test]
fn one_camera_of_several_is_named() {
    let sequence = original("multiview_ben");
    let broken = 2;
    let name = |camera: usize| &sequence.frames.iter().find(|f| f.camera == camera).unwrap().name;
    let change = |change: &dyn Fn(&Camera) -> Camera| {
        let one = |(i, c): (usize, &Camera)| if i == broken { change(c) } else { c.clone() };
        let cameras: Vec<Camera> = sequence.cameras.iter().enumerate().map(one).collect();
        let (_, findings) = checked(&Sequence { cameras: cameras.into(), ..sequence.clone() });
        assert_eq!(findings.iter().map(|f| f.kind).collect::<Vec<_>>(), [Kind::Camera], "{findings:?}");
        assert!(findings[0].detail.contains(name(broken).as_str()), "{findings:?}");
    };
    change(&|c| Camera { fx: 1.3 * c.fx, fy: 1.3 * c.fy, ..c.clone() });
    change(&|c| Camera { cx: c.cx + 20.0, ..c.clone() });
}

#[test]
fn poses_of_an_estimator_are_no_damage() {
    for subject in ["snapshot_ava", "multiview_ben", "xhands_ava"] {
        for (degrees, seed) in [(2.0, 1), (3.0, 2), (3.0, 3)] {
            let (fit, findings) = checked(&original(subject).with_pose_noise(degrees, seed));
            let spoilt = findings.iter().any(|finding| finding.spoils);
            assert!(!spoilt, "{subject}, {degrees} degrees, {:?}: {findings:?}", fit.mean_iou);
        }
    }
}

/// Masks whose outline is moved by so many pixels, outwards if `wider`.
fn with_edges(sequence: &Sequence, wider: bool, pixels: isize) -> Sequence {
    with_masks(sequence, |_, mask| {
        let (width, height) = (mask.width() as isize, mask.height() as isize);
        let covered = |x: isize, y: isize| {
            let inside = (0..width).contains(&x) && (0..height).contains(&y);
            inside && mask.at(x as usize, y as usize) >= 0.5
        };
        let value = |x: isize, y: isize| {
            let mut around = (-pixels..=pixels).flat_map(|v| (-pixels..=pixels).map(move |u| (x + u, y + v)));
            f32::from(if wider {
                around.any(|(x, y)| covered(x, y))
            } else {
                around.all(|(x, y)| covered(x, y))
            })
        };
        let values = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| value(x, y));
        Mask::new(mask.width(), mask.height(), values.collect()).unwrap()
    })
}

#[test]
fn what_segmentations_get_wrong_is_no_damage() {
    for subject in ["snapshot_ava", "xhands_ava"] {
        let sequence = original(subject);
        let spoilt = |sequence: &Sequence, what: &str| {
            let (fit, findings) = checked(sequence);
            let spoilt = findings.iter().any(|finding| finding.spoils);
            assert!(!spoilt, "{subject}, {what}, {:?}: {findings:?}", fit.mean_iou);
        };
        spoilt(&with_edges(&sequence, true, 2), "wider");
        spoilt(&with_edges(&sequence, false, 1), "narrower");
        // Something stands before the lowest part of the person.
        let hidden = with_masks(&sequence, |_, mask| {
            let row = |y: usize| (0..mask.width()).any(|x| mask.at(x, y) >= 0.5);
            let rows: Vec<usize> = (0..mask.height()).filter(|&y| row(y)).collect();
            let last = rows[rows.len() * 4 / 5] * mask.width();
            let values = mask.values().iter().enumerate().map(|(i, &v)| if i < last { v } else { 0.0 });
            Mask::new(mask.width(), mask.height(), values.collect()).unwrap()
        });
        spoilt(&hidden, "hidden below");
    }
}

#[test]
fn who_stands_still_has_no_order() {
    let sequence = original("snapshot_ava");
    let truth = sequence.truth(0).unwrap();
    let still = with_truths(&sequence, |_, _| Some(truth.clone()));
    let pose = &sequence.poses[sequence.frames[0].pose];
    let poses = vec![pose.clone(); sequence.poses.len()];
    let still = Sequence { poses: poses.into(), ..still };
    for seed in 0..4 {
        let (_, findings) = checked(&still.with_pose_noise(2.0, seed));
        assert!(findings.iter().all(|f| f.kind != Kind::FrameOffset && !f.spoils), "{seed}: {findings:?}");
    }
}

/// A mask as a lens shows it: what a pinhole sees at distance r from the centre is at r (1 + k r^2 / R^2), R half the diagonal.
fn distorted(mask: &Mask, k: f64) -> Mask {
    let (width, height) = (mask.width() as f64, mask.height() as f64);
    let corner = 0.25 * (width * width + height * height);
    let mut values = Vec::with_capacity(mask.width() * mask.height());
    for y in 0..mask.height() {
        for x in 0..mask.width() {
            let at = glam::DVec2::new(x as f64 + 0.5 - 0.5 * width, y as f64 + 0.5 - 0.5 * height);
            // Fixed point of p = at / (1 + k p^2 / R^2).
            let undone = (0..20).fold(at, |p, _| at / (1.0 + k * p.length_squared() / corner));
            let (u, v) = (undone.x + 0.5 * width, undone.y + 0.5 * height);
            let inside = (0.0..width).contains(&u) && (0.0..height).contains(&v);
            values.push(if inside { mask.at(u as usize, v as usize) } else { 0.0 });
        }
    }
    Mask::new(mask.width(), mask.height(), values).unwrap()
}

#[test]
fn a_lens_is_told_from_a_size() {
    let sequence = original("snapshot_ava");
    for (k, words) in [(-0.14, "not undistorted"), (0.14, "undistorted twice")] {
        let (_, findings) = checked(&with_masks(&sequence, |_, mask| distorted(mask, k)));
        let found: Vec<_> = findings.iter().map(|finding| finding.kind).collect();
        assert_eq!(found, [Kind::Camera], "{k}: {findings:?}");
        assert!(findings[0].detail.contains(words), "{k}: {findings:?}");
    }
}

#[test]
fn a_shape_beyond_the_model_is_found() {
    let folder = support::data("blender/datasets/snapshot_ava");
    let mut subject = Subject::load(Path::new(&folder), &Options::default()).unwrap();
    assert!(check::subject(&subject).is_empty(), "{:?}", subject.shapes);
    subject.shapes[0].betas = subject.shapes[0].directions + 1;
    let found = check::subject(&subject);
    assert_eq!(found.iter().map(|f| f.kind).collect::<Vec<_>>(), [Kind::BetasSize]);
    assert!(!found[0].spoils && found[0].detail.contains("directions"), "{found:?}");
}
