//! `reproduce fit`: what it writes, what it refuses.

use crate::args;
use crate::catalogues::OTHER_KERNELS;
use crate::program::Desk;
use serde_json::Value;

#[test]
fn a_fit_leaves_an_avatar_that_poses_and_says_how_it_was_made() {
    let desk = Desk::new();
    let fit = args![
        "fit",
        "snapshot_ava",
        "--recipe",
        "animatable-skinned",
        "--profile",
        "quick",
        "--iterations",
        "4",
        "--test-every",
        "2",
        "--seed",
        "5",
        "--out",
        "ava.ply",
        "--format",
        "json",
    ];
    let printed: Value = serde_json::from_str(&desk.ok(fit.clone())).unwrap();
    let sidecar: Value = serde_json::from_str(&desk.read("ava.json")).unwrap();
    assert_eq!(printed, sidecar);
    assert_eq!(sidecar["trained_on"], "snapshot_ava/snapshot_ava/train_casual");
    assert_eq!((&sidecar["options"]["seed"], &sidecar["options"]["iterations"]), (&5.into(), &4.into()));
    assert_eq!(sidecar["options"]["recipe"]["strategy"], "quaternion-average");
    assert_eq!(sidecar["curve"].as_array().unwrap().len(), 4);
    let at: Vec<u64> =
        sidecar["held_out"].as_array().unwrap().iter().map(|h| h["iteration"].as_u64().unwrap()).collect();
    assert_eq!(at, [0, 0, 2, 2, 4, 4], "two test sequences, at the start, in the middle and at the end");
    let held: Vec<String> = desk.contents().iter().map(|(p, _)| p.display().to_string()).collect();
    assert!(held.iter().all(|name| !name.ends_with("checkpoint")), "{held:?}");
    assert!(desk.ok(args!["inspect", "ava.ply"]).contains("joint"));
    let first = desk.bytes("ava.ply");
    desk.ok([args!["--threads", "1"], fit.clone()].concat());
    assert_eq!(first, desk.bytes("ava.ply"), "the same bits on one thread");
    let status = desk.command(fit).envs([OTHER_KERNELS]).output().unwrap().status;
    assert!(
        status.success() && first == desk.bytes("ava.ply"),
        "the same bits with other kernels of the C library"
    );
}

#[test]
fn a_hybrid_leaves_its_mesh_beside_its_gaussians() {
    let desk = Desk::new();
    let recipe = "haha+mesh.texture=64";
    let fit = args![
        "fit",
        "snapshot_ava",
        "--recipe",
        recipe,
        "--profile",
        "quick",
        "--iterations",
        "3",
        "--test-every",
        "2",
        "--out",
        "ava.ply",
        "--format",
        "json",
    ];
    let sidecar: Value = serde_json::from_str(&desk.ok(fit.clone())).unwrap();
    assert_eq!(sidecar["options"]["recipe"]["mesh"]["texture"], 64);
    assert_eq!(sidecar["held_out"].as_array().unwrap().len(), 6);
    let parts = ["ava.ply", "ava.texture.png", "ava.vertices.npy", "ava.json"];
    let first = parts.map(|name| desk.bytes(name));
    desk.ok([args!["--threads", "1"], fit].concat());
    assert!(first == parts.map(|name| desk.bytes(name)), "the same bits on one thread");
}

#[test]
fn what_cannot_be_fitted_is_refused_in_one_line_and_leaves_nothing() {
    let desk = Desk::new();
    for (arguments, reason) in [
        (args!["fit", "nobody", "--out", "a.ply"], "expected one of"),
        (args!["fit", "nowhere/nobody", "--out", "a.ply"], "data set `nowhere`"),
        (args!["fit", "snapshot_ava", "--out", "a.png"], "ends in .ply"),
        (args!["fit", "snapshot_ava", "--recipe", "none", "--out", "a.ply"], "no recipe `none`"),
        (args!["fit", "snapshot_ava", "--recipe", "pure-skinned+x=1", "--out", "a.ply"], "no field `x`"),
        (args!["fit", "snapshot_ava", "--iterations", "0", "--out", "a.ply"], "--iterations"),
    ] {
        let answer = desk.run(arguments);
        assert_eq!(answer.code, Some(2), "{answer:?}");
        assert!(answer.err.contains(reason), "{}", answer.err);
        assert_eq!(answer.err.lines().count(), 1, "{}", answer.err);
        assert!(desk.contents().is_empty());
    }
}

#[test]
fn a_broken_checkpoint_is_named() {
    let desk = Desk::new();
    desk.put("a.checkpoint", b"not a checkpoint");
    let fit = args!["fit", "snapshot_ava", "--profile", "quick", "--iterations", "1", "--out", "a.ply"];
    let answer = desk.run(fit);
    assert_eq!(answer.code, Some(2), "{answer:?}");
    assert!(answer.err.contains("a.checkpoint") && answer.err.contains("start anew"), "{}", answer.err);
}
