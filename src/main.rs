//! `reproduce`: the command-line program. A crate of its own, so that an edit of it leaves the harness as built.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run(std::env::args_os()).into()
}
