//! The command line: one file per subcommand, progress, exit codes.

mod batch;
mod blend;
mod check;
mod compare;
mod completions;
mod conform;
mod data;
mod demo;
mod exit;
mod export;
mod fetch_help;
mod fit;
mod inspect;
mod interrupt;
mod list;
mod lpips;
mod merge;
mod output;
mod page;
mod plan;
mod planning;
mod posing;
mod products;
mod progress;
mod render;
mod report;
mod run;
mod score;
mod selection;
mod skin;
mod stress;
mod tolerances;
mod trade;
mod view;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use exit::Exit;
use output::say;
use std::ffi::OsString;

/// How should a Gaussian rotate on a skinned body?
///
/// Poses Gaussian avatars under several rotation strategies, renders posed test frames, scores them, and writes
/// Tables 1-6 of "On the Skinning of Gaussian Avatars" as Markdown, CSV and JSON. With no data at hand,
/// `reproduce run` uses data that is built in.
#[derive(Debug, Parser)]
#[command(name = "reproduce", version, after_help = exit::HELP, propagate_version = true, arg_required_else_help = true)]
#[command(max_term_width = 110)]
pub(crate) struct Cli {
    /// Threads to compute with; results do not depend on it [default: SLURM_CPUS_PER_TASK, else all cores]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// No progress, no notes: errors only
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Demo),
    Run(run::Run),
    Plan(plan::Plan),
    Merge(merge::Merge),
    Batch(batch::Batch),
    Report(report::Report),
    Compare(compare::Compare),
    List(list::List),
    Check(check::Check),
    FetchHelp(fetch_help::FetchHelp),
    Fit(fit::Fit),
    Render(render::Render),
    Skin(skin::Skin),
    Export(export::Export),
    View(view::View),
    Score(score::Score),
    Blend(blend::Blend),
    Trade(trade::Trading),
    Stress(stress::Stress),
    Inspect(inspect::Inspect),
    Conform(conform::Conform),
    Completions(completions::Completions),
}

/// What every subcommand may ask for.
#[derive(Clone, Copy, Debug)]
struct Context {
    quiet: bool,
}

impl Context {
    /// A note for the person at the terminal, on standard error.
    fn note(&self, text: impl std::fmt::Display) {
        if !self.quiet {
            say(text);
        }
    }
}

/// Parses a command line, the program's name first, and runs the subcommand.
pub(crate) fn run(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return answered(&error),
    };
    let result = skinsplat_simd::level()
        .map_err(anyhow::Error::from)
        .and_then(|_| set_threads(cli.threads))
        .and_then(|()| Ok(interrupt::listen(cli.command.advice())?))
        .and_then(|()| cli.command.run(Context { quiet: cli.quiet }));
    match result {
        Ok(exit) => exit,
        Err(error) => {
            report_error(&one_line(&causes(&error)));
            Exit::Unusable
        }
    }
}

/// An error and its causes, each once: some texts hold those of their causes already.
fn causes(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !text.contains(&cause) {
            text += if text.is_empty() { "" } else { ": " };
            text += &cause;
        }
    }
    text
}

/// Help and versions as they are asked for; wrong usage as one line.
fn answered(error: &clap::Error) -> Exit {
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // A reader that went away is no error, and nobody is left to be told of another.
        let _ = error.print();
        return if error.use_stderr() { Exit::Unusable } else { Exit::Success };
    }
    let text = error.render().to_string();
    let parts = text.split("\n\n").filter(|part| !part.starts_with("For more information"));
    let line = parts.map(one_line).collect::<Vec<_>>().join("; ");
    report_error(&line.trim_start_matches("error: ").replace(" is not in ", "; expected "));
    Exit::Unusable
}

fn report_error(text: &str) {
    say(format_args!("error: {text}"));
}

/// One line, whatever the messages of the libraries below look like and whatever names are in them: a terminal obeys no
/// file.
fn one_line(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words.replace(char::is_control, "\u{fffd}")
}

impl Command {
    /// How to go on after the command was stopped.
    fn advice(&self) -> String {
        match self {
            Self::Demo(command) => command.advice(),
            Self::Run(command) => command.advice(),
            Self::Fit(command) => command.advice(),
            _ => "nothing is left half written; the same command starts anew".to_owned(),
        }
    }

    fn run(&self, context: Context) -> anyhow::Result<Exit> {
        match self {
            Self::Demo(command) => command.run(context),
            Self::Run(command) => command.run(context),
            Self::Plan(command) => command.run(),
            Self::Merge(command) => command.run(context),
            Self::Batch(command) => command.run(),
            Self::Report(command) => command.run(context),
            Self::Compare(command) => command.run(context),
            Self::List(command) => command.run(),
            Self::Check(command) => command.run(context),
            Self::FetchHelp(command) => command.run(),
            Self::Fit(command) => command.run(context),
            Self::Render(command) => command.run(context),
            Self::Skin(command) => command.run(context),
            Self::Export(command) => command.run(context),
            Self::View(command) => command.run(context),
            Self::Score(command) => command.run(context),
            Self::Blend(command) => command.run(),
            Self::Trade(command) => command.run(context),
            Self::Stress(command) => command.run(context),
            Self::Inspect(command) => command.run(context),
            Self::Conform(command) => command.run(context),
            Self::Completions(command) => command.run(context),
        }
    }
}

fn set_threads(threads: Option<u16>) -> anyhow::Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let allotted = || Some(std::env::var("SLURM_CPUS_PER_TASK").ok()?.parse::<usize>().ok()?.min(cores));
    let threads = threads.map(usize::from).or_else(allotted).unwrap_or(0);
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?)
}
