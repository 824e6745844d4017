//! The program, run in a folder of its own.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// Arguments of any mixture of strings and paths.
#[macro_export]
macro_rules! args {
    ($($argument:expr),* $(,)?) => { vec![$(std::ffi::OsString::from(&$argument)),*] };
}

/// A temporary folder in which the program runs: the current folder of each run.
pub struct Desk {
    folder: TempDir,
}

/// How a run ended, and what it said.
#[derive(Debug)]
pub struct Answer {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Desk {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// The place of this name on the desk.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file, with the folders above it.
    pub fn put(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The program with these arguments, not started yet.
    pub fn command(&self, arguments: Vec<OsString>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_reproduce"));
        command.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null());
        // Batch systems and terminals must not change what a test sees.
        for name in ["SLURM_CPUS_PER_TASK", "COLUMNS", "RUST_BACKTRACE", "REPRODUCE_LPIPS_WEIGHTS"] {
            command.env_remove(name);
        }
        // The data of this repository, wherever the desk is.
        command.env("REPRODUCE_DATASETS", concat!(env!("CARGO_MANIFEST_DIR"), "/datasets.toml"));
        command
    }

    pub fn run(&self, arguments: Vec<OsString>) -> Answer {
        Answer::of(&mut self.command(arguments))
    }

    /// Runs what has to succeed; returns what it printed.
    pub fn ok(&self, arguments: Vec<OsString>) -> String {
        let shown = format!("{arguments:?}");
        self.run(arguments).exits(0, &shown).out
    }

    /// Every file and folder on the desk, sorted, with the bytes of the files.
    pub fn contents(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        contents(self.folder.path())
    }

    /// What is on the desk, for tests that all begin there.
    pub fn kept(&self) -> Kept {
        let here = |path: PathBuf| path.strip_prefix(self.folder.path()).unwrap().to_owned();
        Kept(self.contents().into_iter().map(|(path, bytes)| (here(path), bytes)).collect())
    }
}

/// What a desk held: a run that many tests look at is made once.
pub struct Kept(Vec<(PathBuf, Option<Vec<u8>>)>);

impl Kept {
    /// Another desk with the same on it.
    pub fn desk(&self) -> Desk {
        let desk = Desk::new();
        for (path, bytes) in &self.0 {
            let path = desk.folder.path().join(path);
            // A folder comes before what is in it.
            match bytes {
                Some(bytes) => std::fs::write(path, bytes).unwrap(),
                None => std::fs::create_dir(path).unwrap(),
            }
        }
        desk
    }
}

/// Every file and folder below a folder, sorted, with the bytes of the files.
pub fn contents(folder: &Path) -> Vec<(PathBuf, Option<Vec<u8>>)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
            found.push((path, None));
        } else {
            let bytes = std::fs::read(&path).unwrap();
            found.push((path, Some(bytes)));
        }
    }
    found.sort();
    found
}

/// Copies a folder and all that is in it.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

impl Answer {
    /// Of a command that is started now.
    pub fn of(command: &mut Command) -> Self {
        let output = command.output().unwrap();
        Self {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    #[track_caller]
    pub fn exits(self, code: i32, what: &str) -> Self {
        assert_eq!(self.code, Some(code), "{what}\n{}\n{}", self.err, self.out);
        self
    }

    /// Exit code 2 and one line on standard error that holds all of `parts`.
    #[track_caller]
    pub fn refuses(self, parts: &[&str], what: &str) {
        let Self { code, out, err } = self;
        assert!(!err.contains("panicked"), "{what}: {err}");
        assert_eq!(code, Some(2), "{what}: {err}{out}");
        assert_eq!(err.lines().count(), 1, "{what}: not one line: {err}");
        assert!(err.starts_with("error: "), "{what}: {err}");
        for part in parts {
            assert!(err.contains(part), "{what}: no `{part}` in {err}");
        }
    }
}
