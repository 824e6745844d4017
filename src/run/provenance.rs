//! Who computed a result, when and with what: kept apart from results, which depend on none of it.

use serde::Serialize;
use std::time::{SystemTime, UNIX_EPOCH};

/// The circumstances of a run (`run.json`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Name and version of the program.
    pub program: String,
    /// Operating system and processor architecture.
    pub platform: String,
    /// SIMD instructions that the renderer used.
    pub simd: String,
    /// Threads that computed.
    pub threads: usize,
    /// The command line; what is no Unicode in it is replaced by U+FFFD.
    pub arguments: Vec<String>,
    /// Digest of the plan.
    pub plan: String,
    /// Start, seconds since 1970-01-01 UTC.
    pub started_unix: u64,
    /// Wall-clock seconds of this call; a resumed run counts only its last part.
    pub seconds: f64,
    /// Frames that this call rendered, of those that the plan has.
    pub frames_rendered: usize,
    /// Frames of the plan.
    pub frames_planned: usize,
    /// Identifiers that a batch system set, if one did.
    pub batch: Vec<(String, String)>,
}

/// Variables by which batch systems name a task.
const BATCH_VARIABLES: [&str; 5] =
    ["SLURM_JOB_ID", "SLURM_ARRAY_TASK_ID", "HQ_TASK_ID", "PBS_ARRAY_INDEX", "JOB_COMPLETION_INDEX"];

impl Provenance {
    /// The circumstances of a call that starts now.
    pub fn starting(plan: &str) -> Self {
        let variable = |name: &&str| std::env::var(name).ok().map(|value| ((*name).to_owned(), value));
        Self {
            program: format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")),
            platform: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            simd: skinsplat_simd::level()
                .unwrap_or_else(|_| skinsplat_simd::Level::detected())
                .name()
                .to_owned(),
            threads: rayon::current_num_threads(),
            arguments: std::env::args_os().map(|text| text.to_string_lossy().into_owned()).collect(),
            plan: plan.to_owned(),
            started_unix: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs()),
            seconds: 0.0,
            frames_rendered: 0,
            frames_planned: 0,
            batch: BATCH_VARIABLES.iter().filter_map(variable).collect(),
        }
    }
}
