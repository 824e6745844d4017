//! Fits that survive: an avatar is fitted once, a checkpoint beside it lets a killed fit go on, and a sidecar says how it
//! was made.

use super::Error;
use super::cache::{self, Entry};
use super::held_out::{HeldOut, held_out};
use super::refined_poses;
use super::textured::TexturedFiles;
use crate::experiment::CodeVersions;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use skinsplat_data::{Sequence, atomic, ply};
use skinsplat_fit::FitOptions;
use skinsplat_fit::train::{self, Checkpoint, Fitted, Started, Step, Trainer};
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
    pub start: Option<Entry>,
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

    /// The refined poses of the training frames beside the avatar, of a recipe that refines them.
    pub fn poses(&self) -> PathBuf {
        self.avatar.with_extension("poses.json")
    }

    /// The mesh of a hybrid, beside the avatar.
    pub fn mesh(&self) -> TexturedFiles {
        TexturedFiles::beside(&self.avatar)
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
    /// That every sequence has frames: known before the first iteration.
    fn check(&self) -> Result<(), Error> {
        match self.sequences.iter().find(|sequence| sequence.frames.is_empty()) {
            Some(empty) => Err(Error::NoTestFrames { sequence: empty.id.clone() }),
            None => Ok(()),
        }
    }

    fn are_due(&self, done: u32, iterations: u32) -> bool {
        done < iterations && self.every.is_some_and(|every| done.is_multiple_of(every))
    }

    fn score(&self, fitted: Fitted<'_>, options: &FitOptions, done: u32) -> Result<Vec<HeldOut>, Error> {
        let strategy = options.recipe.strategy.parse()?;
        held_out(fitted, &strategy, self.sequences, done, self.ssim)
    }
}

/// A part of a fit beside its iterations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The avatar with which it starts.
    Start,
    /// Scores on the way, on frames that it does not see.
    Curve,
}

/// What is said while a fit goes on.
pub enum FitEvent<'a> {
    /// The avatar with which it starts is being made.
    Starting,
    /// A part of it took so many seconds.
    Took(Part, f64),
    /// An iteration is done.
    Step(Step),
    /// Something is wrong with the data, but not fatally.
    Warning(&'a str),
    /// A file that is kept for several fits was damaged, and is made again.
    Damage(&'a str),
}

/// Fits an avatar and writes it, with its sidecar. Their bits do not depend on how often the fit was interrupted.
///
/// # Errors
/// Training frames that cannot be used, a test sequence without frames (before anything is done), a fit that diverges (the
/// last checkpoint stays), test frames that cannot be read (the avatar stays, too), files that cannot be written.
/// `watch` may stop the fit with an error of its own; the last checkpoint stays.
pub fn fit(
    sequence: &Sequence,
    options: &FitOptions,
    trained_on: &str,
    files: &FitFiles,
    tests: Tests<'_>,
    watch: &mut Watch<'_>,
) -> Result<FitReport, Error> {
    tests.check()?;
    let path = files.checkpoint();
    let mut progress = Progress::load(&path)?;
    let mut trainer = match progress.checkpoint.take() {
        Some(checkpoint) => {
            Trainer::resume(sequence, options, checkpoint).map_err(|error| Error::checkpoint(&path, error))?
        }
        None => started(sequence, options, files, tests, &mut progress, watch)?,
    };
    iterate(&mut trainer, options, tests, &path, &mut progress, watch)?;
    write_avatar(&trainer, files, sequence)?;
    let end = timed(Part::Curve, watch, || score_end(&trainer, files, sequence, options, tests))?;
    progress.held_out.extend(end);
    let report = progress.report(&trainer, trained_on, sequence, options);
    write_report(&files.sidecar(), &report)?;
    cache::remove(&path)?;
    Ok(report)
}

/// Whoever watches a fit.
type Watch<'w> = dyn FnMut(FitEvent<'_>) -> Result<(), Error> + 'w;

/// Does a part of a fit, and says how long that took.
fn timed<T>(part: Part, watch: &mut Watch<'_>, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    let start = Instant::now();
    let done = work()?;
    watch(FitEvent::Took(part, start.elapsed().as_secs_f64()))?;
    Ok(done)
}

/// The trainer before its first iteration.
fn started<'a>(
    sequence: &'a Sequence,
    options: &'a FitOptions,
    files: &FitFiles,
    tests: Tests<'_>,
    progress: &mut Progress,
    watch: &mut Watch<'_>,
) -> Result<Trainer<'a>, Error> {
    watch(FitEvent::Starting)?;
    let begun = Instant::now();
    let Started { avatar, warnings } = start(sequence, options, files, watch)?;
    watch(FitEvent::Took(Part::Start, begun.elapsed().as_secs_f64()))?;
    for warning in warnings {
        progress.note_warning(warning, watch)?;
    }
    let trainer = Trainer::new(sequence, options, avatar)?;
    if tests.are_due(0, options.iterations) {
        progress.held_out = timed(Part::Curve, watch, || tests.score(trainer.fitted(), options, 0))?;
    }
    Ok(trainer)
}

/// The iterations that are left, with a checkpoint now and then.
fn iterate(
    trainer: &mut Trainer<'_>,
    options: &FitOptions,
    tests: Tests<'_>,
    checkpoint: &Path,
    progress: &mut Progress,
    watch: &mut Watch<'_>,
) -> Result<(), Error> {
    let mut saved = Instant::now();
    while !trainer.is_done() {
        let step = trainer.step()?;
        for warning in trainer.take_warnings() {
            progress.note_warning(warning, watch)?;
        }
        progress.note(step);
        watch(FitEvent::Step(step))?;
        if tests.are_due(step.iteration, options.iterations) {
            let scores = || tests.score(trainer.fitted(), options, step.iteration);
            progress.held_out.extend(timed(Part::Curve, watch, scores)?);
        }
        if trainer.is_resting() && saved.elapsed() > BETWEEN_CHECKPOINTS {
            progress.save(checkpoint, trainer.checkpoint()?)?;
            saved = Instant::now();
        }
    }
    Ok(())
}

/// Writes the Gaussians, the mesh of a hybrid and the poses that were refined; those of an earlier fit under this name go.
fn write_avatar(trainer: &Trainer<'_>, files: &FitFiles, sequence: &Sequence) -> Result<(), Error> {
    match trainer.poses() {
        Some(refined) => refined_poses::write(&files.poses(), sequence, &refined)?,
        None => {
            cache::remove(&files.poses())?;
        }
    }
    let mesh = files.mesh();
    match trainer.fitted().mesh {
        Some(fitted) => mesh.write(fitted)?,
        None => {
            cache::remove(&mesh.texture)?;
            cache::remove(&mesh.vertices)?;
        }
    }
    let metadata = ply::Metadata::default();
    Ok(ply::write_avatar(&files.avatar, trainer.avatar(), &metadata, ply::Encoding::LittleEndian)?)
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

/// How comments begin that hold the warnings of a start.
const WARNING_COMMENT: &str = "skinsplat warning ";

/// The avatar with which a fit starts. It is read back from its file, warnings included, so that it is the same whoever made
/// it.
fn start(
    sequence: &Sequence,
    options: &FitOptions,
    files: &FitFiles,
    watch: &mut Watch<'_>,
) -> Result<Started, Error> {
    let Some(entry) = &files.start else { return Ok(train::start(sequence, options)?) };
    let path = entry.path("ply");
    entry.ensure(
        |damage| watch(FitEvent::Damage(&damage)),
        || {
            let Started { avatar, warnings } = train::start(sequence, options)?;
            let comments = warnings.iter().map(|warning| format!("{WARNING_COMMENT}{warning}")).collect();
            let metadata = ply::Metadata { body: None, comments };
            Ok(ply::write_avatar(&path, &avatar, &metadata, ply::Encoding::LittleEndian)?)
        },
    )?;
    let ply::Stored { avatar, comments, .. } = ply::read(&path)?;
    let warning = |comment: &String| Some(comment.strip_prefix(WARNING_COMMENT)?.to_owned());
    Ok(Started { avatar, warnings: comments.iter().filter_map(warning).collect() })
}

/// How checkpoint files begin; the SHA-256 of what follows it comes next.
const CHECKPOINT: &[u8] = b"skinsplat checkpoint 4\n";

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
        let cannot = |source| Error::File { path: path.into(), action: "read", source };
        let bytes = skinsplat_data::source::read(path).map_err(cannot)?;
        let damaged = |problem: String| Error::Checkpoint { path: path.into(), problem };
        let content = bytes.strip_prefix(CHECKPOINT).and_then(|rest| rest.split_first_chunk::<32>());
        match content {
            Some((sum, content)) if sum[..] == Sha256::digest(content)[..] => {
                postcard::from_bytes(content).map_err(|error| damaged(error.to_string()))
            }
            Some(_) => Err(damaged("it is damaged: its checksum is another".to_owned())),
            None => Err(damaged("its beginning is that of something else".to_owned())),
        }
    }

    fn save(&mut self, path: &Path, checkpoint: Checkpoint) -> Result<(), Error> {
        self.checkpoint = Some(checkpoint);
        let bytes = postcard::to_stdvec(self).expect("every type here serialises");
        self.checkpoint = None;
        let sum = Sha256::digest(&bytes);
        Ok(atomic::write(path, |w| {
            [CHECKPOINT, &sum[..], &bytes].iter().try_for_each(|part| w.write_all(part))
        })?)
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

    /// How the fit went, when it is done.
    fn report(
        self,
        trainer: &Trainer<'_>,
        trained_on: &str,
        sequence: &Sequence,
        options: &FitOptions,
    ) -> FitReport {
        FitReport {
            schema: SCHEMA,
            code: CodeVersions::CURRENT,
            trained_on: trained_on.to_owned(),
            frames: sequence.frames.iter().map(|frame| frame.name.clone()).collect(),
            options: options.clone(),
            splats: trainer.avatar().gaussians.len(),
            curve: self.curve,
            held_out: self.held_out,
            warnings: self.warnings,
        }
    }

    /// Keeps a warning, and says it the first time.
    fn note_warning(&mut self, warning: String, watch: &mut Watch<'_>) -> Result<(), Error> {
        if !self.warnings.contains(&warning) {
            watch(FitEvent::Warning(&warning))?;
            self.warnings.push(warning);
        }
        Ok(())
    }
}
