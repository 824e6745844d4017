//! `reproduce trade`: what it writes, what it refuses, and that only times differ from run to run.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
#[path = "support/rig.rs"]
mod rig;
mod support;

use glam::DVec3;
use program::Desk;
use serde_json::Value;
use skinsplat_core::scene::{Avatar, Camera, RestBody};
use skinsplat_data::frames::load_image;
use skinsplat_data::{Capture, FrameFiles, FrameRef, FrameSource, Sequence, Subject, ply};
use skinsplat_study::trade::{self, Options, SWEEPS, Stage, Trade};
use skinsplat_table::{Cell, Content};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The labels and cells that do not depend on a clock: section, row, column, value.
fn lasting(result: &Value) -> Vec<[String; 4]> {
    let mut cells = Vec::new();
    let name = |v: &Value| v.as_str().unwrap().to_owned();
    for section in result["sections"].as_array().unwrap() {
        let columns = section["columns"].as_array().unwrap();
        for row in section["rows"].as_array().unwrap() {
            let values = row["cells"].as_array().unwrap();
            assert_eq!(values.len(), columns.len(), "{row}");
            for (column, value) in columns.iter().zip(values) {
                if column.get("timing").is_none() {
                    let value = format!("{} {}", value["content"], value["text"]);
                    cells.push([name(&section["id"]), name(&row["id"]), name(&column["key"]), value]);
                }
            }
            for (label, value) in
                section["labels"].as_array().unwrap().iter().zip(row["labels"].as_array().unwrap())
            {
                cells.push([name(&section["id"]), name(&row["id"]), name(&label["key"]), name(value)]);
            }
        }
    }
    cells
}

#[test]
fn a_quick_run_measures_everything_and_only_times_depend_on_the_threads() {
    let desk = Desk::new();
    let run = |out: &str, threads: &str| {
        let printed = desk.ok(args!["trade", "--quick", "--out", out, "--threads", threads]);
        assert_eq!(printed, desk.read(&format!("{out}/trade.md")));
        let result: Value = serde_json::from_str(&desk.read(&format!("{out}/trade.json"))).unwrap();
        (printed, result)
    };
    let ((page, one), (_, two)) = (run("one", "1"), run("two", "2"));
    let (first, second) = (lasting(&one), lasting(&two));
    for (a, b) in first.iter().zip(&second) {
        assert_eq!(a, b);
    }
    assert_eq!(first.len(), second.len());

    let sections = one["sections"].as_array().unwrap();
    let ids: Vec<&str> = sections.iter().map(|s| s["id"].as_str().unwrap()).collect();
    let expected: Vec<&str> = SWEEPS.into_iter().chain([trade::savings::ID]).collect();
    assert_eq!(ids, expected);
    check_cells(sections);
    check_recommendations(&one, sections);
    assert!(!page.contains("NaN") && page.contains("## Recommendations") && page.contains("exact"));
    let rows: BTreeSet<&str> = first.iter().map(|cell| cell[1].as_str()).collect();
    for row in [
        "solver/extreme/power-15",
        "solver/test/power-50-identity",
        "solver/test/polar-newton",
        "solver/test/gram-schmidt-rows",
        "influences/extreme/closed-form/2",
        "precision/test/eigen/f16",
        "strategy/test/face-haha",
        "colour/test/view-rotation/3",
        "storage/test/f16 all",
        "splats/test/contribution/25 %",
        "cutoffs/test/transmittance 0.0001",
        "resolution/test/1/2/on",
        "avatars/extreme/power-15, degree 0/6",
    ] {
        assert!(rows.contains(row), "{row}");
    }

    let mut lines = desk.read("one/trade.csv").lines().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines.remove(0), "section,row,column,timing,value");
    let count = |s: &Value, key: &str| s[key].as_array().unwrap().len();
    let cells = |s: &Value| count(s, "rows") * (count(s, "labels") + count(s, "columns"));
    assert_eq!(lines.len(), sections.iter().map(cells).sum::<usize>());
    for picture in ["solver-test", "solver-extreme", "storage-extreme", "resolution-test"] {
        assert!(page.contains(&format!("]({picture}.svg)")), "{picture}");
        let svg = desk.read(&format!("one/{picture}.svg"));
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{picture}");
        let (image, _) = load_image(&desk.path(&format!("one/{picture}.png"))).unwrap();
        assert_eq!((image.width(), image.height()), (960, 640));
    }
    assert!(desk.contents().iter().all(|(path, _)| !path.to_string_lossy().contains(".writing")));
}

/// Every cell is a finite number or a word; times are above zero and their quartiles in order; a row that was not run says
/// why; every section has a front in every motion.
fn check_cells(sections: &[Value]) {
    for section in sections {
        let columns = section["columns"].as_array().unwrap();
        let place = |key: &str| columns.iter().position(|c| c["key"] == key);
        let mut fronts = BTreeSet::new();
        let mut motions = BTreeSet::new();
        for row in section["rows"].as_array().unwrap() {
            let cells = row["cells"].as_array().unwrap();
            for cell in cells {
                let content = &cell["content"];
                let is_number = content["state"] == "number" && content["value"].is_f64();
                assert!(is_number || content["state"] == "text", "{row}");
                assert_ne!(cell["text"], "", "{row}");
            }
            let of = |key: &str| place(key).and_then(|k| cells[k]["content"]["value"].as_f64());
            if let (Some(low), Some(median), Some(high)) = (of("time_low"), of("time"), of("time_high")) {
                assert!(0.0 < low && low <= median && median <= high, "{row}");
            }
            if let (Some(median), Some(p95), Some(max)) =
                (of("degrees_median"), of("degrees_p95"), of("degrees_max"))
            {
                assert!(0.0 <= median && median <= p95 && p95 <= max && max <= 180.0 + 1e-9, "{row}");
            }
            let Some(_) = place("front") else {
                assert_eq!(cells[place("holds").unwrap()]["text"], "yes", "{row}");
                continue;
            };
            let motion = row["labels"][0].as_str().unwrap().to_owned();
            match cells[place("front").unwrap()]["text"].as_str().unwrap() {
                "front" => {
                    fronts.insert(motion.clone());
                }
                "not run" => assert_ne!(cells[place("note").unwrap()]["text"], "none", "{row}"),
                "beaten" | "not judged" => {}
                other => panic!("{other}"),
            }
            motions.insert(motion);
        }
        assert_eq!(fronts, motions, "{}", section["id"]);
    }
}

/// Three uses; every pick cites rows that exist.
fn check_recommendations(result: &Value, sections: &[Value]) {
    let rows: BTreeSet<&str> = sections
        .iter()
        .flat_map(|s| s["rows"].as_array().unwrap())
        .map(|row| row["id"].as_str().unwrap())
        .collect();
    let recommendations = result["recommendations"].as_array().unwrap();
    let uses: Vec<&str> = recommendations.iter().map(|r| r["purpose"].as_str().unwrap()).collect();
    assert_eq!(uses, ["offline scoring", "real-time engine", "browser"]);
    for recommendation in recommendations {
        let picks = recommendation["picks"].as_array().unwrap();
        assert!(picks.len() >= 9, "{recommendation}");
        for pick in picks {
            let cited = pick["rows"].as_array().unwrap();
            assert!(
                !cited.is_empty() && cited.iter().all(|row| rows.contains(row.as_str().unwrap())),
                "{pick}"
            );
        }
    }
}

/// What is exact is: a sanity check of the numbers themselves.
#[test]
fn exact_solvers_are_exact_and_power_iteration_fails_near_half_turns() {
    let sweeps = trade::measure(&stage(&rig::body(), 300), &["solver"], &mut |_| {}).unwrap();
    let worst = |motion: &str, solver: &str| {
        let row = sweeps[0].rows.iter().find(|r| r.motion == motion && r.choice == [solver]).unwrap();
        row.outcome.as_ref().unwrap().degrees.unwrap().max
    };
    for motion in ["test", "extreme"] {
        for solver in ["closed-form", "eigen", "polar-svd"] {
            assert!(worst(motion, solver) < 1e-6, "{motion} {solver}: {}", worst(motion, solver));
        }
    }
    assert!(worst("test", "power-50") < worst("test", "power-4"));
    assert!(worst("extreme", "power-15") > 1.0, "{}", worst("extreme", "power-15"));
}

/// A subject of one camera and three poses without images, which only an avatar from elsewhere can be measured on.
fn subject(body: &RestBody) -> Subject {
    let eye = DVec3::new(0.5, 0.3, 2.5);
    let camera = Camera::look_at(eye, DVec3::new(0.5, 0.0, 0.0), DVec3::Y, 60.0, 64, 48);
    let poses =
        (0..3).map(|k| skinsplat_core::scene::Pose { translation: DVec3::ZERO, ..rig::bent(body, k, 0.5) });
    let source = || FrameSource::Files(FrameFiles { image: "none.png".into(), mask: None, background: None });
    let frame =
        |pose: usize| FrameRef { name: format!("{pose}"), time: pose, pose, camera: 0, source: source() };
    let sequence = Sequence {
        id: "test".to_owned(),
        body: Arc::new(body.clone()),
        poses: poses.collect::<Vec<_>>().into(),
        cameras: vec![camera].into(),
        frames: (0..3).map(frame).collect(),
        stored_sizes: None,
    };
    Subject {
        id: "tube".to_owned(),
        capture: Capture::Monocular,
        train: Vec::new(),
        test: vec![sequence],
        val: Vec::new(),
        notes: Vec::new(),
        doubts: Vec::new(),
        shapes: Vec::new(),
    }
}

fn stage(body: &RestBody, gaussians: usize) -> Stage {
    let avatar = rig::on_vertices(&rig::body(), gaussians, 3);
    Stage::new("made up/tube", &subject(body), Some(avatar), &Options::quick()).unwrap()
}

#[test]
fn what_an_avatar_does_not_allow_is_a_row_and_the_run_goes_on() {
    let faceless = RestBody { faces: Vec::new(), ..rig::body() };
    let stage = stage(&faceless, 50);
    let sweeps = trade::measure(&stage, &["strategy", "splats"], &mut |_| {}).unwrap();
    let result = Trade::new(&stage, &sweeps);
    let row = |id: &str| result.sections[0].rows.iter().find(|row| row.id == id).unwrap();
    let refused = row("strategy/test/face-haha");
    assert_eq!(refused.cells.last(), Some(&Cell::text("the body has no faces")));
    assert!(refused.cells.contains(&Cell::text("not run")));
    let measured = |cell: &Cell| matches!(cell.content, Content::Number(_));
    assert!(row("strategy/test/closed-form").cells.iter().any(measured));
    // Opacities of this avatar differ, so that both rankings run.
    assert!(sweeps[1].rows.iter().all(|row| row.outcome.is_ok()));
    assert!(trade::measure(&stage, &["colours"], &mut |_| {}).is_err());
}

#[test]
fn face_bound_avatars_are_measured_with_the_weights_of_their_faces() {
    let body = rig::body();
    let avatar = rig::on_faces(&body, 80, 5);
    let stage = Stage::new("made up/tube", &subject(&body), Some(avatar), &Options::quick()).unwrap();
    let ids = ["influences", "storage", "colour"];
    let sweeps = trade::measure(&stage, &ids, &mut |_| {}).unwrap();
    for sweep in &sweeps {
        for row in sweep.rows.iter().filter(|row| row.choice != ["f64"]) {
            assert!(row.outcome.is_ok(), "{}", sweep.row_id(row));
        }
    }
}

#[test]
fn bad_input_is_one_line() {
    let desk = Desk::new();
    let quick = |more: Vec<std::ffi::OsString>| {
        let mut all = args!["trade", "--quick", "--only", "solver"];
        all.extend(more);
        desk.run(all)
    };
    quick(args!["synthetic/nobody"])
        .refuses(&["subject `synthetic/nobody`", "synthetic/ring_stripes"], "unknown subject");
    quick(args!["nowhere/ava"]).refuses(&["nowhere", "synthetic"], "unknown data set");
    quick(args!["--avatar", "missing.ply"]).refuses(&["missing.ply"], "no such avatar");
    desk.put("bad.ply", "ply\nnonsense");
    quick(args!["--avatar", "bad.ply"]).refuses(&["bad.ply"], "not an avatar");
    let gaussians = rig::on_vertices(&rig::body(), 5, 1).gaussians;
    let other = Avatar { gaussians, binding: rig::on_faces(&many_faces(), 5, 1).binding };
    let path = desk.path("other.ply");
    ply::write_avatar(&path, &other, &ply::Metadata::default(), ply::Encoding::LittleEndian).unwrap();
    quick(args!["--avatar", "other.ply"]).refuses(&["other.ply", "face"], "another body");
    quick(args!["--avatar", "other.ply", "--recipe", "surface-face"]).refuses(&["--recipe"], "both");
    desk.run(args!["trade", "--only", "speed"]).refuses(&["speed", "solver, influences"], "unknown table");
    quick(args!["--data", "nothing"]).refuses(&["nothing"], "no data");
    assert!(!desk.path("runs").exists(), "nothing was written");
}

/// A body whose face indices are beyond those of any built-in subject.
fn many_faces() -> RestBody {
    let body = rig::body();
    let faces = body.faces.iter().cycle().take(300_000).copied().collect();
    RestBody { faces, ..body }
}
