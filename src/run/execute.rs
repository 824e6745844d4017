//! Executing jobs: one frame at a time, its truth loaded once, every variant posed, rendered and scored against it.

use super::avatars::{Prepared, prepare};
use super::store::Store;
use super::{Error, Library};
use crate::data::{Sequence, Truth};
use crate::experiment::{FrameRecord, Job, JobVariant, Outcome, Plan, Seconds};
use crate::metrics::{self, FrameScore, Protocol};
use crate::render::mesh::SamplePattern;
use crate::render::splat::{RenderSettings, Renderer};
use crate::scene::{Camera, Image, Pose, PosedBody};
use crate::strategy::{self, Strategy};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// What happened, for whoever watches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// So many avatars have to be made or read before the frames.
    Avatars(usize),
    /// One of them is there.
    AvatarReady,
    /// So many jobs are to be done.
    Frames(usize),
    /// One of them is done.
    FrameDone,
}

/// Samples per pixel side with which textured meshes are drawn: 16 samples on a rotated grid.
const MESH_SAMPLES: usize = 4;

/// Does the jobs (what [`super::store::outstanding`] left of a plan's), and appends every record to the store as it comes.
///
/// A frame that fails leaves a record that says why, and the others go on.
///
/// # Errors
/// An avatar that cannot be made, or a store or folder that cannot be written.
pub fn execute(
    plan: &Plan,
    jobs: &[Job],
    library: &Library,
    folder: &Path,
    store: &mut Store,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    let avatars = prepare_avatars(plan, jobs, library, folder, watch)?;
    watch(Event::Frames(jobs.len()));
    let store = Mutex::new(store);
    by_frame(jobs).par_iter().try_for_each_init(Renderer::new, |renderer, group| {
        let records = run_frame(group, library, &avatars, renderer);
        let mut store = store.lock().unwrap_or_else(PoisonError::into_inner);
        store.append(&records)?;
        group.iter().for_each(|_| watch(Event::FrameDone));
        Ok::<(), Error>(())
    })
}

type Avatars = BTreeMap<String, Prepared>;

/// The avatars that the jobs need, one after another: each build is parallel in itself.
fn prepare_avatars(
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
    for build in builds {
        avatars.insert(build.key.clone(), prepare(build, library, folder)?);
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

/// A frame, loaded.
struct Frame<'a> {
    truth: Truth,
    camera: &'a Camera,
    pose: &'a Pose,
    body: PosedBody<'a>,
}

impl<'a> Frame<'a> {
    fn load(sequence: &'a Sequence, index: usize) -> Result<Self, Error> {
        let truth = sequence.truth(index)?;
        let frame = &sequence.frames[index];
        let (pose, camera) = (&sequence.poses[frame.pose], &sequence.cameras[frame.camera]);
        Ok(Self { truth, camera, pose, body: PosedBody::new(&sequence.body, pose)? })
    }
}

/// The records of all jobs of one frame.
fn run_frame(
    jobs: &[&Job],
    library: &Library,
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
    let sequence = match library.sequence(&first.dataset, &first.subject, &first.sequence) {
        Ok(sequence) => sequence,
        Err(error) => return failed(&error),
    };
    let reduced = first.resolution.map(|side| sequence.reduced(side));
    let frame = match Frame::load(reduced.as_ref().unwrap_or(sequence), first.frame) {
        Ok(frame) => frame,
        Err(error) => return failed(&error),
    };
    let mut records = Vec::new();
    for job in jobs {
        for variant in &job.variants {
            let mut seconds = Seconds::default();
            let outcome =
                match run_variant(job, variant, &frame, &avatars[&variant.avatar], renderer, &mut seconds) {
                    Ok(outcome) => outcome,
                    Err(error) => Outcome::Error(error.to_string()),
                };
            records.push(record(job, variant, outcome, seconds));
        }
    }
    records
}

fn record(job: &Job, variant: &JobVariant, outcome: Outcome, seconds: Seconds) -> FrameRecord {
    FrameRecord { key: variant.key.clone(), label: job.label(variant), outcome, seconds }
}

fn run_variant(
    job: &Job,
    variant: &JobVariant,
    frame: &Frame<'_>,
    avatar: &Prepared,
    renderer: &mut Renderer,
    seconds: &mut Seconds,
) -> Result<Outcome, Error> {
    let protocol = Protocol::parse(&job.protocol)?;
    let background =
        protocol.background_colour().ok_or_else(|| Error::NoBackground { protocol: job.protocol.clone() })?;
    let (image, splats, visible_splats) = match avatar {
        Prepared::Textured(textured) => {
            let start = Instant::now();
            let pattern = SamplePattern::new(MESH_SAMPLES);
            let rendered = textured.draw(frame.pose, frame.camera, pattern, background)?;
            seconds.render = start.elapsed().as_secs_f64();
            (rendered.image, None, None)
        }
        Prepared::Gaussians(bound) => {
            let strategy: Strategy = variant.strategy.as_deref().unwrap_or_default().parse()?;
            let start = Instant::now();
            let posed = strategy::pose(bound, &frame.body, &strategy)?;
            seconds.pose = start.elapsed().as_secs_f64();
            let settings = RenderSettings { background, antialiased: job.antialiased };
            let start = Instant::now();
            let rendered = renderer.render(&posed, frame.camera, &settings);
            seconds.render = start.elapsed().as_secs_f64();
            (rendered.image, Some(posed.len() as u64), Some(renderer.visible() as u64))
        }
    };
    let start = Instant::now();
    let score = score(&protocol, &image, &frame.truth)?;
    seconds.score = start.elapsed().as_secs_f64();
    Ok(Outcome::Scored { score, splats, visible_splats })
}

fn score(protocol: &Protocol, image: &Image, truth: &Truth) -> Result<FrameScore, Error> {
    let truth = metrics::Truth::Straight { rgb: &truth.rgb, alpha: &truth.alpha };
    Ok(protocol.score(image, truth)?)
}
