//! `view`: an avatar as one page, and what it says of bad input.

use crate::args;
use crate::program::Desk;

/// A desk with a small rig.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.ok(args!["-q", "conform", "export", "--out", "rig"]);
    desk
}

#[test]
fn the_page_is_one_file_with_every_pose() {
    let desk = desk();
    let fixed = ["view", "rig/avatar.ply", "--body", "rig/body.glb", "--poses", "rig/body.glb"];
    let with = |rest: &[&str]| fixed.iter().chain(rest).map(Into::into).collect::<Vec<std::ffi::OsString>>();
    desk.ok(with(&["--out", "view.html", "--title", "A <rig>"]));
    let page = desk.read("view.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<title>A &lt;rig&gt;</title>"));
    assert!(!page.contains("http"), "the page asks for nothing else");
    let frames = |page: &str| -> usize {
        let rest = page.split("\"frames\":").nth(1).unwrap();
        rest.split([',', '}']).next().unwrap().parse().unwrap()
    };
    assert!(page.contains("\"count\":54"), "54 Gaussians");
    let all = frames(&page);
    assert!(all > 3, "{all} frames");
    desk.ok(with(&["--out", "half.html", "--every", "2", "--up", "z"]));
    let half = desk.read("half.html");
    assert_eq!(frames(&half), all.div_ceil(2));
    assert!(half.contains("\"up\":[0.0,0.0,1.0]"));
}

#[test]
fn views_that_are_wrong_are_one_line() {
    let desk = desk();
    let rig = ["view", "rig/avatar.ply", "--body", "rig/body.glb", "--poses", "rig/body.glb"];
    for (rest, parts) in [
        (vec!["--out", "none/view.html"], vec!["none/view.html", "cannot write"]),
        (vec!["--out", "a.html", "--frame", "1"], vec!["--frame", "every pose"]),
        (vec!["--out", "a.html", "--strategy", "lbs"], vec!["--strategy", "switches rotations"]),
        (vec!["--out", "a.html", "--every", "0"], vec!["--every"]),
        (vec!["--out", "a.html", "--up", "x"], vec!["--up", "minus-y"]),
        (vec![], vec!["--out"]),
    ] {
        let arguments = rig.iter().chain(&rest).map(Into::into).collect::<Vec<std::ffi::OsString>>();
        desk.run(arguments).refuses(&parts, &rest.join(" "));
    }
    desk.run(args!["view", "rig/avatar.ply", "--out", "a.html"]).refuses(&["--body is missing"], "no body");
}
