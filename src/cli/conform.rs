//! `reproduce conform`: does an engine skin Gaussians as it should, and if not, which bug is it?

use super::output::{Format, emit, emit_json};
use super::{Context, Exit};
use anyhow::{Result, anyhow};
use skinsplat_conform::{Cases, Convention, Options, Verdict};
use std::path::PathBuf;

/// Check an engine that skins Gaussians, and name its bug.
///
/// `export` writes a rig and what it should become; an engine skins it; `check` compares, and names what is wrong.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Conform {
    #[command(subcommand)]
    action: Action,
}

const EXAMPLES: &str = "\
Examples:
  reproduce conform export --out rig                    PLY, body, poses, camera, vectors
  reproduce conform export --out rig --convention unity vectors as Unity has them
  reproduce conform check rig posed/                    a folder with a posed PLY per pose
  reproduce conform check rig answer.json --format json";

#[derive(Debug, clap::Subcommand)]
enum Action {
    Export(Export),
    Check(Check),
}

/// Write a test rig for engines: Gaussians, body, poses, camera, and what they should become.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct Export {
    /// Folder to write to; it is made if it is missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How many cases
    #[arg(long, value_enum, default_value_t, value_name = "SIZE")]
    cases: Size,
    /// Axes, units and orders of the vectors: skinsplat, gltf, unity, unreal or opencv, perhaps with wxyz or xyzw, row or
    /// column behind a comma
    #[arg(long, value_name = "C", default_value = "skinsplat")]
    convention: Convention,
}

/// How many cases a rig holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Size {
    /// 54 Gaussians in 6 poses
    #[default]
    Small,
    /// 270 Gaussians in 16 poses
    Full,
}

/// Compare an engine's answer with what is right, and name the bug.
///
/// Exit code 0 if it conforms, 1 if it differs, 2 if it cannot be read.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct Check {
    /// Folder that `conform export` wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The engine's answer: a posed PLY or a folder with one per pose, JSON, or flat binary (see the README in DIR)
    #[arg(value_name = "ENGINE_OUTPUT")]
    answer: PathBuf,
    /// The convention of the answer [default: that of the vectors in DIR; of PLYs skinsplat]
    #[arg(long, value_name = "C")]
    convention: Option<Convention>,
    /// Which pose the answer is, counted from 0, if it is a single one [default: what it says itself, the number in the name of a PLY, else the one
    /// that fits]
    #[arg(long, value_name = "N")]
    frame: Option<usize>,
    /// How far numbers may be off: metres, or relative to the size of what is compared
    #[arg(long, value_name = "X", default_value_t = Options::TOLERANCE)]
    tolerance: f64,
    /// How to print the verdict
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: Format,
}

impl Conform {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        match &self.action {
            Action::Export(export) => export.run(context),
            Action::Check(check) => check.run(),
        }
    }
}

impl Export {
    fn run(&self, context: Context) -> Result<Exit> {
        let cases = match self.cases {
            Size::Small => Cases::Small,
            Size::Full => Cases::Full,
        };
        skinsplat_conform::export(&self.out, cases, &self.convention).map_err(|e| anyhow!("{e}"))?;
        context.note(format!("{}: README.md says what to do", self.out.display()));
        Ok(Exit::Success)
    }
}

impl Check {
    fn run(&self) -> Result<Exit> {
        let options = Options { convention: self.convention, frame: self.frame, tolerance: self.tolerance };
        let report =
            skinsplat_conform::check(&self.folder, &self.answer, &options).map_err(|e| anyhow!("{e}"))?;
        match self.format {
            Format::Text => emit(&report.text())?,
            Format::Json => emit_json(&report)?,
        }
        Ok(match report.verdict {
            Verdict::Conforms => Exit::Success,
            Verdict::Differs => Exit::Failed,
        })
    }
}
