//! `inspect --needs`.

use crate::args;
use crate::made_up;
use crate::program::Desk;
use crate::support::data;
use serde_json::Value;
use std::ffi::OsString;

fn needs(more: &[&str]) -> Vec<OsString> {
    let mut all = args!["inspect", "--needs", "avatar.ply", "--poses", "poses.npz", "--body", "body.npz"];
    all.extend(more.iter().map(OsString::from));
    all
}

fn close(found: &Value, expected: f64, tolerance: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
}

/// Six Gaussians, each on two of three joints with weights 3/4 and 1/4; in pose 1 the joints are turned by 0.6 rad about x
/// and by a further -0.4 rad about y.
#[test]
fn what_a_made_up_avatar_needs() {
    let desk = made_up::desk();
    let found: Value =
        serde_json::from_str(&desk.ok(needs(&["--format", "json", "--tolerance", "0.9"]))).unwrap();
    assert_eq!((&found["gaussians"], &found["poses"]), (&6.into(), &2.into()));
    assert_eq!((&found["sh_degree_stored"], &found["sh_degree_present"]), (&0.into(), &0.into()));
    assert_eq!(found["influences"], serde_json::json!([0, 0, 6]));
    assert_eq!(found["joints_used"], serde_json::json!([0, 1, 2]));
    let angles = [("[0,1]", 0.6), ("[0,2]", 2.0 * (0.3f64.cos() * 0.2f64.cos()).acos()), ("[1,2]", 0.4)];
    for (pair, (joints, angle)) in found["pairs"].as_array().unwrap().iter().zip(angles) {
        assert_eq!(pair["joints"].to_string(), joints);
        assert_eq!((&pair["gaussians"], &pair["worst_angle"]["pose"]), (&2.into(), &1.into()));
        close(&pair["worst_angle"]["value"], f64::to_degrees(angle), 1e-4);
    }
    // Two bones: the gap is sqrt(1 - 2 w (1 - w) (1 - cos t)), and the heaviest bone misses by t/2 - atan(tan(t/2)/2).
    let half = angles[1].1 / 2.0;
    let gap = (1.0 - 2.0 * 0.75 * 0.25 * (1.0 - (2.0 * half).cos())).sqrt();
    for name in ["gap", "gap_bound"] {
        close(&found[name]["value"], gap, 1e-6);
        assert_eq!(found[name]["pose"], 1);
    }
    let bound = |id: &str| {
        let bounds = found["bounds"].as_array().unwrap();
        bounds.iter().find(|bound| bound["rotation"] == id).unwrap_or_else(|| panic!("{id}")).clone()
    };
    let heaviest = (half - (0.5 * half.tan()).atan()).to_degrees();
    close(&bound("power-0")["proved"], heaviest, 1e-4);
    close(&found["fewer_influences"][0], heaviest, 1e-4);
    assert_eq!(found["fewer_influences"][1], 0.0);
    assert_eq!(bound("matrix-to-quaternion-raw")["degrees"], Value::Null);
    assert_eq!(bound("closed-form")["proved"], 0.0);
    let verdict = &found["verdict"];
    assert_eq!(verdict["cheapest"]["rotation"], "closed-form");
    assert_eq!(verdict["gram_schmidt"], false);
    assert!(verdict["power_steps"].as_u64().unwrap() > 0);
}

#[test]
fn needs_are_told_in_a_sentence() {
    let desk = made_up::desk();
    let text = desk.ok(needs(&["--tolerance", "0.9"]));
    for part in [
        "SH degree            0 of 0",
        "2: 6 (100.0 %)",
        "3 of 3",
        "34.377°",
        "in pose 1",
        "no bound",
        "At 0.9° the cheapest sufficient choice is closed-form",
        "power steps",
        "Gram-Schmidt is not enough",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let one = desk.ok(needs(&["--rotation", "power-3-ones"]));
    assert!(one.contains("power-3-ones") && !one.contains("squaring"), "{one}");
    assert_eq!(text, desk.ok(needs(&["--tolerance", "0.9", "--threads", "1"])));
}

/// A rig is its own body, and clips are chosen by name.
#[test]
fn a_rig_needs_no_other_body() {
    let desk = Desk::new();
    desk.put("avatar.ply", made_up::Ply::bound().text());
    let rig = data("blender/models/ava_smpl24_4inf.glb");
    let inspect = |more: &[&str]| {
        let mut all = args!["inspect", "avatar.ply", "--needs", "--poses", rig];
        all.extend(more.iter().map(OsString::from));
        desk.run(all)
    };
    let text = inspect(&["--clip", "twist"]).exits(0, "twist").out;
    assert!(text.contains("verdict"), "{text}");
    inspect(&[]).refuses(&["ava_smpl24_4inf.glb", "twist"], "no clip");
}

#[test]
fn bad_needs_are_refused() {
    let desk = made_up::desk();
    let refused = |arguments: Vec<OsString>, parts: &[&str]| desk.run(arguments).refuses(parts, parts[0]);
    refused(args!["inspect", "--needs", "avatar.ply"], &["--poses"]);
    refused(args!["inspect", "--needs", "avatar.ply", "--poses", "poses.npz"], &["--body", "avatar.ply"]);
    refused(args!["inspect", "avatar.ply", "--poses", "poses.npz"], &["--needs"]);
    for tolerance in ["0", "-1", "nan", "inf", "1e-9", "x"] {
        refused(needs(&[&format!("--tolerance={tolerance}")]), &["--tolerance", "degrees"]);
    }
    refused(needs(&["--rotation", "spin"]), &["spin", "closed-form"]);
    desk.put(
        "loose.ply",
        made_up::Ply::bound().drop("joint_0").drop("joint_1").drop("weight_0").drop("weight_1").text(),
    );
    let loose = args!["inspect", "--needs", "loose.ply", "--poses", "poses.npz", "--body", "body.npz"];
    let answer = desk.run(loose).exits(0, "weights of the nearest points");
    assert!(answer.err.contains("loose.ply: no binding in the file"), "{}", answer.err);
}
