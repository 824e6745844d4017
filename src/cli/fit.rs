//! `reproduce fit`: an avatar from training frames.

use super::data::Data;
use super::output::{Format, emit, emit_json};
use super::progress::Watch;
use super::{Context, Exit};
use anyhow::{Context as _, Result, bail};
use skinsplat::experiment::Profile;
use skinsplat::run::fitting::{self, FitEvent, FitFiles, FitReport, Tests};
use skinsplat::run::held_out::HeldOut;
use skinsplat::run::subject_notes;
use skinsplat_data::select::evenly_spaced;
use skinsplat_data::{Sequence, Subject, atomic};
use skinsplat_fit::FitOptions;
use skinsplat_fit::Recipe;
use std::path::PathBuf;

/// Fit an avatar to a subject's training frames.
///
/// Writes a standard 3DGS PLY with its binding, which any splat viewer opens, and beside it a .json that says how it was
/// made, with the training curve and the scores on the subject's test frames. The mesh of a hybrid is written beside it too
/// (.texture.png and .vertices.npy): the avatar's file holds its Gaussians. Of a recipe that refines the poses of training frames
/// (poses=refine) they lie there as well (.poses.json: local rotations as axis times angle, and translations). A fit that is interrupted leaves a
/// .checkpoint and goes on from there when the same command runs again; the result has the same bits.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Fit {
    /// What to fit to: the ids of a data set and of a subject (see `reproduce list datasets`), or a subject's alone
    #[arg(value_name = "DATASET/SUBJECT")]
    subject: String,
    /// How: a recipe (see `reproduce list recipes`), or one with other choices: pure-skinned+rates.rotation=0.01
    #[arg(long, value_name = "R", default_value = "pure-skinned")]
    recipe: String,
    /// The avatar to write
    #[arg(long, value_name = "AVATAR.ply")]
    out: PathBuf,
    /// Iterations, one training frame each [default: the profile's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    iterations: Option<u32>,
    /// Seed of the order of frames and of backgrounds
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// How much of the data to look at, and for how long: quick, standard or paper
    #[arg(long, value_name = "P", default_value = "standard", value_parser = super::planning::profile)]
    profile: Profile,
    /// Also score the test frames at the start and each time so many iterations are done
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    test_every: Option<u32>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    data: Data,
}

const EXAMPLES: &str = "\
Examples:
  reproduce fit snapshot_ava --out ava.ply
  reproduce fit snapshot_ava --recipe hugs-original --seed 1 --out hugs.ply
  reproduce fit ava --data DIR --profile paper --test-every 1000 --out ava.ply
  reproduce render ava.ply --body BODY --poses POSES --frame 0 --camera CAMERA.json --out ava.png";

impl Fit {
    /// How to go on after the fit was stopped.
    pub(super) fn advice(&self) -> String {
        let checkpoint = self.out.with_extension("checkpoint");
        format!("the same command goes on from {}, if there is one yet", checkpoint.display())
    }

    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        if self.out.extension().is_none_or(|extension| extension != "ply") {
            bail!("--out {}: expected a name that ends in .ply", self.out.display());
        }
        atomic::check(&self.out)?;
        let recipe = Recipe::parse(&self.recipe)?;
        let (dataset, subject) = self.data.subject(&self.subject)?;
        subject_notes(&subject).iter().for_each(|note| context.note(format!("{}: {note}", subject.id)));
        let (training, tests) = self.sequences(&subject)?;
        let iterations = recipe.length(training.frames.len(), self.profile.fit_iterations);
        let options = FitOptions {
            recipe,
            iterations: self.iterations.unwrap_or(iterations),
            seed: self.seed,
            edge_mm: self.profile.avatar_edge_mm,
        };
        let trained_on = format!("{dataset}/{}/{}", subject.id, training.id);
        let files = FitFiles { avatar: self.out.clone(), start: None };
        if self.out.is_file() && !files.checkpoint().is_file() {
            context.note(format!("{}: replaced when the fit is done", self.out.display()));
        }
        let watch = Watch::new(context.quiet);
        let tests = Tests { sequences: &tests, every: self.test_every, ssim: true };
        let report = fitting::fit(&training, &options, &trained_on, &files, tests, &mut |event| {
            match event {
                FitEvent::Starting => watch.start("start", 1),
                FitEvent::Took(..) => {}
                FitEvent::Warning(text) | FitEvent::Damage(text) => {
                    watch.above(&format!("warning: {text}"), context.quiet)
                }
                FitEvent::Step(step) => watch.fitting(step),
            }
            Ok(())
        })?;
        drop(watch);
        self.print(&report)?;
        Ok(Exit::Success)
    }

    /// The training sequence and the test sequences as the profile sees them.
    fn sequences(&self, subject: &Subject) -> Result<(Sequence, Vec<Sequence>)> {
        let all = subject
            .train
            .first()
            .with_context(|| format!("{}: no training sequence; expected one to fit to", subject.id))?;
        let prepared = |sequence: &Sequence, most: Option<usize>| -> Result<Sequence> {
            let indices: Vec<usize> = (0..sequence.frames.len()).collect();
            let thinned = sequence.selected(&evenly_spaced(&indices, most))?;
            Ok(match self.profile.resolution {
                Some(side) => thinned.reduced(side),
                None => thinned,
            })
        };
        let tests = subject.test.iter().map(|sequence| prepared(sequence, self.profile.max_test_frames));
        Ok((prepared(all, self.profile.max_train_frames)?, tests.collect::<Result<_>>()?))
    }

    fn print(&self, report: &FitReport) -> Result<()> {
        if self.format == Format::Json {
            return emit_json(report);
        }
        let mut text = format!(
            "{}: {} Gaussians, {} iterations of {} on {} frames of {}\n",
            self.out.display(),
            report.splats,
            report.options.iterations,
            report.options.recipe.id,
            report.frames.len(),
            report.trained_on,
        );
        if let Some(last) = report.curve.last() {
            text += &format!("  training: loss {:.5}, {:.2} dB\n", last.loss, last.psnr);
        }
        for HeldOut { iteration, sequence, psnr, ssim, frames } in &report.held_out {
            let ssim = ssim.map(|ssim| format!(", SSIM {ssim:.4}")).unwrap_or_default();
            text += &format!("  {sequence} after {iteration}: {psnr:.2} dB{ssim} ({frames} frames)\n");
        }
        for warning in &report.warnings {
            text += &format!("  warning: {warning}\n");
        }
        emit(&text)
    }
}
