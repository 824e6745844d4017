//! Executing jobs: one frame at a time, its truth loaded once, every variant posed, rendered and scored against it.

use super::avatars::Workshop;
use super::before::{FrameBefore, Seen};
use super::drawable::{Drawable, Drawn, Scratch};
use super::fitting::Part;
use super::frame::{Frame, Scored, check_background};
use super::looks::{look, noisy_pose};
use super::sizes::bytes;
use super::store::Store;
use super::{Error, Library};
use crate::experiment::{FittedOutcome, FrameRecord, Job, JobVariant, Outcome, Plan, Seconds};
use rayon::prelude::*;
use skinsplat_data::Sequence;
use skinsplat_fit::train::Step;
use skinsplat_metrics::lpips::{NetworkSource, OneFrame};
use skinsplat_metrics::{PerceptualDistance, Wanted};
use skinsplat_posing::BendingJoints;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// What happened, for whoever watches.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// So many avatars have to be made or read before the frames.
    Avatars(usize),
    /// This one comes next, for these variants.
    Avatar(String, Vec<String>),
    /// A part of its fit took so many seconds.
    Took(Part, f64),
    /// An iteration of its fit is done.
    Fitting(Step),
    /// Something is wrong, but not fatally.
    Warning(String),
    /// One of them is there.
    AvatarReady,
    /// So many jobs are to be done.
    Frames(usize),
    /// One of them, called so, is done.
    FrameDone(String),
    /// The last frame of a sequence is done, of so many.
    SequenceDone(String, usize),
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
    check(jobs, library)?;
    let avatars = prepare_avatars(plan, jobs, library, folder, watch)?;
    let bending = bending(jobs, library)?;
    let bytes = bytes(plan, folder);
    let at_hand = AtHand { library, networks, avatars: &avatars, bending: &bending, bytes: &bytes };
    watch(Event::Frames(jobs.len()));
    let state = Mutex::new((store, Left::of(jobs)));
    by_frame(jobs).par_iter().try_for_each_init(Scratch::default, |scratch, group| {
        let records = run_frame(group, &at_hand, scratch);
        let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
        let (store, left) = &mut *state;
        store.append(&records)?;
        for job in group {
            watch(Event::FrameDone(job.frame_name()));
            left.done(job, watch);
        }
        Ok::<(), Error>(())
    })
}

/// Whether the data have what the jobs' protocols need: known before anything is made.
///
/// # Errors
/// A protocol that needs what the data does not have.
pub fn check(jobs: &[Job], library: &Library) -> Result<(), Error> {
    jobs.iter().try_for_each(|job| {
        let sequence = library.sequence(&job.dataset, &job.subject, &job.sequence)?;
        let frame = sequence.frames.get(job.frame);
        frame.map_or(Ok(()), |frame| check_background(&job.protocol, &frame.source))
    })
}

/// How many jobs each sequence has, and how many of them are left.
struct Left(BTreeMap<String, [usize; 2]>);

impl Left {
    fn of(jobs: &[Job]) -> Self {
        let mut left: BTreeMap<String, [usize; 2]> = BTreeMap::new();
        for job in jobs {
            left.entry(job.sequence_name()).or_default().iter_mut().for_each(|count| *count += 1);
        }
        Self(left)
    }

    fn done(&mut self, job: &Job, watch: &(dyn Fn(Event) + Sync)) {
        let name = job.sequence_name();
        let Some([all, left]) = self.0.get_mut(&name) else { return };
        *left -= 1;
        if *left == 0 {
            watch(Event::SequenceDone(name, *all));
        }
    }
}

/// An avatar, or why there is none.
pub(super) type Built = Result<Drawable<'static>, String>;

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
    let planned: Vec<_> = plan.avatars.iter().filter(|avatar| needed(&avatar.key)).collect();
    watch(Event::Avatars(planned.len()));
    std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?;
    let mut workshop = Workshop::new(plan, library, folder, watch);
    let mut avatars = Avatars::new();
    for avatar in planned {
        let variants =
            jobs.iter().flat_map(|job| &job.variants).filter(|variant| variant.avatar == avatar.key);
        let variants: BTreeSet<&str> = variants.map(|variant| variant.id.as_str()).collect();
        watch(Event::Avatar(avatar.label(), variants.into_iter().map(str::to_owned).collect()));
        let built = workshop.prepare(avatar).map_err(|error| error.to_string());
        avatars.insert(avatar.key.clone(), built);
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

/// What the frames of a run share.
struct AtHand<'a> {
    library: &'a Library,
    networks: &'a dyn NetworkSource,
    avatars: &'a Avatars,
    /// By [`Job::sequence_name`].
    bending: &'a BTreeMap<String, BendingJoints>,
    /// Of the files of an avatar, by its key.
    bytes: &'a BTreeMap<&'a str, u64>,
}

/// Which joints bend the body of each sequence.
fn bending(jobs: &[Job], library: &Library) -> Result<BTreeMap<String, BendingJoints>, Error> {
    let mut found = BTreeMap::new();
    for job in jobs {
        if let Entry::Vacant(entry) = found.entry(job.sequence_name()) {
            let sequence = library.sequence(&job.dataset, &job.subject, &job.sequence)?;
            entry.insert(BendingJoints::of(&sequence.body));
        }
    }
    Ok(found)
}

/// The records of all jobs of one frame.
fn run_frame(jobs: &[&Job], at_hand: &AtHand<'_>, scratch: &mut Scratch) -> Vec<FrameRecord> {
    let AtHand { library, networks, avatars, bending, bytes } = *at_hand;
    let first = jobs[0];
    let sequence = test_sequence(first, library);
    let frame = sequence
        .as_ref()
        .map_err(ToString::to_string)
        .and_then(|sequence| Frame::load(sequence, first.frame, None).map_err(|error| error.to_string()));
    let joints = bending.get(&first.sequence_name());
    let bend = joints.zip(frame.as_ref().ok()).and_then(|(joints, frame)| joints.widest(&frame.view.body));
    let distances = OneFrame::new(networks);
    let mut records = Vec::new();
    for job in jobs {
        for variant in &job.variants {
            let outcome = frame.as_ref().map_err(Clone::clone).and_then(|frame| {
                let avatar = &avatars[&variant.avatar];
                run_variant(job, variant, frame, avatar, &distances, scratch)
                    .map_err(|error| error.to_string())
            });
            let (outcome, seconds) =
                outcome.unwrap_or_else(|problem| (Outcome::Error(problem), Seconds::default()));
            let (key, label) = (variant.key.clone(), job.label(variant));
            let bytes = bytes.get(variant.avatar.as_str()).copied();
            records.push(FrameRecord { key, label, outcome, seconds, bend, bytes });
        }
    }
    records
}

/// The sequence of a job at the job's resolution.
pub(super) fn test_sequence(job: &Job, library: &Library) -> Result<Sequence, Error> {
    let sequence = library.sequence(&job.dataset, &job.subject, &job.sequence)?;
    Ok(job.resolution.map_or_else(|| sequence.clone(), |side| sequence.reduced(side)))
}

fn run_variant(
    job: &Job,
    variant: &JobVariant,
    frame: &Frame<'_>,
    avatar: &Built,
    distances: &dyn PerceptualDistance,
    scratch: &mut Scratch,
) -> Result<(Outcome, Seconds), Error> {
    let avatar = avatar.as_ref().map_err(|problem| Error::Avatar { problem: problem.clone() })?;
    let wanted = Wanted { lpips: Some(distances), ..Wanted::of(&job.metrics) };
    let noisy = noisy_pose(variant, frame.place.0, frame.place.1);
    if noisy.is_some() && matches!(avatar, Drawable::Renders(_)) {
        return Err(Error::NoPoseToDisturb);
    }
    let noisy_view = noisy.as_ref().map(|pose| frame.in_pose(pose)).transpose()?;
    let view = noisy_view.as_ref().unwrap_or(&frame.view);
    let look = look(job, variant, &frame.truth)?;
    let start = Instant::now();
    let before = FrameBefore::of(Seen { job, variant, avatar, view }, frame, scratch);
    let before_seconds = start.elapsed().as_secs_f64();
    let Scored { score, drawn, score_seconds } =
        frame.evaluate_view(view, avatar, &look, &job.protocol, before.wanted(wanted), scratch)?;
    let start = Instant::now();
    let fitted = variant.fitted.as_ref().map(|options| {
        let fitted = avatar.fit_pose(view, &frame.truth, &look, options).and_then(|found| {
            let view = frame.in_pose(&found.pose)?;
            let scored =
                frame.evaluate_view(&view, avatar, &look, &job.protocol, unfitted(wanted), scratch)?;
            Ok(FittedOutcome::Scored { score: scored.score, turned_degrees: found.turned_degrees })
        });
        fitted.unwrap_or_else(|error| FittedOutcome::Failed(error.to_string()))
    });
    let fit = fitted.as_ref().map_or(0.0, |_| start.elapsed().as_secs_f64());
    let Drawn { visible_splats, pose_seconds, render_seconds, .. } = drawn;
    // Whatever is drawn in order to score is part of scoring.
    let seconds =
        Seconds { pose: pose_seconds, render: render_seconds, score: before_seconds + score_seconds, fit };
    Ok((Outcome::Scored { score, visible_splats, fitted }, seconds))
}

/// What is wanted of a frame whose pose was fitted: that of the frame before was not.
fn unfitted(wanted: Wanted<'_>) -> Wanted<'_> {
    let why = "its pose was not fitted";
    Wanted { before: Err(why), rotation_jumps: Err(why), ..wanted }
}
