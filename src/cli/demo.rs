//! `reproduce demo`: what the program does, before anything is set up.

use super::data::Data;
use super::products::{MARKDOWN, Printed, kept_in};
use super::run::Run;
use super::{Context, Exit};
use anyhow::Result;
use clap::Parser;
use skinsplat::quoting::quoted;
use std::ffi::OsString;
use std::path::PathBuf;

/// See what the program does, in half a minute: one subject, two rotations, a small table and pictures.
///
/// Fits an avatar twice, once under each rotation, draws test poses with both, scores them, and writes a page with pictures.
/// Takes the Blender renders of the repository where its datasets.toml is, else a figure that is generated.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Demo {
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = "runs/demo")]
    out: PathBuf,
    #[command(flatten)]
    printed: Printed,
}

const EXAMPLES: &str = "\
Examples:
  reproduce demo
  reproduce demo --out /tmp/demo";

/// The data set of Blender renders, and a figure for where it is not.
const RENDERED: &str = "snapshot_ava";
const GENERATED: &str = "stripes";

/// The run that a demo is.
#[derive(Debug, Parser)]
struct Command {
    #[command(flatten)]
    run: Run,
}

impl Demo {
    /// How to go on after the demo was stopped.
    pub(super) fn advice(&self) -> String {
        kept_in(&self.out)
    }

    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let rendered =
            Data::default().registry()?.datasets.iter().any(|d| d.id == RENDERED && d.is_available());
        let page = self.out.join("demo.html");
        let words =
            ["demo", "--subject", if rendered { RENDERED } else { GENERATED }, "--limit", "3", "--images"];
        let mut arguments: Vec<OsString> = words.map(OsString::from).into();
        if self.printed.format != MARKDOWN {
            arguments.extend(["--format".into(), self.printed.format.clone().into()]);
        }
        for (option, path) in [("--html", &page), ("--out", &self.out)] {
            arguments.extend([option.into(), path.into()]);
        }
        let shown: Vec<String> = arguments.iter().map(|word| quoted(word)).collect();
        context.note(format!("reproduce run {}", shown.join(" ")));
        let command = Command::try_parse_from(std::iter::once("reproduce run".into()).chain(arguments))?;
        let exit = command.run.run(context)?;
        if exit != Exit::Success {
            return Ok(exit);
        }
        let (out, page) = (self.out.display(), page.display());
        context.note(format!(
            "pictures: {page} in a browser, or {out}/images. Next: `reproduce run` for the tables of the paper, `reproduce \
             list experiments` for others, `reproduce score RENDERS TRUTHS` for images of your own"
        ));
        Ok(exit)
    }
}
