//! Runs on several machines: the scripts of `reproduce batch`, by a stand-in for the scheduler and by Slurm itself, where it is
//! installed.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/program.rs"]
mod program;
mod support;

use program::{Answer, Desk, contents, copy};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Puts a table of two variants on a desk, and the small subject that it is of.
fn put_table(desk: &Desk, file: &str) {
    desk.put(file, include_str!("cli/tiny.toml").replace("snapshot_ava", "tiny"));
    copy(&support::data("small/tiny"), &desk.path("data/tiny"));
}

/// What a run leaves for its reader, by name.
fn tables(desk: &Desk, out: &str) -> Vec<(String, Vec<u8>)> {
    let folder = desk.path(out);
    let name = |path: &Path| path.strip_prefix(&folder).unwrap().display().to_string();
    let files = contents(&folder).into_iter().filter_map(|(path, bytes)| Some((name(&path), bytes?)));
    let shown = |name: &str| {
        !["avatars", "logs", "plan-", "shard-", "run.json", "frames"].iter().any(|own| name.starts_with(own))
    };
    files.filter(|(name, _)| shown(name)).collect()
}

fn assert_same_tables(desk: &Desk, a: &str, b: &str) {
    let [a, b] = [a, b].map(|out| tables(desk, out));
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b));
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

/// Runs a script in the desk's folder; `more` is searched for programs first.
fn bash(desk: &Desk, script: &str, more: &Path, environment: &[(&str, &str)]) -> Answer {
    let path = format!("{}:{}", more.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new("bash");
    command.args(["-c", script]).current_dir(desk.path("")).env("PATH", path).stdin(Stdio::null());
    command.env("REPRODUCE_DATASETS", concat!(env!("CARGO_MANIFEST_DIR"), "/datasets.toml"));
    Answer::of(command.envs(environment.iter().copied()))
}

fn is_installed(program: &str) -> bool {
    let found = |folder: PathBuf| folder.join(program).is_file();
    std::env::var_os("PATH").is_some_and(|path| std::env::split_paths(&path).any(found))
}

/// sbatch, as far as the script can tell: says a number, and runs what it is given, for every index of an array.
const SBATCH: &str = r#"#!/bin/bash
printf '%s\n' "$@" >>asked
cat >job
case "$*" in
*--array=1-3*) for i in 3 1 2; do SLURM_ARRAY_TASK_ID=$i SLURM_CPUS_PER_TASK=1 bash job >&2 || true; done; echo 17 ;;
*afterany:17*) bash job ;;
esac
"#;

#[test]
fn the_script_for_slurm_runs_slices_and_merges() {
    use std::os::unix::fs::PermissionsExt;
    let desk = Desk::new();
    // A name that a shell would take apart.
    let (file, out) = ("a 'b' $HOME \"c\"/tiny.toml", "runs/50% o'clock");
    put_table(&desk, file);
    desk.ok(args!["run", file, "--data", "data", "--out", "whole", "-q"]);
    let sbatch = desk.put("bin/sbatch", SBATCH);
    std::fs::set_permissions(&sbatch, std::fs::Permissions::from_mode(0o755)).unwrap();
    let asked = args![
        "batch",
        "slurm",
        "--shards",
        "3",
        "--at-most",
        "2",
        "--sbatch=--comment=two words",
        "--out",
        out
    ];
    let script = desk.ok([asked, args!["--", file, "--data", "data", "-q"]].concat());
    assert!(!desk.path(out).exists() && !desk.path("asked").exists(), "it only prints");
    bash(&desk, &script, &desk.path("bin"), &[]).exits(0, &script);
    assert_same_tables(&desk, "whole", out);
    let asked = desk.read("asked");
    for option in ["--array=1-3%2", "--requeue", "--signal=B:USR1@120", "--comment=two words", "--mem=4G"] {
        assert!(asked.lines().any(|line| line == option), "no {option} in {asked}");
    }
    assert!(asked.contains("--output=runs/50%% o'clock/logs/%a.log\n"), "{asked}");
    assert!(desk.path(out).join("logs").is_dir());
}

#[test]
fn what_run_would_refuse_is_refused_before_anything_is_printed() {
    let desk = Desk::new();
    let batch = |more: &[&str]| {
        let more = more.iter().map(std::ffi::OsString::from).collect();
        desk.run([args!["batch", "slurm", "--shards", "2", "--"], more].concat())
    };
    batch(&["--profil", "quick"]).refuses(&["arguments of run", "--profil"], "a misspelt option");
    batch(&["--shard", "1/2"]).refuses(&["arguments of run", "--shard"], "a slice of slices");
    batch(&["--out", "elsewhere"]).refuses(&["arguments of run", "--out"], "a folder of its own");
    desk.run(args!["batch", "slurm", "--shards", "0"]).refuses(&["--shards"], "no slices");
}

#[test]
fn the_script_for_gnu_parallel_runs_slices_and_merges() {
    if !is_installed("parallel") {
        eprintln!("skipped: GNU parallel is not installed");
        return;
    }
    let desk = Desk::new();
    put_table(&desk, "ti ny/tiny.toml");
    desk.ok(args!["run", "ti ny/tiny.toml", "--data", "data", "--out", "whole", "-q"]);
    let asked = args!["batch", "array", "--shards", "3", "--jobs", "2", "--out", "o'ut"];
    let script = desk.ok([asked, args!["--", "ti ny/tiny.toml", "--data", "data"]].concat());
    bash(&desk, &script, &desk.path(""), &[]).exits(0, &script);
    assert_same_tables(&desk, "whole", "o'ut");
}

/// A cluster of two nodes on this machine.
struct Slurm<'a> {
    desk: &'a Desk,
}

impl<'a> Slurm<'a> {
    fn start(desk: &'a Desk) -> Self {
        let slurm = Self { desk };
        slurm.one_box("start", "2").exits(0, "a cluster");
        slurm
    }

    fn one_box(&self, action: &str, what: &str) -> Answer {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm/one-box.sh");
        bash(self.desk, &format!("bash '{script}' {action} cluster {what}"), Path::new("/usr/sbin"), &[])
    }

    fn ask(&self, script: &str) -> String {
        let conf = self.desk.path("cluster/slurm.conf");
        let environment = [("SLURM_CONF", conf.to_str().unwrap())];
        bash(self.desk, script, Path::new("/usr/sbin"), &environment).exits(0, script).out
    }

    /// Waits until an answer is one.
    fn wait<T>(&self, what: &str, mut ask: impl FnMut(&Self) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            if let Some(answer) = ask(self) {
                return answer;
            }
            assert!(start.elapsed() < Duration::from_secs(300), "{what}: {}", self.ask("squeue; sinfo -N"));
            std::thread::sleep(Duration::from_millis(25));
        }
    }
}

impl Drop for Slurm<'_> {
    fn drop(&mut self) {
        let _ = self.one_box("stop", "");
    }
}

/// An array on two nodes, one of which goes down in the middle of a slice: the slice is queued again, goes on where it stopped,
/// and the tables are those of one run, byte for byte.
#[test]
fn slurm_loses_a_node_and_the_tables_do_not_show_it() {
    if !["slurmctld", "slurmd", "munged"].iter().all(|program| Path::new("/usr/sbin").join(program).is_file())
    {
        eprintln!("skipped: Slurm is not installed (tests/slurm/one-box.sh says which packages)");
        return;
    }
    let desk = Desk::new();
    desk.ok(args!["run", "ci", "--threads", "1", "--out", "whole", "-q"]);
    let asked = args!["batch", "slurm", "--shards", "4", "--cpus", "1", "--mem", "400M", "--out", "run"];
    desk.put("submit.sh", desk.ok([asked, args!["--", "ci"]].concat()));
    let slurm = Slurm::start(&desk);
    slurm.ask("bash submit.sh");
    // A slice on n1 that has some of its records is held there, lest it ends before its node goes down.
    let signal = |signal: &str, index: usize| {
        format!(
            "for p in $(pgrep -f 'ci --shar[d] {index}/4'); do \
             if [ \"$(readlink /proc/$p/cwd)\" = \"$PWD\" ]; then kill -{signal} $p; fi; done || true"
        )
    };
    let has_records = |index: &usize| {
        let store = std::fs::read_to_string(desk.path(&format!("run/shard-{index:02}-of-04.jsonl")));
        store.is_ok_and(|store| store.contains("{\"frame\":"))
    };
    let mut elsewhere = Vec::new();
    let index = slurm.wait("a slice on n1", |slurm| {
        let index = (1..=4).filter(|index| !elsewhere.contains(index)).find(has_records)?;
        slurm.ask(&signal("STOP", index));
        let jobs = slurm.ask("squeue --noheader --states=RUNNING --nodelist=n1 --format=%K");
        if jobs.lines().any(|job| job.trim() == index.to_string()) {
            return Some(index);
        }
        slurm.ask(&signal("CONT", index));
        elsewhere.push(index);
        None
    });
    slurm.one_box("kill-node", "n1").exits(0, "a node goes down");
    let store = format!("run/shard-{index:02}-of-04.jsonl");
    let before = desk.read(&store);
    let job = slurm.wait("the slice is queued again", |slurm| {
        let jobs = slurm.ask("squeue --noheader --states=PENDING --format='%F_%K %K %r'");
        let again = jobs.lines().find(|line| line.split(' ').nth(1) == Some(&index.to_string()))?;
        again.contains("BeginTime").then(|| again.split(' ').next().unwrap().to_owned())
    });
    slurm.one_box("node", "n1").exits(0, "the node is back");
    assert!(slurm.ask(&format!("scontrol show job {job}")).contains("Restarts=1"));
    // Slurm waits for two minutes before it tries again; the test does not. Elsewhere: a node that has just come back may still be
    // told to end what ran on it.
    slurm.ask(&format!("scontrol update JobId={job} ExcNodeList=n1 StartTime=now"));
    slurm.wait("the merge", |slurm| slurm.ask("squeue --noheader").trim().is_empty().then_some(()));
    eprintln!("{}", slurm.ask("cat cluster/log/jobs.txt; cat run/logs/1.log run/logs/merge.log"));
    assert!(desk.path("run/results.json").is_file(), "{}", slurm.ask("tail -n 20 run/logs/*"));
    assert_same_tables(&desk, "whole", "run");
    let after = desk.read(&store);
    assert!(after.starts_with(before.trim_end_matches(|c| c != '\n')) && after.len() > before.len());
    assert!(after.matches("{\"header\":").count() <= 2, "records of the killed slice are kept");
}
