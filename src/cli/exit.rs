//! Exit codes, as `reproduce --help` documents them.

use std::process::ExitCode;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Done, and the verdict, if one was asked for, is good.
    Success = 0,
    /// Ran to the end, and the verdict is bad: a regression against a baseline, say.
    Failed = 1,
    /// Could not run: usage, input, disk.
    Unusable = 2,
    /// Ran, but some frames failed or are missing.
    Incomplete = 3,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// The table that `--help` shows.
pub(super) const HELP: &str = "\
Exit codes:
  0  done
  1  ran, and the verdict is bad (a regression against a baseline, data or an engine that is wrong)
  2  could not run: usage, input or disk; one line on stderr says which file and field
  3  incomplete: some frames failed or are missing, or something was not compared";
