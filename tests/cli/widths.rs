//! `SKINSPLAT_SIMD`: every width of vectors gives the same bytes, and what the processor lacks is refused.

use crate::args;
use crate::program::{Answer, Desk};
use crate::support::fixture;
use skinsplat_simd::{Level, VARIABLE};
use std::ffi::OsString;

/// A call with vector instructions of one level.
fn run(desk: &Desk, level: &str, arguments: Vec<OsString>) -> Answer {
    Answer::of(desk.command(arguments).env(VARIABLE, level))
}

#[test]
fn no_width_of_vectors_changes_a_byte() {
    let fit = args![
        "fit",
        "snapshot_ava",
        "--recipe",
        "haha+mesh.texture=64",
        "--profile",
        "quick",
        "--iterations",
        "3",
        "--out",
        "ava.ply",
        "--quiet",
    ];
    let [ply, camera] = ["raster/scene_S.ply", "raster/front_512.json"].map(fixture);
    let render = args!["render", ply, "--camera", camera, "--out", "s.npy", "--quiet"];
    let made = |level: Level| {
        let desk = Desk::new();
        for arguments in [&fit, &render] {
            run(&desk, level.name(), arguments.clone()).exits(0, level.name());
        }
        ["ava.ply", "ava.texture.png", "ava.vertices.npy", "s.npy"].map(|name| desk.bytes(name))
    };
    let scalar = made(Level::Scalar);
    for level in Level::available().filter(|&level| level != Level::Scalar) {
        assert!(made(level) == scalar, "{level}");
    }
}

#[test]
fn levels_that_cannot_be_given_are_refused_in_one_line() {
    let desk = Desk::new();
    let expected = format!("expected one of {}", Level::Scalar);
    let missing = Level::ALL.into_iter().filter(|level| level.arch().is_none()).map(Level::name);
    for level in ["sse2", "AVX2", ""].into_iter().chain(missing) {
        run(&desk, level, args!["list", "strategies"]).refuses(&[VARIABLE, &expected], level);
    }
    run(&desk, "scalar", args!["list", "strategies"]).exits(0, "scalar");
}
