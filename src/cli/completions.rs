//! `reproduce completions`: completion scripts of shells, and manual pages.

use super::{Cli, Context, Exit, output::emit};
use anyhow::{Context as _, Result};
use clap::{CommandFactory, ValueEnum};
use clap_complete::Shell;
use std::path::{Path, PathBuf};

/// Print a completion script for a shell, or the manual.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Completions {
    /// The shell; man for manual pages
    #[arg(value_name = "SHELL", value_enum)]
    of: Of,
    /// Write into this folder instead, named as the shell looks for it; of the manual a page per command
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// What is written.
#[derive(Clone, Copy, Debug)]
enum Of {
    Shell(Shell),
    Manual,
}

impl ValueEnum for Of {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [Of; 6] = [
            Of::Shell(Shell::Bash),
            Of::Shell(Shell::Elvish),
            Of::Shell(Shell::Fish),
            Of::Shell(Shell::PowerShell),
            Of::Shell(Shell::Zsh),
            Of::Manual,
        ];
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        match self {
            Self::Shell(shell) => shell.to_possible_value(),
            Self::Manual => Some(clap::builder::PossibleValue::new("man")),
        }
    }
}

const EXAMPLES: &str = "\
Examples:
  reproduce completions bash > ~/.local/share/bash-completion/completions/reproduce
  reproduce completions man | man -l -
  reproduce completions man --out ~/.local/share/man/man1";

impl Completions {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let mut command = Cli::command();
        match &self.out {
            Some(folder) => {
                super::products::make_folder(folder)?;
                self.write(&mut command, folder)?;
                context.note(format!("{}: written", folder.display()));
            }
            None => {
                let mut text = Vec::new();
                match self.of {
                    Of::Shell(shell) => clap_complete::generate(shell, &mut command, "reproduce", &mut text),
                    Of::Manual => clap_mangen::Man::new(command).render(&mut text)?,
                }
                emit(&String::from_utf8_lossy(&text))?;
            }
        }
        Ok(Exit::Success)
    }

    fn write(&self, command: &mut clap::Command, folder: &Path) -> Result<()> {
        let written = match self.of {
            Of::Shell(shell) => clap_complete::generate_to(shell, command, "reproduce", folder).map(drop),
            Of::Manual => clap_mangen::generate_to(command.clone(), folder),
        };
        written.with_context(|| format!("{}: cannot write", folder.display()))
    }
}
