//! Executing jobs: one frame at a time, its truth loaded once, every variant posed, rendered and scored against it.

use super::avatars::{Prepared, prepare};
use super::curve_frames::CurveFrames;
use super::frame::{Drawn, Frame, background};
use super::store::Store;
use super::{Error, Library};
use crate::experiment::{FrameRecord, Job, JobVariant, Outcome, Plan, Seconds};
use rayon::prelude::*;
use skinsplat_data::Sequence;
use skinsplat_fit::train::Step;
use skinsplat_metrics::lpips::{NetworkSource, OneFrame};
use skinsplat_metrics::{PerceptualDistance, Protocol, Wanted};
use skinsplat_render::splat::Renderer;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// What happened, for whoever watches.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// So many avatars have to be made or read before the frames.
    Avatars(usize),
    /// An iteration of the fit of one of them is done.
    Fitting(Step),
    /// One of them is there.
    AvatarReady,
    /// So many jobs are to be done.
    Frames(usize),
    /// One of them is done.
    FrameDone,
}

/// Does the jobs (what [`super::store::outstanding`] left of a plan's), and appends every record to the store as it comes.
///
/// A frame that fails leaves a record that says why, and the others go on.
///
/// # Errors
/// A protocol that needs what the data does not have, or a store or folder that cannot be written.
pub fn execute(
    plan: &Plan,
    jobs: &[Job],
    library: &Library,
    networks: &dyn NetworkSource,
    folder: &Path,
    store: &mut Store,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    jobs.iter().try_for_each(|job| background(job).map(drop))?;
    let avatars = prepare_avatars(plan, jobs, library, folder, watch)?;
    watch(Event::Frames(jobs.len()));
    let store = Mutex::new(store);
    by_frame(jobs).par_iter().try_for_each_init(Renderer::new, |renderer, group| {
        let records = run_frame(group, library, networks, &avatars, renderer);
        let mut store = store.lock().unwrap_or_else(PoisonError::into_inner);
        store.append(&records)?;
        group.iter().for_each(|_| watch(Event::FrameDone));
        Ok::<(), Error>(())
    })
}

/// An avatar, or why there is none.
pub(super) type Built = Result<Prepared, String>;

pub(super) type Avatars = BTreeMap<String, Built>;

/// The avatars that the jobs need, one after another: each build is parallel in itself. One that cannot be made fails the
/// frames that need it, and no others.
pub(super) fn prepare_avatars(
    plan: &Plan,
    jobs: &[Job],
    library: &Library,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Avatars, Error> {
    let needed = |key: &str| jobs.iter().flat_map(|job| &job.variants).any(|variant| variant.avatar == key);
    let builds: Vec<_> = plan.avatars.iter().filter(|build| needed(&build.key)).collect();
    watch(Event::Avatars(builds.len()));
    std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?;
    let mut avatars = Avatars::new();
    let mut curves = CurveFrames::new(plan);
    for build in builds {
        avatars.insert(
            build.key.clone(),
            prepare(build, library, &mut curves, folder, watch).map_err(|error| error.to_string()),
        );
        watch(Event::AvatarReady);
    }
    Ok(avatars)
}

/// Jobs of several tables that look at one frame, together: its truth is loaded once.
fn by_frame(jobs: &[Job]) -> Vec<Vec<&Job>> {
    let mut groups: BTreeMap<_, Vec<&Job>> = BTreeMap::new();
    for job in jobs {
        let frame = (&job.dataset, &job.subject, &job.sequence, job.frame, job.resolution);
        groups.entry(frame).or_default().push(job);
    }
    groups.into_values().collect()
}

/// The records of all jobs of one frame.
fn run_frame(
    jobs: &[&Job],
    library: &Library,
    networks: &dyn NetworkSource,
    avatars: &Avatars,
    renderer: &mut Renderer,
) -> Vec<FrameRecord> {
    let failed = |error: &Error| {
        let record = |job: &&Job| {
            let record =
                |variant| record(job, variant, Outcome::Error(error.to_string()), Seconds::default());
            job.variants.iter().map(record).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(record).collect()
    };
    let first = jobs[0];
    let sequence = match test_sequence(first, library) {
        Ok(sequence) => sequence,
        Err(error) => return failed(&error),
    };
    let frame = match Frame::load(&sequence, first.frame) {
        Ok(frame) => frame,
        Err(error) => return failed(&error),
    };
    let distances = OneFrame::new(networks);
    let mut records = Vec::new();
    for job in jobs {
        for variant in &job.variants {
            let mut seconds = Seconds::default();
            let avatar = &avatars[&variant.avatar];
            let outcome = match run_variant(job, variant, &frame, avatar, &distances, renderer, &mut seconds)
            {
                Ok(outcome) => outcome,
                Err(error) => Outcome::Error(error.to_string()),
            };
            records.push(record(job, variant, outcome, seconds));
        }
    }
    records
}

/// The sequence of a job at the job's resolution.
pub(super) fn test_sequence(job: &Job, library: &Library) -> Result<Sequence, Error> {
    let sequence = library.sequence(&job.dataset, &job.subject, &job.sequence)?;
    Ok(job.resolution.map_or_else(|| sequence.clone(), |side| sequence.reduced(side)))
}

fn record(job: &Job, variant: &JobVariant, outcome: Outcome, seconds: Seconds) -> FrameRecord {
    FrameRecord { key: variant.key.clone(), label: job.label(variant), outcome, seconds }
}

fn run_variant(
    job: &Job,
    variant: &JobVariant,
    frame: &Frame<'_>,
    avatar: &Built,
    distances: &dyn PerceptualDistance,
    renderer: &mut Renderer,
    seconds: &mut Seconds,
) -> Result<Outcome, Error> {
    let avatar = avatar.as_ref().map_err(|problem| Error::Avatar { problem: problem.clone() })?;
    let protocol = Protocol::parse(&job.protocol)?;
    let drawn = frame.draw(job, variant, avatar, renderer, seconds)?;
    let start = Instant::now();
    let truth = skinsplat_metrics::Truth::Straight { rgb: &frame.truth.rgb, alpha: &frame.truth.alpha };
    let wanted = Wanted { ssim: job.ssim, lpips: job.lpips.then_some(distances) };
    let score = protocol.score_with(&drawn.image, truth, wanted)?;
    seconds.score = start.elapsed().as_secs_f64();
    let Drawn { splats, visible_splats, .. } = drawn;
    Ok(Outcome::Scored { score, splats, visible_splats })
}
