//! The pages of `docs/`: every command that they show is run, and prints what they say.
//!
//! `SKINSPLAT_BOOK=write cargo test --test book` writes into the pages what the program prints now.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_reproduce");
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Stands for anything, within a line or for whole lines.
const ANYTHING: &str = "…";

/// What commands of a page need of the repository.
const NEEDED: [&str; 3] = ["datasets.toml", "experiments", "tests"];

fn writing() -> bool {
    std::env::var_os("SKINSPLAT_BOOK").is_some_and(|value| value == "write")
}

fn docs() -> PathBuf {
    Path::new(ROOT).join("docs")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A part of a page.
#[derive(Clone)]
enum Part {
    /// A line that is no command and no output.
    Line(String),
    /// A command, perhaps of several lines, and what it prints.
    Command { command: String, output: String },
}

/// The parts of a page: blocks fenced as `console` hold commands after `$ `, each with its output below.
fn parts(page: &str) -> Vec<Part> {
    let mut parts = Vec::new();
    let (mut console, mut here) = (false, None::<String>);
    for line in page.lines() {
        let fence = line.starts_with("```");
        match parts.last_mut() {
            Some(Part::Command { command, .. }) if console && here.is_some() => {
                writeln!(command, "{line}").unwrap();
                if here.as_deref() == Some(line) {
                    here = None;
                }
            }
            _ if console && line.starts_with("$ ") => {
                let command = format!("{}\n", &line[2..]);
                here = line.split_once("<<").map(|(_, word)| word.trim().to_owned());
                parts.push(Part::Command { command, output: String::new() });
            }
            Some(Part::Command { output, .. }) if console && !fence => writeln!(output, "{line}").unwrap(),
            _ => {
                console = fence && line == "```console";
                parts.push(Part::Line(line.to_owned()));
            }
        }
    }
    parts
}

/// The page again.
fn page(parts: &[Part]) -> String {
    let text = |part: &Part| match part {
        Part::Line(line) => format!("{line}\n"),
        Part::Command { command, output } => format!("$ {command}{output}"),
    };
    parts.iter().map(text).collect()
}

/// What the commands print in one shell, in a folder of their own with the program on the PATH; a last line `[exit code N]`
/// if a command fails.
fn run(commands: &[&str]) -> Vec<String> {
    const MARK: &str = "\u{1}";
    let folder = tempfile::tempdir().unwrap();
    for name in NEEDED {
        std::os::unix::fs::symlink(Path::new(ROOT).join(name), folder.path().join(name)).unwrap();
    }
    let mut script = "exec 2>&1\n".to_owned();
    for command in commands {
        writeln!(script, "{command}code=$?; [ $code = 0 ] || echo \"[exit code $code]\"; printf '{MARK}'")
            .unwrap();
    }
    let path = [Path::new(PROGRAM).parent().unwrap().as_os_str(), &std::env::var_os("PATH").unwrap()]
        .join(std::ffi::OsStr::new(":"));
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("PATH", path)
        .env_remove("REPRODUCE_DATASETS")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    text.split(MARK).map(str::to_owned).take(commands.len()).collect()
}

/// Whether a text is what was expected of it.
fn matches(expected: &str, text: &str) -> bool {
    let mut pieces = expected.trim_end().split(ANYTHING);
    let text = text.trim_end();
    let first = pieces.next().unwrap_or_default();
    let Some(mut rest) = text.strip_prefix(first) else { return false };
    let mut pieces: Vec<&str> = pieces.collect();
    let Some(last) = pieces.pop() else { return rest.is_empty() };
    for piece in pieces {
        let Some(at) = rest.find(piece) else { return false };
        rest = &rest[at + piece.len()..];
    }
    rest.ends_with(last)
}

fn walk(name: &str) {
    let path = docs().join(name);
    let mut parts = parts(&read(&path));
    let command = |part: &Part| match part {
        Part::Command { command, .. } => Some(command.clone()),
        Part::Line(_) => None,
    };
    let commands: Vec<String> = parts.iter().filter_map(command).collect();
    assert!(commands.len() > 3, "{name} has commands");
    let commands: Vec<&str> = commands.iter().map(String::as_str).collect();
    let mut found = run(&commands).into_iter();
    let mut wrong = String::new();
    for part in &mut parts {
        let Part::Command { command, output } = part else { continue };
        let found = found.next().unwrap_or_else(|| panic!("{name}: `{command}` was not reached"));
        if !matches(output, &found) {
            writeln!(wrong, "$ {command}expected:\n{output}printed:\n{found}").unwrap();
            *output = if found.is_empty() { found } else { format!("{}\n", found.trim_end()) };
        }
    }
    if writing() {
        std::fs::write(&path, page(&parts)).unwrap();
    } else {
        assert!(wrong.is_empty(), "{name}:\n{wrong}");
    }
}

#[test]
fn the_walk_of_renders() {
    walk("score-my-renders.md");
}

#[test]
fn the_walk_of_an_avatar() {
    walk("my-avatar.md");
}

#[test]
fn the_walk_of_an_engine() {
    walk("check-my-engine.md");
}

#[test]
fn a_difference_is_seen() {
    assert!(matches("a\nb\n", "a\nb"));
    assert!(matches("a … c\n…\ne", "a b c\nd\nd\ne\n"));
    assert!(!matches("a … c\n…\ne", "a b c\nd\nd\nf\n"));
    assert!(!matches("a", "a\nb") && !matches("", "a") && !matches("a", ""));
    let text = "x\n```console\n$ a <<END\nb\nEND\n$ c\nd\n```\ny\n";
    let found = parts(text);
    assert_eq!(page(&found), text);
    let commands: Vec<(&str, &str)> = found
        .iter()
        .filter_map(|part| match part {
            Part::Command { command, output } => Some((command.as_str(), output.as_str())),
            Part::Line(_) => None,
        })
        .collect();
    assert_eq!(commands, [("a <<END\nb\nEND\n", ""), ("c\n", "d\n")]);
    assert_eq!(run(&["echo a; false\n", "echo b\n"]), ["a\n[exit code 1]\n", "b\n"]);
}

/// The help of a command, and of those below it.
fn help(words: &[&str], text: &mut String) {
    let output = Command::new(PROGRAM).args(words).arg("--help").env_remove("COLUMNS").output().unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    let name = ["reproduce"].iter().chain(words).copied().collect::<Vec<_>>().join(" ");
    let indented =
        |line: &str| if line.is_empty() { "\n".to_owned() } else { format!("{}\n", line.trim_end()) };
    let help_lines: String = help.lines().map(indented).collect();
    writeln!(
        text,
        "{} {name}\n\n```text\n{}```\n",
        "#".repeat(2 + words.len().saturating_sub(1)),
        help_lines
    )
    .unwrap();
    let below =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    for line in below.filter(|line| line.starts_with("  ") && !line.starts_with("   ")) {
        let name = line.split_whitespace().next().unwrap_or_default();
        if name != "help" {
            self::help(&[words, &[name]].concat(), text);
        }
    }
}

#[test]
fn the_reference_is_the_help_of_every_command() {
    let mut text = "# Every command\n\nWhat `--help` prints; `-h` is shorter.\n\n".to_owned();
    help(&[], &mut text);
    let path = docs().join("reference.md");
    if writing() {
        std::fs::write(&path, &text).unwrap();
    }
    assert!(
        read(&path) == text,
        "docs/reference.md is not what --help prints; SKINSPLAT_BOOK=write writes it anew"
    );
}

/// Every page is in the summary, and every file that a page links to is there.
#[test]
fn no_page_is_lost_and_no_link_is_dead() {
    let summary = read(&docs().join("SUMMARY.md"));
    for entry in std::fs::read_dir(docs()).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let name = entry.file_name().unwrap().to_str().unwrap();
        assert!(
            name == "SUMMARY.md" || summary.contains(&format!("]({name})")),
            "{name} is not in SUMMARY.md"
        );
        let text = read(&entry);
        for target in
            text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target)
        {
            let file = target.split('#').next().unwrap_or_default();
            let here = file.is_empty() || target.contains("://") || docs().join(file).exists();
            assert!(here, "{name}: {target} is not there");
        }
    }
}
