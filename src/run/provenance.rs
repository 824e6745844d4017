//! Who computed a result, when and with what: kept apart from results, which depend on none of it.

use super::fitting::Part;
use super::{Event, Machine};
use crate::experiment::{CodeVersions, Plan};
use serde::{Deserialize, Serialize};
use skinsplat_data::avatar::file_digest;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The circumstances of a run (`run.json`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Name and version of the program.
    pub program: String,
    /// Versions of the code behind the numbers.
    pub code: CodeVersions,
    /// SHA-256 of the program's file; none if it cannot be read.
    pub binary: Option<String>,
    /// Operating system and processor architecture.
    pub platform: String,
    /// Name of the machine, where the system says it.
    pub host: Option<String>,
    /// Model of the processor, where the system says it.
    pub processor: Option<String>,
    /// SIMD instructions that the renderer used.
    pub simd: String,
    /// Threads that computed.
    pub threads: usize,
    /// The command line; what is no Unicode in it is replaced by U+FFFD.
    pub arguments: Vec<String>,
    /// Digest of the plan.
    pub plan: String,
    /// Digests of the data, by `dataset/subject/sequence`: of the test frames, and of the training frames where there are any.
    pub data: BTreeMap<String, Vec<String>>,
    /// Start, seconds since 1970-01-01 UTC.
    pub started_unix: u64,
    /// Wall-clock seconds of this call; a resumed run counts only its last part.
    pub seconds: f64,
    /// Where they went.
    pub phases: Phases,
    /// Frames that this call rendered, of those that the plan has.
    pub frames_rendered: usize,
    /// Frames of the plan.
    pub frames_planned: usize,
    /// Identifiers that a batch system set, if one did.
    pub batch: Vec<(String, String)>,
}

/// Wall-clock seconds of the parts of a call.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Phases {
    /// Loading the data and planning.
    pub plan: f64,
    /// Making or reading the avatars, one after another.
    pub avatars: Vec<(String, f64)>,
    /// Of each of them the parts of its fit, zeros where it was not fitted; nothing in files of earlier programs.
    #[serde(default)]
    pub fits: Vec<FitParts>,
    /// Drawing and scoring the frames.
    pub frames: f64,
}

impl Phases {
    /// With the times that an earlier call took for the avatars that this one found done or had no need of.
    pub fn or_those_of(&mut self, earlier: &Self) {
        let was_fitted = |parts: &FitParts| parts.iterations > 0.0;
        for (avatar, parts) in earlier.avatars.iter().zip(&earlier.fits) {
            match self.avatars.iter().position(|(label, _)| *label == avatar.0) {
                None => {
                    self.avatars.push(avatar.clone());
                    self.fits.push(*parts);
                }
                Some(i) if was_fitted(parts) && !was_fitted(&self.fits[i]) => {
                    (self.avatars[i].1, self.fits[i]) = (avatar.1, *parts);
                }
                Some(_) => {}
            }
        }
    }
}

/// Wall-clock seconds of the parts of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitParts {
    /// Making or reading the avatar with which it starts.
    pub start: f64,
    /// Its iterations, and what is written.
    pub iterations: f64,
    /// Scores on the way, on frames that it does not see.
    pub curve: f64,
}

/// Notes when the parts of a run begin and end.
#[derive(Debug)]
pub struct Stopwatch(Mutex<Laps>);

#[derive(Debug)]
struct Laps {
    since: Instant,
    avatar: Option<String>,
    /// Seconds of the frames of tables that are done.
    frames: f64,
    parts: FitParts,
    /// An iteration was seen.
    fitted: bool,
    phases: Phases,
}

impl Stopwatch {
    /// Running, after a plan that took so many seconds.
    pub fn after_planning(seconds: f64) -> Self {
        let phases = Phases { plan: seconds, ..Phases::default() };
        Self(Mutex::new(Laps {
            since: Instant::now(),
            avatar: None,
            parts: FitParts::default(),
            fitted: false,
            frames: 0.0,
            phases,
        }))
    }

    /// Sees an event of the run.
    pub fn see(&self, event: &Event) {
        let mut laps = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Avatar(label, _) => {
                laps.since = Instant::now();
                laps.avatar = Some(label.clone());
                (laps.parts, laps.fitted) = (FitParts::default(), false);
            }
            Event::Took(Part::Start, seconds) => laps.parts.start += seconds,
            Event::Took(Part::Curve, seconds) => laps.parts.curve += seconds,
            Event::Fitting(_) => laps.fitted = true,
            Event::AvatarReady => {
                let seconds = laps.since.elapsed().as_secs_f64();
                if let Some(label) = laps.avatar.take() {
                    laps.phases.avatars.push((label, seconds));
                    let mut parts = laps.parts;
                    if laps.fitted {
                        parts.iterations = (seconds - parts.start - parts.curve).max(0.0);
                    }
                    laps.phases.fits.push(parts);
                }
            }
            Event::Frames(_) => {
                laps.since = Instant::now();
                laps.frames = laps.phases.frames;
            }
            Event::FrameDone(_) => laps.phases.frames = laps.frames + laps.since.elapsed().as_secs_f64(),
            _ => {}
        }
    }

    /// What it saw.
    pub fn phases(self) -> Phases {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner).phases
    }
}

fn digests(plan: &Plan) -> BTreeMap<String, Vec<String>> {
    let rows = plan.tables.iter().flat_map(|table| &table.rows);
    let of = rows.filter_map(|row| Some((row.id.clone(), row.data.as_ref()?)));
    of.map(|(id, data)| (id, std::iter::once(data.test.clone()).chain(data.train.clone()).collect()))
        .collect()
}

/// Variables by which batch systems name a task.
const BATCH_VARIABLES: [&str; 5] =
    ["SLURM_JOB_ID", "SLURM_ARRAY_TASK_ID", "HQ_TASK_ID", "PBS_ARRAY_INDEX", "JOB_COMPLETION_INDEX"];

impl Provenance {
    /// The circumstances of a call that starts now.
    pub fn starting(plan: &Plan) -> Self {
        let machine = Machine::here();
        let variable = |name: &&str| std::env::var(name).ok().map(|value| ((*name).to_owned(), value));
        Self {
            program: format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")),
            code: CodeVersions::CURRENT,
            binary: std::env::current_exe().ok().and_then(|path| file_digest(&path).ok()),
            processor: machine.processor,
            host: machine.host,
            platform: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            simd: skinsplat_simd::level()
                .unwrap_or_else(|_| skinsplat_simd::Level::detected())
                .name()
                .to_owned(),
            threads: rayon::current_num_threads(),
            arguments: std::env::args_os().map(|text| text.to_string_lossy().into_owned()).collect(),
            plan: plan.digest.clone(),
            data: digests(plan),
            phases: Phases::default(),
            started_unix: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs()),
            seconds: 0.0,
            frames_rendered: 0,
            frames_planned: 0,
            batch: BATCH_VARIABLES.iter().filter_map(variable).collect(),
        }
    }
}
