//! Fits that survive: an avatar is fitted once, a checkpoint beside it lets a killed fit go on, and a sidecar says how it
//! was made.

use super::Error;
use super::held_out::held_out;
use super::textured::TexturedFiles;
use crate::experiment::CodeVersions;
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::Avatar;
use skinsplat_data::{Sequence, atomic, ply};
use skinsplat_fit::FitOptions;
use skinsplat_fit::train::{self, Checkpoint, Fitted, Step, Trainer};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Version of the sidecar's schema.
pub const SCHEMA: u32 = 1;
/// A checkpoint is written when so much time has passed since the last one.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(20);
/// The curve has about so many points.
const CURVE_POINTS: u32 = 100;

/// Where the parts of a fit are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FitFiles {
    /// The avatar, a 3DGS PLY with its binding.
    pub avatar: PathBuf,
    /// The avatar with which it starts, kept for other recipes; made anew if none.
    pub start: Option<PathBuf>,
}

impl FitFiles {
    /// The checkpoint beside the avatar; gone when the avatar is there.
    pub fn checkpoint(&self) -> PathBuf {
        self.avatar.with_extension("checkpoint")
    }

    /// The sidecar beside the avatar.
    pub fn sidecar(&self) -> PathBuf {
        self.avatar.with_extension("json")
    }

    /// The mesh of a hybrid, beside the avatar.
    pub fn mesh(&self) -> TexturedFiles {
        TexturedFiles {
            texture: self.avatar.with_extension("texture.png"),
            vertices: self.avatar.with_extension("vertices.npy"),
        }
    }
}

/// How an avatar was fitted: the sidecar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Version of this schema.
    pub schema: u32,
    /// Versions of the code.
    pub code: CodeVersions,
    /// Data set, subject and sequence.
    pub trained_on: String,
    /// Names of the training frames.
    pub frames: Vec<String>,
    /// Recipe and budget.
    pub options: FitOptions,
    /// Number of Gaussians in the end.
    pub splats: usize,
    /// About a hundred points of the way, each the mean over the iterations since the last one.
    pub curve: Vec<Step>,
    /// Scores on frames that the fit did not see, in the order of iterations.
    pub held_out: Vec<HeldOut>,
    /// What was wrong with the data, but not fatally.
    pub warnings: Vec<String>,
}

/// The score on frames that the fit did not see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Iterations done; 0 is the start.
    pub iteration: u32,
    /// The sequence.
    pub sequence: String,
    /// Mean PSNR over its frames, dB.
    pub psnr: f64,
    /// Mean SSIM over its frames; none if nobody asked.
    pub ssim: Option<f64>,
    /// Number of frames.
    pub frames: usize,
}

/// Which frames say on the way how an avatar does where it was not fitted.
#[derive(Clone, Copy, Debug)]
pub struct Tests<'a> {
    /// What is scored.
    pub sequences: &'a [Sequence],
    /// Scored each time so many iterations are done, and at the start; at the end in any case.
    pub every: Option<u32>,
    /// SSIM besides PSNR.
    pub ssim: bool,
}

impl Tests<'_> {
    fn are_due(&self, done: u32, iterations: u32) -> bool {
        done < iterations && self.every.is_some_and(|every| done.is_multiple_of(every))
    }

    fn score(&self, fitted: Fitted<'_>, options: &FitOptions, done: u32) -> Result<Vec<HeldOut>, Error> {
        let strategy = options.recipe.strategy.parse()?;
        held_out(fitted, &strategy, self.sequences, done, self.ssim)
    }
}

/// What is said while a fit goes on.
pub enum FitEvent<'a> {
    /// The avatar with which it starts is being made.
    Starting,
    /// An iteration is done.
    Step(Step),
    /// Something is wrong with the data, but not fatally.
    Warning(&'a str),
}

/// Fits an avatar and writes it, with its sidecar. Their bits do not depend on how often the fit was interrupted.
///
/// # Errors
/// Training frames that cannot be used, a fit that diverges (the last checkpoint stays), files that cannot be written.
/// `watch` may stop the fit with an error of its own; the last checkpoint stays.
pub fn fit(
    sequence: &Sequence,
    options: &FitOptions,
    trained_on: &str,
    files: &FitFiles,
    tests: Tests<'_>,
    watch: &mut dyn FnMut(FitEvent<'_>) -> Result<(), Error>,
) -> Result<FitReport, Error> {
    let path = files.checkpoint();
    let mut progress = Progress::load(&path)?;
    let mut trainer = match progress.checkpoint.take() {
        Some(checkpoint) => Trainer::resume(sequence, options, checkpoint)?,
        None => {
            watch(FitEvent::Starting)?;
            let trainer = Trainer::new(sequence, options, start(sequence, options, files)?)?;
            if tests.are_due(0, options.iterations) {
                progress.held_out = tests.score(trainer.fitted(), options, 0)?;
            }
            trainer
        }
    };
    let mut saved = Instant::now();
    while !trainer.is_done() {
        let step = trainer.step()?;
        for warning in trainer.take_warnings() {
            watch(FitEvent::Warning(&warning))?;
            progress.note_warning(warning);
        }
        progress.note(step);
        watch(FitEvent::Step(step))?;
        if tests.are_due(step.iteration, options.iterations) {
            progress.held_out.extend(tests.score(trainer.fitted(), options, step.iteration)?);
        }
        if trainer.is_resting() && saved.elapsed() > BETWEEN_CHECKPOINTS {
            progress.save(&path, trainer.checkpoint())?;
            saved = Instant::now();
        }
    }
    if let Some(mesh) = trainer.fitted().mesh {
        files.mesh().write(mesh)?;
    }
    progress.held_out.extend(score_end(&trainer, files, sequence, options, tests)?);
    let report = FitReport {
        schema: SCHEMA,
        code: CodeVersions::CURRENT,
        trained_on: trained_on.to_owned(),
        frames: sequence.frames.iter().map(|frame| frame.name.clone()).collect(),
        options: options.clone(),
        splats: trainer.avatar().gaussians.len(),
        curve: progress.curve,
        held_out: progress.held_out,
        warnings: progress.warnings,
    };
    write_report(&files.sidecar(), &report)?;
    let metadata = ply::Metadata::default();
    ply::write_avatar(&files.avatar, trainer.avatar(), &metadata, ply::Encoding::LittleEndian)?;
    if path.is_file() {
        std::fs::remove_file(&path).map_err(|source| Error::Folder { path, source })?;
    }
    Ok(report)
}

/// Scores the avatar as its files have it: a texture's colours were rounded.
fn score_end(
    trainer: &Trainer<'_>,
    files: &FitFiles,
    sequence: &Sequence,
    options: &FitOptions,
    tests: Tests<'_>,
) -> Result<Vec<HeldOut>, Error> {
    let mesh = trainer.fitted().mesh.map(|_| files.mesh().read(&sequence.body)).transpose()?;
    let fitted = Fitted { avatar: trainer.avatar(), mesh: mesh.as_ref() };
    tests.score(fitted, options, options.iterations)
}

fn write_report(path: &Path, report: &FitReport) -> Result<(), Error> {
    let text = serde_json::to_string_pretty(report).expect("a report serialises") + "\n";
    Ok(atomic::write(path, |w| w.write_all(text.as_bytes()))?)
}

/// The avatar with which a fit starts. It is read back from its file, so that it is the same whoever made it.
fn start(sequence: &Sequence, options: &FitOptions, files: &FitFiles) -> Result<Avatar, Error> {
    let Some(path) = &files.start else { return Ok(train::start(sequence, options)?) };
    if !path.is_file() {
        let avatar = train::start(sequence, options)?;
        ply::write_avatar(path, &avatar, &ply::Metadata::default(), ply::Encoding::LittleEndian)?;
    }
    Ok(ply::read_avatar(path)?)
}

/// What a checkpoint file holds.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Progress {
    checkpoint: Option<Checkpoint>,
    curve: Vec<Step>,
    /// Sums of loss and PSNR since the last point of the curve, and their number.
    since: (f64, f64, u32),
    held_out: Vec<HeldOut>,
    warnings: Vec<String>,
}

impl Progress {
    fn load(path: &Path) -> Result<Self, Error> {
        if !path.is_file() {
            return Ok(Self::default());
        }
        let bytes = std::fs::read(path).map_err(|source| Error::Folder { path: path.into(), source })?;
        postcard::from_bytes(&bytes)
            .map_err(|error| Error::Checkpoint { path: path.into(), problem: error.to_string() })
    }

    fn save(&mut self, path: &Path, checkpoint: Checkpoint) -> Result<(), Error> {
        self.checkpoint = Some(checkpoint);
        let bytes = postcard::to_stdvec(self).expect("every type here serialises");
        self.checkpoint = None;
        Ok(atomic::write(path, |w| w.write_all(&bytes))?)
    }

    fn note(&mut self, step: Step) {
        let (loss, psnr, count) = &mut self.since;
        *loss += step.loss;
        *psnr += step.psnr;
        *count += 1;
        let every = step.iterations.div_ceil(CURVE_POINTS);
        if step.iteration.is_multiple_of(every) || step.iteration == step.iterations {
            let n = f64::from(*count);
            self.curve.push(Step { loss: *loss / n, psnr: *psnr / n, ..step });
            self.since = (0.0, 0.0, 0);
        }
    }

    fn note_warning(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }
}
