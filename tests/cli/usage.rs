//! Help, usage errors, completions, closed pipes.

use crate::args;
use crate::program::Desk;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::process::{Command, Stdio};

const SUBCOMMANDS: [&str; 22] = [
    "demo",
    "check",
    "fetch-help",
    "run",
    "merge",
    "batch",
    "compare",
    "plan",
    "report",
    "list",
    "fit",
    "render",
    "skin",
    "export",
    "view",
    "score",
    "blend",
    "trade",
    "stress",
    "inspect",
    "conform",
    "completions",
];

#[test]
fn top_level_help() {
    insta::assert_snapshot!(Desk::new().ok(args!["-h"]), @r#"
    How should a Gaussian rotate on a skinned body?

    Usage: reproduce [OPTIONS] <COMMAND>

    Commands:
      demo         See what the program does, in half a minute: one subject, two rotations, a small
                   table and pictures
      run          Evaluate: make avatars, pose, render, score, and write the tables
      plan         Show what a run would do, without doing it
      merge        Collect the slices of a run: the same tables as one run, byte for byte
      batch        Print a script that runs the slices of a run on a cluster, and collects them
      report       Print the tables of a run again
      compare      Compare a run with an earlier one: what regressed, improved, is missing or new
      list         List experiments, datasets, strategies, recipes, protocols or metrics
      check        See whether bodies, poses, cameras and masks of a data set fit together
      fetch-help   Say who has a data set, what to unpack where, and what a registry says of it
      fit          Fit an avatar to a subject's training frames
      render       Render an avatar, posed or as it stands
      skin         Pose an avatar and write a plain static 3DGS PLY
      export       Write an avatar as files that other programs open: posed PLY, posed GLB, skinned GLB
      view         Write an avatar in motion as one HTML page: rotations switched live, side by side,
                   marked by their distance from the average
      score        Score renders against truth: two images, or two folders whose frames pair up by name
      blend        Blend rotations with every solver: check a shader or an engine against the exact
                   answer
      trade        Measure what every choice costs and how far it is from the exact answer
      stress       Try every strategy and solver on inputs that are hard on purpose, and say what holds,
                   degrades and breaks
      inspect      Show what a file or folder holds, and what is wrong with it
      conform      Check an engine that skins Gaussians, and name its bug
      completions  Print a completion script for a shell, or the manual
      help         Print this message or the help of the given subcommand(s)

    Options:
          --threads <N>  Threads to compute with; results do not depend on it [default:
                         SLURM_CPUS_PER_TASK, else all cores]
      -q, --quiet        No progress, no notes: errors only
      -h, --help         Print help (see more with '--help')
      -V, --version      Print version

    Exit codes:
      0  done
      1  ran, and the verdict is bad (a regression against a baseline, data or an engine that is wrong)
      2  could not run: usage, input or disk; one line on stderr says which file and field
      3  incomplete: some frames failed or are missing, or something was not compared
    "#);
}

#[test]
fn every_subcommand_has_help_with_every_option_explained() {
    let desk = Desk::new();
    for subcommand in SUBCOMMANDS {
        let help = desk.ok(args![subcommand, "--help"]);
        assert!(help.contains(&format!("Usage: reproduce {subcommand}")), "{help}");
        // An option without a text would be followed by another option or by nothing.
        let short = desk.ok(args![subcommand, "-h"]);
        for line in short.lines().filter(|line| line.trim_start().starts_with("--")) {
            let explained = line.trim().split("  ").filter(|part| !part.trim().is_empty()).count() > 1;
            assert!(explained || !short.contains(&format!("{line}\n      --")), "{subcommand}: {line}");
        }
        assert_eq!(desk.ok(args!["help", subcommand]), help);
    }
    let top = desk.ok(args!["--help"]);
    assert!(top.contains("Exit codes:"));
    let listed =
        top.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let listed: BTreeSet<&str> = listed
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert_eq!(listed, BTreeSet::from(SUBCOMMANDS));
    assert_eq!(desk.ok(args!["--version"]), format!("reproduce {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn every_command_shows_examples() {
    let desk = Desk::new();
    let nested = [["batch", "slurm"], ["batch", "array"], ["conform", "export"], ["conform", "check"]];
    let all = SUBCOMMANDS.iter().map(|name| vec![*name]).chain(nested.map(Vec::from));
    for words in all {
        let help = desk.ok([args![], words.iter().map(OsString::from).collect(), args!["--help"]].concat());
        let command = format!("\n  reproduce {}", words[0]);
        let examples = help.split_once("Examples:").map(|(_, text)| text).unwrap_or_default();
        assert!(examples.contains(&command), "{words:?}: {help}");
        // Wrapped, an example could not be pasted.
        let whole = |line: &str| line.trim().is_empty() || line.starts_with("  reproduce ");
        assert!(examples.lines().all(whole), "{words:?}: {examples}");
    }
}

#[test]
fn a_slip_of_the_pen_is_told_what_was_meant() {
    let desk = Desk::new();
    let fit = |subject: &str, recipe: &str| args!["fit", subject, "--recipe", recipe, "--out", "a.ply"];
    for (arguments, meant) in [
        (args!["rum"], "run"),
        (args!["run", "tabel1"], "`table1`"),
        (args!["run", "table1", "--subjekt", "dots"], "'--subject'"),
        (args!["run", "table1", "--subject", "dotz"], "`dots`"),
        (args!["run", "table1", "--variant", "skined"], "`skinned`"),
        (fit("ring_stripe", "haha"), "`synthetic/ring_stripes`"),
        (fit("dots", "hugs-skined"), "`hugs-skinned`"),
        (args!["check", "synthetik"], "`synthetic`"),
        (args!["fetch-help", "neumann"], "`neuman`"),
        (args!["score", "a", "b", "--protocol", "hugs-humans"], "`hugs-human`"),
        (args!["skin", "a", "--strategy", "quaternion-averag", "--out", "b"], "`quaternion-average`"),
        (args!["score", "a", "b", "--protocol", "hugs-human+regoin=full"], "`region`"),
        (args!["run", "--profile", "quik"], "`quick`"),
        (fit("dots", "haha+rates.positon=1"), "`rates.position`"),
        (args!["batch", "slurm", "--shards", "2", "--", "tabel1"], "`table1`"),
    ] {
        let what = format!("{arguments:?}");
        desk.run(arguments).refuses(&[meant], &what);
    }
    desk.run(args!["run", "breakfast"]).refuses(&["expected a .toml file or one of", "table6"], "a stranger");
    assert!(!desk.run(args!["run", "breakfast"]).err.contains("meant"));
}

#[test]
fn colours_obey_the_environment() {
    let desk = Desk::new();
    let help = |variable: &str| {
        let output = desk.command(args!["--help"]).env(variable, "1").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(help("CLICOLOR_FORCE").contains('\u{1b}'), "colours can be had");
    assert!(!help("NO_COLOR").contains('\u{1b}'));
}

#[test]
fn wrong_usage_is_one_line_and_exit_code_2() {
    let desk = Desk::new();
    for (arguments, parts) in [
        (args!["paint"], vec!["paint"]),
        (args!["run", "--colour"], vec!["--colour"]),
        (args!["run", "--profile", "huge"], vec!["--profile", "huge", "quick, standard"]),
        (args!["run", "--limit", "-1"], vec!["-1"]),
        (args!["run", "--limit", "many"], vec!["--limit", "many"]),
        (args!["run", "--frames", "5..2"], vec!["--frames", "START < END"]),
        (args!["run", "--shard", "4/3"], vec!["--shard", "1 <= i <= n"]),
        (args!["run", "--shard", "1/2", "--fresh"], vec!["--shard", "--fresh"]),
        (args!["--threads", "0", "list", "metrics"], vec!["--threads", "1..=1024"]),
        (args!["render", "a.ply"], vec!["--camera", "--out", "Usage: reproduce render"]),
        (args!["skin", "a.ply", "--out", "b.ply", "--strategy", "guess"], vec!["--strategy", "guess"]),
        (args!["list", "everything"], vec!["everything", "experiments"]),
        (args!["report", "--format", "word"], vec!["word", "markdown"]),
        (args!["completions", "perl"], vec!["perl", "bash"]),
    ] {
        let what = format!("{arguments:?}");
        desk.run(arguments).refuses(&parts, &what);
    }
    assert_eq!(desk.contents(), []);
    let bare = desk.run(args![]).exits(2, "no arguments");
    assert!(bare.err.contains("Commands:"), "{}", bare.err);
}

#[test]
fn completions_parse() {
    let desk = Desk::new();
    for (shell, check) in [("bash", "-n"), ("zsh", "-n"), ("fish", "--no-execute")] {
        let script = desk.ok(args!["completions", shell]);
        for subcommand in SUBCOMMANDS {
            assert!(script.contains(subcommand), "{shell}: {subcommand}");
        }
        let path = desk.put(&format!("script.{shell}"), script);
        match Command::new(shell).arg(check).arg(path).output() {
            Ok(output) => {
                let problem = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(output.status.success() && problem.is_empty(), "{shell}: {problem}");
            }
            // Only bash can be counted on.
            Err(error) => assert!(shell != "bash", "{shell}: {error}"),
        }
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let desk = Desk::new();
    assert!(desk.ok(args!["completions", "man"]).contains(".TH reproduce 1"));
    desk.ok(args!["completions", "man", "--out", "man"]);
    for subcommand in SUBCOMMANDS {
        let page = desk.read(&format!("man/reproduce-{subcommand}.1"));
        assert!(page.contains(".SH SYNOPSIS") && page.contains("Examples:"), "{subcommand}: {page}");
    }
    for (shell, file) in [("bash", "reproduce.bash"), ("zsh", "_reproduce"), ("fish", "reproduce.fish")] {
        desk.ok(args!["completions", shell, "--out", "shells"]);
        assert_eq!(desk.read(&format!("shells/{file}")), desk.ok(args!["completions", shell]), "{shell}");
    }
    desk.put("file", "");
    desk.run(args!["completions", "man", "--out", "file/man"]).refuses(&["file/man"], "no folder");
}

/// What `reproduce ... | head -c 0` does: the reader goes away before the first byte.
#[test]
fn a_closed_pipe_is_no_error() {
    let desk = Desk::new();
    let many: Vec<_> = (0..20_000)
        .map(|i| serde_json::json!({ "name": i.to_string(), "quats_wxyz": [[1, 0, 0, 0]], "weights": [1] }))
        .collect();
    desk.put("many.json", serde_json::to_string(&many).unwrap());
    for arguments in
        [args!["blend", "many.json"], args!["list", "metrics"], args!["--help"], args!["completions", "bash"]]
    {
        let what = format!("{arguments:?}");
        let mut child =
            desk.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && err.is_empty(), "{what}: {} {err}", output.status);
    }
    // Through a shell, as people type it.
    let script =
        format!("set -o pipefail; '{}' blend many.json | head -n 1", env!("CARGO_BIN_EXE_reproduce"));
    let output = Command::new("bash").args(["-c", &script]).current_dir(desk.path("")).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
    let desk = Desk::new();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = desk.command(args!["list", "metrics"]).stdout(full).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), err.lines().count()), (Some(2), 1), "{err}");
    assert!(err.contains("standard output"), "{err}");
}
