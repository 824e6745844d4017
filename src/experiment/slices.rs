//! A plan cut into slices of about equal cost, for several machines: a pure function of the plan, so that every machine cuts
//! alike and nobody has to tell the others.
//!
//! What is scored with one avatar stays together where it can: whoever draws with an avatar has to make it first. The unit is
//! therefore an avatar with a share of its frames. The frames of one avatar are shared among several slices only in shares
//! that cost at least as much as the avatar does, and at least an eighth of a slice. Units go, the most expensive first, to
//! the slice that is then the least loaded; one that has the avatar already does not pay for it again. No slice
//! therefore costs more than the mean by more than one unit.

use super::{AvatarSource, Job, JobVariant, Plan, PlannedAvatar, Shard};
use std::collections::{BTreeMap, BTreeSet};

/// Estimated work, in pixels of a fit's iteration, about 31 ns of two cores each. The proportions are those of
/// benches/README.md; no result depends on them.
type Cost = u64;

/// An iteration of a fit, per pixel of its image: forth, back and the loss, without a perceptual metric.
const ITERATION_PER_PIXEL: Cost = 1;
/// An iteration of a fit, per Gaussian: posing, its adjoint and the step.
const ITERATION_PER_SPLAT: Cost = 13;
/// A frame, per pixel: reading, drawing, scoring, LPIPS included.
const FRAME_PER_PIXEL: Cost = 13;
/// Reading a file and binding its Gaussians.
const READING: Cost = 1_000_000;
/// Square millimetres of an adult's skin.
const SKIN: u64 = 1_900_000;
/// The longer side of an image whose size nobody said, pixels.
const USUAL_SIDE: u32 = 1024;
/// Frames of an avatar are shared out in pieces of at least this part of a slice.
const PIECES_PER_SHARD: Cost = 8;

/// Which slice every record belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slices {
    /// The slice of each record, by its content key.
    owner: BTreeMap<String, Shard>,
    /// Estimated cost of each slice.
    loads: Vec<u64>,
    /// Estimated cost of the most expensive unit.
    largest_unit: u64,
}

/// An avatar with a share of its frames.
struct Unit<'a> {
    avatar: &'a str,
    keys: Vec<&'a str>,
    making: Cost,
    frames: Cost,
}

impl Slices {
    /// The plan in so many slices.
    pub fn of(plan: &Plan, count: usize) -> Self {
        let mut units = units(plan, count);
        // Stable: units of the same cost stay in the order of the plan.
        units.sort_by_key(|unit| std::cmp::Reverse(unit.making + unit.frames));
        let mut loads: Vec<Cost> = vec![0; count];
        let mut has: Vec<BTreeSet<&str>> = vec![BTreeSet::new(); count];
        let mut owner = BTreeMap::new();
        for unit in &units {
            let added = |slice: usize| match has[slice].contains(unit.avatar) {
                true => unit.frames,
                false => unit.making + unit.frames,
            };
            let Some(slice) = (0..count).min_by_key(|&slice| loads[slice] + added(slice)) else { break };
            loads[slice] += added(slice);
            has[slice].insert(unit.avatar);
            if let Ok(shard) = Shard::new(slice + 1, count) {
                owner.extend(unit.keys.iter().map(|key| ((*key).to_owned(), shard)));
            }
        }
        let largest_unit = units.first().map_or(0, |unit| unit.making + unit.frames);
        Self { owner, loads, largest_unit }
    }

    /// The slice of a record.
    pub fn owner(&self, key: &str) -> Option<Shard> {
        self.owner.get(key).copied()
    }

    /// Estimated cost of each slice, in pixels of a fit's iteration.
    pub fn loads(&self) -> &[u64] {
        &self.loads
    }

    /// Estimated cost of the most expensive unit: what cannot be shared out any further.
    pub fn largest_unit(&self) -> u64 {
        self.largest_unit
    }

    /// The jobs of a slice, in order, each with its variants that belong to the slice.
    pub fn jobs(&self, jobs: &[Job], shard: Shard) -> Vec<Job> {
        let own = |variant: &&JobVariant| self.owner(&variant.key) == Some(shard);
        let of_shard = |job: &Job| {
            let variants: Vec<JobVariant> = job.variants.iter().filter(own).cloned().collect();
            (!variants.is_empty()).then(|| Job { variants, ..job.clone() })
        };
        jobs.iter().filter_map(of_shard).collect()
    }
}

/// An avatar with the keys and costs of all its frames.
struct Drawn<'a> {
    avatar: &'a str,
    making: Cost,
    frames: Vec<(&'a str, Cost)>,
}

impl Drawn<'_> {
    fn cost(&self) -> Cost {
        self.making + self.frames.iter().map(|(_, cost)| cost).sum::<Cost>()
    }
}

/// What is shared out, in the order of the plan.
fn units(plan: &Plan, count: usize) -> Vec<Unit<'_>> {
    let mut by_avatar: Vec<Drawn<'_>> = Vec::new();
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut known: BTreeSet<&str> = BTreeSet::new();
    let avatars: BTreeMap<&str, &PlannedAvatar> =
        plan.avatars.iter().map(|avatar| (avatar.key.as_str(), avatar)).collect();
    for job in &plan.jobs {
        let pixels = pixels(plan, job);
        for variant in job.variants.iter().filter(|variant| known.insert(&variant.key)) {
            let place = *places.entry(&variant.avatar).or_insert_with(|| {
                let making = avatars.get(variant.avatar.as_str()).map_or(0, |avatar| making(avatar, pixels));
                by_avatar.push(Drawn { avatar: &variant.avatar, making, frames: Vec::new() });
                by_avatar.len() - 1
            });
            by_avatar[place].frames.push((&variant.key, frame(variant, pixels)));
        }
    }
    let total: Cost = by_avatar.iter().map(Drawn::cost).sum();
    let least = total / (PIECES_PER_SHARD * count as Cost);
    by_avatar.iter().flat_map(|drawn| shared_out(drawn, least)).collect()
}

/// The frames of an avatar in shares that cost at least `least` and as much as the avatar.
fn shared_out<'a>(drawn: &Drawn<'a>, least: Cost) -> Vec<Unit<'a>> {
    let &Drawn { avatar, making, ref frames } = drawn;
    let enough = least.max(making).max(1);
    let mut units: Vec<Unit<'a>> = Vec::new();
    for &(key, cost) in frames {
        match units.last_mut() {
            Some(unit) if unit.frames < enough => {
                unit.keys.push(key);
                unit.frames += cost;
            }
            _ => units.push(Unit { avatar, keys: vec![key], making, frames: cost }),
        }
    }
    units
}

/// Pixels of a frame as it is scored.
fn pixels(plan: &Plan, job: &Job) -> Cost {
    let row = plan.tables.get(job.table).and_then(|table| table.rows.get(job.row));
    let [width, height] = row.and_then(|row| row.image).unwrap_or([USUAL_SIDE; 2]).map(u64::from);
    let side = width.max(height).max(1);
    let scored = job.resolution.map_or(side, |resolution| side.min(u64::from(resolution)));
    (width * scored / side).max(1) * (height * scored / side).max(1)
}

fn frame(variant: &JobVariant, pixels: Cost) -> Cost {
    let fitting = variant.fitted.as_ref().map_or(0, |options| Cost::from(options.steps));
    pixels * (FRAME_PER_PIXEL + fitting * ITERATION_PER_PIXEL)
}

/// What it costs to make an avatar whose images have so many pixels.
fn making(avatar: &PlannedAvatar, pixels: Cost) -> Cost {
    let images = |training: &super::TrainingFrames| {
        (training.frames.len() + training.further.iter().map(|(_, frames)| frames.len()).sum::<usize>())
            as Cost
    };
    match &avatar.source {
        AvatarSource::Missing { .. } | AvatarSource::Renders(_) => 0,
        AvatarSource::File { .. } => READING,
        AvatarSource::Surface { training, edge_mm, .. } => images(training) * pixels + splats(*edge_mm),
        AvatarSource::Textured { training, size } => {
            images(training) * pixels + Cost::from(*size) * Cost::from(*size)
        }
        AvatarSource::Fit { training, fit } => {
            let iteration = ITERATION_PER_PIXEL * pixels + ITERATION_PER_SPLAT * splats(fit.options.edge_mm);
            images(training) * pixels + Cost::from(fit.options.iterations) * iteration
        }
    }
}

/// About how many Gaussians an avatar has whose triangles have edges of so many millimetres: the vertices of equilateral ones,
/// two triangles each, of area √3/4 e².
fn splats(edge_mm: u32) -> Cost {
    let edge = u64::from(edge_mm.max(1));
    SKIN * 1000 / (866 * edge * edge)
}
