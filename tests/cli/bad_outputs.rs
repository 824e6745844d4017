//! Places that cannot be written.

use crate::args;
use crate::made_up::desk;
use crate::program::{Answer, Desk};
use crate::support::data;
use std::ffi::OsString;
use std::path::Path;

fn render(desk: &Desk, out: &Path) -> Answer {
    desk.run(args!["render", "avatar.ply", "--camera", "camera.json", "--out", out])
}

fn skin(desk: &Desk, out: &Path) -> Answer {
    desk.run(args!["skin", "avatar.ply", "--body", "body.npz", "--poses", "poses.npz", "--out", out])
}

#[test]
fn images_and_avatars() {
    let desk = desk();
    std::fs::create_dir(desk.path("folder.png")).unwrap();
    std::fs::create_dir(desk.path("folder.ply")).unwrap();
    for (name, parts, what) in [
        ("missing/a", vec!["missing", "cannot write"], "missing folder"),
        ("folder", vec!["folder", "cannot write"], "a folder"),
        ("avatar.ply/a", vec!["avatar.ply", "cannot write"], "a file as a folder"),
        ("/proc/a", vec!["/proc/a", "cannot write"], "a place where nobody may write"),
    ] {
        let before = desk.contents();
        render(&desk, Path::new(&format!("{name}.png"))).refuses(&parts, what);
        render(
            &desk,
            Path::new(&format!("{name}.npy"))
                .with_extension(if name == "folder" { "png" } else { "npy" })
                .as_path(),
        )
        .refuses(&parts, what);
        skin(&desk, Path::new(&format!("{name}.ply"))).refuses(&parts, what);
        assert!(desk.contents() == before, "{what}: files changed");
    }
    render(&desk, Path::new("a.bmp")).refuses(&["a.bmp", ".png or .npy"], "format");
    render(&desk, Path::new("a")).refuses(&[".png or .npy"], "no format");
}

/// A run of one frame.
fn run(out: &str) -> Vec<OsString> {
    args!["run", "small.toml", "--data", data("small"), "--variant", "surface", "--limit", "1", "--out", out]
}

/// A full disk: the device stays a device, and a link to it stays a link.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let desk = desk();
    for link in ["full.png", "full.npy", "full.ply"] {
        std::os::unix::fs::symlink("/dev/full", desk.path(link)).unwrap();
    }
    let parts = ["cannot write", "No space left"];
    render(&desk, Path::new("full.png")).refuses(&parts, "png");
    render(&desk, Path::new("full.npy")).refuses(&parts, "npy");
    skin(&desk, Path::new("full.ply")).refuses(&parts, "ply");
    skin(&desk, Path::new("/dev/full")).refuses(&["/dev/full", "No space left"], "ply");
    for link in ["full.png", "full.npy", "full.ply"] {
        assert!(desk.path(link).symlink_metadata().unwrap().is_symlink());
    }
    assert!(!std::fs::metadata("/dev/full").unwrap().is_file());
    // A results store on a full disk.
    desk.put("small.toml", include_str!("small.toml"));
    std::fs::create_dir(desk.path("run")).unwrap();
    std::os::unix::fs::symlink("/dev/full", desk.path("run/frames.jsonl")).unwrap();
    desk.run(run("run")).refuses(&["frames.jsonl"], "store");
    assert!(!desk.path("run/results.json").exists());
}

#[test]
fn folders_of_runs() {
    let desk = desk();
    desk.put("small.toml", include_str!("small.toml"));
    let before = desk.contents();
    let run = |out: &str| desk.run(self::run(out));
    run("avatar.ply").refuses(&["avatar.ply", "cannot make the folder"], "a file");
    run("avatar.ply/run").refuses(&["avatar.ply/run", "cannot make the folder"], "below a file");
    run("/proc/run").refuses(&["/proc/run", "cannot make the folder"], "nobody may write");
    assert!(desk.contents() == before);
    desk.put("run/frames.jsonl", "something else\n");
    run("run").refuses(&["run/frames.jsonl:1", "not a results store"], "a foreign file");
    assert_eq!(desk.read("run/frames.jsonl"), "something else\n");
    desk.run([self::run("run"), args!["--fresh"]].concat()).exits(0, "--fresh");
}
