//! Held-out frames that say on the way of a fit how it does: a few, kept in memory for all fits of a subject.

use super::{Error, Library};
use crate::experiment::{AvatarBuild, Job, Plan};
use skinsplat_data::Sequence;
use skinsplat_data::select::evenly_spaced;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Frames per test sequence behind a point of a curve, which needs fewer than a table.
const FRAMES: usize = 4;

/// Data set, subject, resolution and the frames of each sequence.
type Key = (String, String, Option<u32>, Vec<(String, Vec<usize>)>);

/// The frames of a plan's subjects, loaded when they are first asked for.
pub(super) struct CurveFrames<'a> {
    plan: &'a Plan,
    loaded: BTreeMap<Key, Arc<Vec<Sequence>>>,
}

impl<'a> CurveFrames<'a> {
    /// None loaded yet.
    pub(super) fn new(plan: &'a Plan) -> Self {
        Self { plan, loaded: BTreeMap::new() }
    }

    /// Some of the frames on which the plan scores what is drawn with an avatar, at the avatar's resolution.
    ///
    /// # Errors
    /// Frames that cannot be read.
    pub(super) fn of(&mut self, build: &AvatarBuild, library: &Library) -> Result<Arc<Vec<Sequence>>, Error> {
        let key = self.key(build);
        if let Some(loaded) = self.loaded.get(&key) {
            return Ok(loaded.clone());
        }
        let few = |(id, frames): &(String, Vec<usize>)| {
            let sequence = library.sequence(&build.dataset, &build.subject, id)?.selected(frames)?;
            let sequence = build.resolution.map_or(sequence.clone(), |side| sequence.reduced(side));
            Ok(sequence.held()?)
        };
        let sequences = Arc::new(key.3.iter().map(few).collect::<Result<Vec<_>, Error>>()?);
        self.loaded.insert(key, sequences.clone());
        Ok(sequences)
    }

    fn key(&self, build: &AvatarBuild) -> Key {
        let draws = |job: &&Job| job.variants.iter().any(|variant| variant.avatar == build.key);
        let mut scored: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
        for job in self.plan.jobs.iter().filter(draws) {
            scored.entry(&job.sequence).or_default().insert(job.frame);
        }
        let few = |(id, frames): (&str, BTreeSet<usize>)| {
            (id.to_owned(), evenly_spaced(&frames.into_iter().collect::<Vec<_>>(), Some(FRAMES)))
        };
        let frames = scored.into_iter().map(few).collect();
        (build.dataset.clone(), build.subject.clone(), build.resolution, frames)
    }
}
