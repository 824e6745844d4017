//! Avatars of a run under a motion from a file.

use crate::args;
use crate::files::{Values, npz};
use crate::program::{Answer, Desk};
use crate::support::data;
use serde_json::Value;
use std::ffi::OsString;
use std::path::PathBuf;

/// Joints of the small subject.
const JOINTS: usize = 3;

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("small.toml"));
    desk
}

fn run(desk: &Desk, out: &str, more: &[&str]) -> Answer {
    let mut all =
        args!["-q", "run", "small.toml", "--data", data("small"), "--fit-iterations", "2", "--out", out];
    all.extend(more.iter().map(OsString::from));
    desk.run(all)
}

/// The poses of the test sequence as numpy would store a motion of another world: shifted as a whole, with a shape of its own.
fn motion(desk: &Desk, joints: usize) -> PathBuf {
    let text = std::fs::read_to_string(data("small/tiny/test_b/transforms.json")).unwrap();
    let track: Value = serde_json::from_str(&text).unwrap();
    let (mut poses, mut translations) = (Vec::new(), Vec::new());
    for pose in track["poses"].as_array().unwrap() {
        let thetas = pose["thetas"].as_array().unwrap().iter().flat_map(|row| row.as_array().unwrap());
        let mut thetas: Vec<f64> = thetas.map(|v| v.as_f64().unwrap()).collect();
        thetas.resize(3 * joints, 0.0);
        poses.extend(thetas);
        let at = pose["transl"].as_array().unwrap().iter().zip([5.0, -1.0, 2.0]);
        translations.extend(at.map(|(v, shift)| v.as_f64().unwrap() + shift));
    }
    let frames = (poses.len() / (3 * joints)) as u64;
    let path = desk.path("motion.npz");
    npz(
        &path,
        &[
            ("thetas", &[frames, joints as u64, 3], Values::F64(poses)),
            ("transl", &[frames, 3], Values::F64(translations)),
            ("betas", &[2], Values::F64(vec![3.0, -3.0])),
        ],
    );
    path
}

fn psnr(desk: &Desk, out: &str) -> f64 {
    let results: Value = serde_json::from_str(&desk.read(&format!("{out}/results.json"))).unwrap();
    let variants = results["tables"][0]["sequences"][0]["variants"].as_array().unwrap();
    let surface = variants.iter().find(|variant| variant["id"] == "surface").unwrap();
    surface["summary"]["values"]["psnr"].as_f64().unwrap()
}

/// The motion is the test sequence's own, so its pictures score as the test frames do: its world and shape are left.
#[test]
fn every_variant_is_drawn_in_the_poses_of_a_motion() {
    let desk = desk();
    let path = motion(&desk, JOINTS);
    let answer = run(&desk, "run", &["--motion", path.to_str().unwrap()]).exits(0, "a motion");
    assert!(answer.out.contains("3 poses of motion.npz are drawn with the avatars"), "{}", answer.out);
    for variant in ["surface", "theirs"] {
        for k in 0..3 {
            assert!(desk.path(&format!("run/motion/small/tiny/{variant}/frame_000{k}.png")).is_file());
        }
    }
    for k in 0..3 {
        let drawn = desk.bytes(&format!("run/motion/small/tiny/surface/frame_000{k}.png"));
        desk.put(&format!("theirs/image_000{k}.png"), drawn);
    }
    let more = ["--renders", "surface=theirs", "--motion", path.to_str().unwrap()];
    run(&desk, "again", &more).exits(0, "pictures as renders");
    let (own, drawn) = (psnr(&desk, "run"), psnr(&desk, "again"));
    assert!((own - drawn).abs() < 0.02, "{own} dB, as pictures {drawn}");
    // A folder of renders shows the test frames and no others.
    assert!(!desk.path("again/motion/small/tiny/surface").exists());
    assert!(desk.path("again/motion/small/tiny/theirs/frame_0002.png").is_file());
}

#[test]
fn a_motion_may_be_thinned() {
    let desk = desk();
    let path = motion(&desk, JOINTS);
    run(&desk, "run", &["--motion", path.to_str().unwrap(), "--motion-every", "2", "--variant", "surface"])
        .exits(0, "every other pose");
    let drawn = |k| desk.path(&format!("run/motion/small/tiny/surface/frame_000{k}.png")).is_file();
    assert_eq!([drawn(0), drawn(1), drawn(2)], [true, false, true]);
}

#[test]
fn a_motion_of_another_skeleton_is_refused_before_any_work() {
    let desk = desk();
    let path = motion(&desk, JOINTS + 1);
    let answer = run(&desk, "run", &["--motion", path.to_str().unwrap()]);
    answer.refuses(&["motion.npz", "4 joints", "expected"], "four joints on three");
    assert!(!desk.path("run/motion").exists() && !desk.path("run/avatars").exists());
}
