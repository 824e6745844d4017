//! `stress`.

use crate::args;
use crate::program::Desk;

#[test]
fn a_quick_examination_writes_its_report_and_pictures() {
    let desk = Desk::new();
    let shown = desk.ok(args!["stress", "--quick", "--only", "sequences,faces,scales", "--out", "report"]);
    assert_eq!(desk.read("report/stress.md"), shown);
    for heading in ["Smooth sequences", "Frames on bad faces", "Extreme scales", "The remedy", "lifted-sum"] {
        assert!(shown.contains(heading), "{heading}");
    }
    assert!(!shown.contains("Solvers on hard averages") && !shown.contains("NaN"));
    let report: serde_json::Value = serde_json::from_str(&desk.read("report/stress.json")).unwrap();
    assert_eq!(report["schema"], "stress-2");
    let pictures = report["pictures"].as_array().unwrap();
    assert!(!pictures.is_empty());
    for picture in pictures {
        let file = picture["file"].as_str().unwrap();
        assert!(shown.contains(&format!("({file})")), "{file}");
        let image = image::open(desk.path(&format!("report/{file}"))).unwrap().to_rgb8();
        assert!(image.pixels().any(|p| p.0 != [255; 3]), "{file}: nothing is drawn");
    }
    let rows = desk.read("report/stress.csv");
    assert!(rows.lines().count() > 100 && rows.starts_with("section,family,input,subject,precision,"));

    // The same bytes from one thread; what is silent is progress.
    let again = args![
        "stress",
        "-q",
        "--quick",
        "--only",
        "sequences,faces,scales",
        "--out",
        "again",
        "--threads",
        "1"
    ];
    let again = desk.run(again).exits(0, "again");
    assert_eq!((again.out, again.err.as_str()), (shown, ""));
    for file in ["stress.md", "stress.csv", "stress.json", "stress.html"] {
        assert_eq!(desk.read(&format!("report/{file}")), desk.read(&format!("again/{file}")), "{file}");
    }
}

/// Of two equal bones, 15 power steps are wrong from a relative angle of 162.5 degrees on: not "from 17.5", what is left to 180.
#[test]
fn the_page_draws_errors_against_the_extreme_and_cells_name_the_angle() {
    let desk = Desk::new();
    let shown = desk.ok(args!["stress", "--only", "averages", "--out", "report"]);
    let power = shown.lines().find(|line| line.starts_with("| power-15 |")).unwrap();
    assert!(power.contains("breaks at 162.5° | breaks below 197.5°"), "{power}");
    // A bone by itself is its own average, for every method whose weights may not sum to one as well.
    let unscaled = shown.lines().find(|line| line.starts_with("| matrix-to-quaternion |")).unwrap();
    assert!(unscaled.contains("breaks at 2 bones") && !unscaled.contains("1 bone "), "{unscaled}");
    assert!(shown.contains("the axis is relative angle, degrees"), "{shown}");
    let page = desk.read("report/stress.html");
    assert!(page.contains("to 180°: error against the extreme") && page.contains("<polyline"));
    assert!(page.contains("power-15 at 170: ") && page.contains("gap, 3 bones: error against the extreme"));
    // At half a turn two equal bones have no one average: no curve goes there.
    assert!(!page.contains("closed-form at 180: "));
}

#[test]
fn unknown_sections_and_unwritable_folders_are_refused() {
    let desk = Desk::new();
    desk.run(args!["stress", "--only", "everything"])
        .refuses(&["everything", "averages", "renderer"], "section");
    desk.put("file", "");
    desk.run(args!["stress", "--quick", "--only", "faces", "--out", "file/x"]).refuses(&["file/x"], "folder");
}
