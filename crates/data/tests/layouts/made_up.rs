//! People that are made up, with NumPy's answers.

use super::{load, place, posed};
use glam::DVec3;
use skinsplat_data::layouts::Split;
use skinsplat_data::npz::Archive;
use skinsplat_data::{Capture, FrameSource};

/// A row of an array as points.
fn points(values: &[f64], row: usize, count: usize) -> Vec<DVec3> {
    values[3 * count * row..3 * count * (row + 1)].chunks_exact(3).map(DVec3::from_slice).collect()
}

#[test]
fn a_clothed_shape_and_a_turned_camera_are_those_of_the_authors() {
    let split = Split { train: [0, 3, 1], test: [4, 5, 1] };
    let folder = place("peoplesnapshot-raw/someone");
    let subject = load("peoplesnapshot-raw", &folder, None, Some(&split)).unwrap();
    let mut expected = Archive::open(&folder.join("expected.npz"), "expected").unwrap();
    let vertices = expected.require("in_camera", "T,V,3").unwrap();
    let masks = expected.require("masks", "T,H,W").unwrap();
    let count = vertices.shape[1];
    for sequence in subject.sequences() {
        for (i, frame) in sequence.frames.iter().enumerate() {
            let camera = &sequence.cameras[0];
            let wanted = points(&vertices.values, frame.time, count);
            for (v, (found, wanted)) in posed(sequence, i).iter().zip(&wanted).enumerate() {
                let found = camera.camera_from_world.transform_point3(*found);
                assert!(
                    (found - *wanted).length() < 1e-5,
                    "frame {}, vertex {v}: {found} {wanted}",
                    frame.time
                );
            }
            let truth = sequence.truth(i).unwrap();
            let stored = &masks.values[256 * frame.time..256 * (frame.time + 1)];
            assert!(truth.alpha.values().iter().zip(stored).all(|(a, b)| f64::from(*a) == *b));
            // Frames are numbered from 1, as ffmpeg does unless it is told otherwise.
            assert_eq!(frame.name, format!("frame_{}", frame.time + 1));
        }
    }
    assert!(subject.notes.iter().any(|note| note.contains("v_personal")), "{:?}", subject.notes);
}

#[test]
fn a_left_handed_rig_lands_on_the_pixels_of_its_left_handed_cameras() {
    let folder = place("galabasketball/ball");
    let subject = load("galabasketball", &folder, None, None).unwrap();
    assert_eq!(subject.capture, Capture::Multiview);
    let mut expected = Archive::open(&folder.join("expected.npz"), "expected").unwrap();
    let vertices = expected.require("vertices", "T,V,3").unwrap();
    let pixels = expected.require("pixels", "T,C,V,2").unwrap();
    let [_, cameras, count, _] = pixels.shape[..] else { panic!("{:?}", pixels.shape) };
    let mut pairs = 0;
    for sequence in subject.sequences() {
        for (i, frame) in sequence.frames.iter().enumerate() {
            let wanted = points(&vertices.values, frame.time, count);
            for (v, found) in posed(sequence, i).iter().enumerate() {
                let mirrored = DVec3::new(wanted[v].x, -wanted[v].y, wanted[v].z);
                assert!((*found - mirrored).length() < 1e-5, "frame {}: {found} {mirrored}", frame.name);
                let (pixel, _) = sequence.cameras[frame.camera].project(*found).unwrap();
                let at = 2 * (count * (cameras * frame.time + frame.camera) + v);
                let off = (pixel.x - pixels.values[at]).hypot(pixel.y - pixels.values[at + 1]);
                assert!(off < 1e-3, "frame {}: {off} pixels", frame.name);
            }
            pairs += 1;
        }
    }
    assert_eq!(pairs, 7 * 4, "seven cameras at every second point in time");
    let of = |sequence: usize| {
        let sequence = [&subject.train[0], &subject.test[0]][sequence];
        sequence.frames.iter().map(|f| (f.camera, f.time)).collect::<Vec<_>>()
    };
    assert_eq!(of(1), [(6, 0), (6, 2), (6, 4), (6, 6)]);
    assert_eq!(of(0)[..7], [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (0, 2)]);
}

#[test]
fn a_captured_background_stays_under_the_player() {
    let subject = load("galabasketball", &place("galabasketball/ball"), None, None).unwrap();
    let sequence = &subject.test[0];
    let truth = sequence.truth(1).unwrap();
    let behind = truth.background.as_ref().unwrap();
    let covered = truth.alpha.values().iter().filter(|a| **a == 1.0).count();
    assert!(covered > 50 && covered < 1500, "{covered} of 1600 pixels");
    for (i, alpha) in truth.alpha.values().iter().enumerate() {
        let (x, y) = (i % 40, i / 40);
        assert_eq!(*alpha == 0.0, truth.rgb.at(x, y) == behind.at(x, y), "pixel {x} {y}");
    }
    assert!(matches!(&sequence.frames[0].source, FrameSource::Files(files) if files.background.is_some()));
    let other = Split { train: [0, 4, 4], test: [2, 4, 2] };
    let part = load("galabasketball", &place("galabasketball/ball"), None, Some(&other)).unwrap();
    assert_eq!((part.train[0].frames.len(), part.test[0].frames.len()), (12, 2));
}
