//! What machines do to runs: they kill them at any moment, fill disks, take them back in time, start them twice. Nothing of it
//! shows in the results. SKINSPLAT_KILLS=100 kills more often.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
mod support;

use program::{Answer, Desk, contents, copy};
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::data;

fn desk() -> Desk {
    let desk = Desk::new();
    desk.put("small.toml", include_str!("cli/small.toml"));
    copy(&data("small/tiny"), &desk.path("data/tiny"));
    desk
}

fn run(out: &str) -> Vec<OsString> {
    args!["-q", "run", "small.toml", "--data", "data", "--fit-iterations", "60", "--out", out]
}

/// What a run leaves for its reader and what the next one works with, by name.
fn left(desk: &Desk, out: &str) -> Vec<(String, Vec<u8>)> {
    let folder = desk.path(out);
    let name = |path: &Path| path.strip_prefix(&folder).unwrap().display().to_string();
    let files = contents(&folder).into_iter().filter_map(|(path, bytes)| Some((name(&path), bytes?)));
    files.filter(|(name, _)| !name.ends_with(".jsonl") && name != "run.json").collect()
}

fn assert_same(desk: &Desk, a: &str, b: &str, what: &str) {
    let [a, b] = [a, b].map(|out| left(desk, out));
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b), "{what}");
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{what}: {name} differs");
    }
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % end
    }
}

/// How often a command is killed, at moments of its usual time.
fn kills() -> u64 {
    std::env::var("SKINSPLAT_KILLS").map_or(4, |text| text.parse().unwrap())
}

/// Starts a command again and again and kills it at a random moment, then lets it end.
fn killed(desk: &Desk, arguments: &[OsString], usual: Duration, random: &mut Random) -> u64 {
    let mut killed = 0;
    for _ in 0..kills() {
        let mut command = desk.command(arguments.to_vec());
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let micros = u64::try_from(usual.as_micros()).unwrap();
        std::thread::sleep(Duration::from_micros(random.below(micros.max(1))));
        child.kill().unwrap();
        killed += u64::from(child.wait().unwrap().code().is_none());
    }
    killed
}

#[test]
fn kills_at_any_moment_do_not_show() {
    let desk = desk();
    let mut random = Random(17);
    let timed = |arguments: &[OsString]| {
        let start = Instant::now();
        desk.run(arguments.to_vec()).exits(0, "undisturbed");
        start.elapsed()
    };
    let whole = timed(&run("whole"));
    let mut count = killed(&desk, &run("run"), whole, &mut random);
    desk.run(run("run")).exits(0, "after the last kill");
    assert_same(&desk, "whole", "run", "run");

    let fit = |out: &str| {
        args![
            "-q",
            "fit",
            "tiny",
            "--data",
            "data",
            "--iterations",
            "150",
            "--profile",
            "quick",
            "--out",
            out
        ]
    };
    std::fs::create_dir_all(desk.path("fits")).unwrap();
    std::fs::create_dir_all(desk.path("fit")).unwrap();
    let usual = timed(&fit("fits/a.ply"));
    count += killed(&desk, &fit("fit/a.ply"), usual, &mut random);
    desk.run(fit("fit/a.ply")).exits(0, "after the last kill");
    desk.put("fit/.keep", "");
    desk.put("fits/.keep", "");
    swept(&desk, "fit");
    assert_same(&desk, "fits", "fit", "fit");

    let slices = ["1/2", "2/2"].map(|shard| [run("slices"), args!["--shard", shard]].concat());
    slices.iter().for_each(|slice| {
        desk.run(slice.clone()).exits(0, "a slice");
    });
    let merge = |out: &str| args!["-q", "merge", "slices", "--out", out];
    let usual = timed(&merge("merged"));
    count += killed(&desk, &merge("again"), usual, &mut random);
    desk.run(merge("again")).exits(0, "after the last kill");
    swept(&desk, "again");
    assert_same(&desk, "merged", "again", "merge");
    eprintln!("{count} of {} were killed in time", 3 * kills());
}

/// Unfinished files of killed programs stay for an hour, since they may be those of others: they are expected, and removed here.
fn swept(desk: &Desk, out: &str) {
    for (path, _) in contents(&desk.path(out)) {
        if path.file_name().unwrap().to_string_lossy().starts_with(".writing-") {
            std::fs::remove_file(path).unwrap();
        }
    }
}

#[test]
fn a_store_that_is_cut_off_anywhere_gives_the_same_tables() {
    let desk = desk();
    let run =
        |out: &str| args!["-q", "run", "small.toml", "--data", "data", "--variant", "surface", "--out", out];
    desk.run(run("whole")).exits(0, "whole");
    copy(&desk.path("whole"), &desk.path("run"));
    let store = desk.bytes("whole/frames.jsonl");
    // The store itself is cut off at every byte elsewhere (tests/harness/stores.rs).
    let second = store.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(1).unwrap().0;
    let mut random = Random(5);
    let ends: Vec<usize> = (0..2 * kills()).map(|_| random.below(store.len() as u64) as usize).collect();
    for end in ends.into_iter().chain([0, 1, second, second + 1, store.len() - 1]) {
        desk.put("run/frames.jsonl", &store[..end]);
        desk.run(run("run")).exits(0, &format!("{end} bytes"));
        assert_same(&desk, "whole", "run", &format!("{end} bytes"));
    }
}

#[test]
fn two_processes_on_one_folder_do_not_show() {
    let desk = desk();
    desk.run(run("whole")).exits(0, "whole");
    for again in 0..3 {
        let out = format!("run-{again}");
        let start = || desk.command(run(&out)).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let both = [start(), start()].map(|child| child.wait_with_output().unwrap());
        for output in both {
            let err = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(0), "{again}: {err}");
        }
        assert_same(&desk, "whole", &out, &out);
    }
}

/// A file system of so many kilobytes in a folder; none where that is not allowed.
struct SmallDisk<'a>(&'a Desk);

impl<'a> SmallDisk<'a> {
    fn mount(desk: &'a Desk, kilobytes: usize) -> Option<Self> {
        std::fs::create_dir_all(desk.path("disk")).unwrap();
        let size = format!("size={kilobytes}k");
        let mut mount = Command::new("mount");
        let mount = mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(desk.path("disk"));
        mount.stderr(Stdio::null()).status().is_ok_and(|status| status.success()).then_some(Self(desk))
    }

    fn grow(&self) {
        let mut mount = Command::new("mount");
        mount.args(["-o", "remount,size=64m"]).arg(self.0.path("disk"));
        assert!(mount.status().unwrap().success());
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path("disk")).status();
    }
}

#[test]
fn a_full_disk_is_said_and_room_repairs_it() {
    let desk = desk();
    desk.run(run("whole")).exits(0, "whole");
    for kilobytes in [4, 64, 200, 320, 400, 520] {
        let Some(disk) = SmallDisk::mount(&desk, kilobytes) else {
            eprintln!("skipped: file systems cannot be mounted here");
            return;
        };
        let full = desk.run(run("disk/run"));
        assert!(matches!(full.code, Some(0 | 2 | 3)), "{kilobytes} kB: {full:?}");
        assert!(full.code != Some(2) || full.err.contains("disk/run"), "{kilobytes} kB: {full:?}");
        disk.grow();
        desk.run(run("disk/run")).exits(0, "with room");
        assert_same(&desk, "whole", "disk/run", &format!("{kilobytes} kB"));
    }
}

#[test]
fn data_that_cannot_be_written_to_is_read() {
    let desk = desk();
    desk.run(run("whole")).exits(0, "whole");
    let all = contents(&desk.path("data"));
    let permit = |mode: u32| {
        use std::os::unix::fs::PermissionsExt;
        for (path, bytes) in &all {
            let mode = if bytes.is_some() { mode & 0o444 } else { mode };
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        }
    };
    permit(0o555);
    let answer = desk.run(run("run"));
    permit(0o755);
    answer.exits(0, "read-only data");
    assert_same(&desk, "whole", "run", "read-only data");
    assert_eq!(contents(&desk.path("data")).len(), all.len(), "nothing was left there");
}

/// Files from the future and from before: no decision hangs on the clock.
#[test]
fn a_clock_that_goes_backwards_does_not_show() {
    let desk = desk();
    desk.run(run("whole")).exits(0, "whole");
    desk.run(run("run")).exits(0, "first");
    let times = [Duration::from_secs(10 * 365 * 86_400), Duration::ZERO];
    for (number, from_now) in times.into_iter().enumerate() {
        let time = match number {
            0 => std::time::SystemTime::now() + from_now,
            _ => std::time::SystemTime::UNIX_EPOCH,
        };
        for (path, bytes) in contents(&desk.path("")) {
            if bytes.is_some() {
                std::fs::File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
            }
        }
        std::fs::remove_file(desk.path("run/results.json")).unwrap();
        desk.run(run("run")).exits(0, "at another time");
        assert_same(&desk, "whole", "run", "at another time");
    }
    let future = desk.put("run/avatars/.writing-future", "");
    let time = std::time::SystemTime::now() + times[0];
    std::fs::File::options().append(true).open(&future).unwrap().set_modified(time).unwrap();
    desk.run(run("run")).exits(0, "an unfinished file of the future");
}

/// As many threads compute as the machine, the batch system and the process's own processors allow.
#[test]
fn threads_are_those_that_are_allotted() {
    let desk = desk();
    let threads = |environment: &[(&str, &str)], before: &[&str]| {
        let program = env!("CARGO_BIN_EXE_reproduce");
        let all = args!["-q", "run", "small.toml", "--data", "data", "--variant", "surface", "--out", "run"];
        let mut command = match before {
            [] => Command::new(program),
            [first, rest @ ..] => {
                let mut command = Command::new(first);
                command.args(rest).arg(program);
                command
            }
        };
        command.args(all).current_dir(desk.path("")).env_remove("SLURM_CPUS_PER_TASK");
        Answer::of(command.envs(environment.iter().copied())).exits(0, "run");
        let run: serde_json::Value = serde_json::from_str(&desk.read("run/run.json")).unwrap();
        run["threads"].as_u64().unwrap()
    };
    let cores = std::thread::available_parallelism().unwrap().get() as u64;
    assert_eq!(threads(&[], &[]), cores);
    assert_eq!(threads(&[("SLURM_CPUS_PER_TASK", "1")], &[]), 1);
    for wrong in ["100000", "0", "-1", "many", ""] {
        assert_eq!(threads(&[("SLURM_CPUS_PER_TASK", wrong)], &[]), cores, "{wrong}");
    }
    assert_eq!(threads(&[], &["taskset", "-c", "0"]), 1);
    assert_eq!(threads(&[("SLURM_CPUS_PER_TASK", "2")], &["taskset", "-c", "0"]), 1);
}
