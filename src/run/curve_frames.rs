//! Held-out frames that say on the way of a fit how it does: a few, kept in memory for all fits of a subject.

use super::{Error, Library};
use crate::experiment::{Job, Plan, PlannedAvatar};
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

    /// Some of the frames on which the plan scores what is drawn with an avatar, of the subject that it is made from and at
    /// its resolution.
    ///
    /// # Errors
    /// Frames that cannot be read.
    pub(super) fn of(
        &mut self,
        avatar: &PlannedAvatar,
        library: &Library,
    ) -> Result<Arc<Vec<Sequence>>, Error> {
        let key = self.key(avatar);
        if let Some(loaded) = self.loaded.get(&key) {
            return Ok(loaded.clone());
        }
        let (dataset, subject, resolution, frames) = &key;
        let few = |(id, frames): &(String, Vec<usize>)| {
            let sequence = library.sequence(dataset, subject, id)?.selected(frames)?;
            let sequence = resolution.map_or(sequence.clone(), |side| sequence.reduced(side));
            Ok(sequence.held()?)
        };
        let sequences = Arc::new(frames.iter().map(few).collect::<Result<Vec<_>, Error>>()?);
        self.loaded.insert(key, sequences.clone());
        Ok(sequences)
    }

    /// Data that is there under two names shares its avatars: only the frames under the avatar's own are looked at.
    fn key(&self, avatar: &PlannedAvatar) -> Key {
        let draws = |job: &&Job| {
            (&job.dataset, &job.subject) == (&avatar.dataset, &avatar.subject)
                && job.variants.iter().any(|variant| variant.avatar == avatar.key)
        };
        let mut scored: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
        for job in self.plan.jobs.iter().filter(draws) {
            scored.entry(&job.sequence).or_default().insert(job.frame);
        }
        let few = |(id, frames): (&str, BTreeSet<usize>)| {
            (id.to_owned(), evenly_spaced(&frames.into_iter().collect::<Vec<_>>(), Some(FRAMES)))
        };
        let frames = scored.into_iter().map(few).collect();
        let resolution = avatar.training().and_then(|training| training.resolution);
        (avatar.dataset.clone(), avatar.subject.clone(), resolution, frames)
    }
}
