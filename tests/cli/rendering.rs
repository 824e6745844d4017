//! `render` against the image that the original kernels made.

use crate::args;
use crate::program::Desk;
use crate::support::fixture;
use skinsplat_data::frames::load_image;
use std::path::Path;

/// Absolute differences of all values, ascending.
pub(super) fn differences(a: &Path, b: &Path) -> Vec<f32> {
    let [a, b] = [a, b].map(|path| load_image(path).unwrap().0);
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let values = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    let mut differences: Vec<f32> = values.map(|(a, b)| (a - b).abs()).collect();
    differences.sort_by(f32::total_cmp);
    differences
}

fn scene(out: &str) -> Vec<std::ffi::OsString> {
    let [ply, camera] = ["raster/scene_S.ply", "raster/front_512.json"].map(fixture);
    args!["render", ply, "--camera", camera, "--out", out]
}

#[test]
fn the_golden_image() {
    let desk = Desk::new();
    let answer = desk.run(scene("s.npy")).exits(0, "render");
    assert_eq!((answer.out.as_str(), answer.err.as_str()), ("", "s.npy: 10000 Gaussians, 512x512\n"));
    let differences = differences(&desk.path("s.npy"), &fixture("raster/S_front_512_image.npy"));
    let p999 = differences[differences.len() * 999 / 1000];
    let max = differences.last().unwrap();
    assert!(p999 <= 1e-5, "p99.9 {p999:e}");
    assert!(*max <= 4.0 / 255.0, "max {max:e}");
}

#[test]
fn threads_do_not_change_a_byte() {
    let desk = Desk::new();
    for (name, threads) in [("one.npy", "1"), ("two.npy", "2"), ("five.npy", "5")] {
        let mut arguments = scene(name);
        arguments.extend(args!["--threads", threads, "--quiet"]);
        assert_eq!(desk.run(arguments).exits(0, name).err, "");
    }
    assert!(desk.bytes("one.npy") == desk.bytes("two.npy"));
    assert!(desk.bytes("one.npy") == desk.bytes("five.npy"));
}

#[test]
fn a_png_is_the_array_rounded_to_8_bit() {
    let desk = Desk::new();
    desk.ok(scene("s.npy"));
    desk.ok(scene("s.png"));
    // Values outside [0, 1] are clamped in the PNG; the array keeps them.
    let [array, png] = ["s.npy", "s.png"].map(|name| load_image(&desk.path(name)).unwrap().0);
    for (a, b) in array.pixels().as_flattened().iter().zip(png.pixels().as_flattened()) {
        assert!((a.clamp(0.0, 1.0) - b).abs() <= 0.5 / 255.0 + 1e-6, "{a} {b}");
    }
}

#[test]
fn the_background_is_the_camera_files_unless_given() {
    let desk = Desk::new();
    desk.ok(scene("a.npy"));
    let mut arguments = scene("b.npy");
    arguments.extend(args!["--background", "1,0.5,0.25"]);
    desk.ok(arguments);
    let corner = |name: &str| load_image(&desk.path(name)).unwrap().0.at(0, 0);
    assert_eq!(corner("a.npy"), [0.1, 0.2, 0.3]);
    assert_eq!(corner("b.npy"), [1.0, 0.5, 0.25]);
}
