//! `reproduce completions`: shell completion scripts.

use super::{Cli, Exit, output::emit};
use anyhow::Result;
use clap::CommandFactory;
use clap_complete::Shell;

/// Print a completion script for a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Completions {
    /// The shell.
    shell: Shell,
}

const EXAMPLES: &str = "\
Examples:
  reproduce completions bash > ~/.local/share/bash-completion/completions/reproduce";

impl Completions {
    pub(super) fn run(&self) -> Result<Exit> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "reproduce", &mut script);
        emit(&String::from_utf8_lossy(&script))?;
        Ok(Exit::Success)
    }
}
