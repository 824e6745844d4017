//! What posing and drawing a frame cost, measured with repeats in alternating order while nothing else is drawn.

use super::drawable::{Drawable, Drawn, Scratch};
use super::execute::{Avatars, prepare_avatars, test_sequence};
use super::frame::Frame;
use super::looks::{look, noisy_pose};
use super::{Error, Event, Library};
use crate::experiment::{Job, JobVariant, Plan};
use serde::{Deserialize, Serialize};
use skinsplat_data::select::evenly_spaced;
use std::collections::BTreeMap;
use std::path::Path;

/// Frames of a table that are drawn.
const FRAMES: usize = 3;
/// How often each is drawn by every variant; once more before, to warm up.
const ROUNDS: usize = 5;

/// Name of the file in a run's folder.
pub const FILE_NAME: &str = "costs.json";

/// What the file holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Costs {
    /// Digest of the plan.
    pub plan: String,
    /// Frames per table, at most.
    pub frames: usize,
    /// Repeats of each.
    pub rounds: usize,
    /// Threads that drew one frame.
    pub threads: usize,
    /// By table and variant.
    pub variants: Vec<Cost>,
}

/// What a variant of a table costs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Id of the experiment.
    pub table: String,
    /// Id of the variant.
    pub variant: String,
    /// Posing, milliseconds: the median of the repeats, averaged over the frames.
    pub pose: f64,
    /// Drawing, as posing.
    pub draw: f64,
}

/// Times of each frame and variant: posing and drawing, milliseconds, a pair per repeat.
type Times = BTreeMap<(usize, usize), Vec<[f64; 2]>>;

/// Measures every table of a plan. In every other round variants come in the reverse order, so that none is always drawn after the
/// same one. What cannot be drawn, and what another program drew, has no cost.
///
/// # Errors
/// A folder that cannot be written.
pub fn measure(
    plan: &Plan,
    library: &Library,
    avatars: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Costs, Error> {
    let chosen: Vec<Job> = (0..plan.tables.len()).flat_map(|table| chosen(plan, table)).cloned().collect();
    let avatars = prepare_avatars(plan, &chosen, library, avatars, watch)?;
    let mut costs = Costs {
        plan: plan.digest.clone(),
        frames: FRAMES,
        rounds: ROUNDS,
        threads: rayon::current_num_threads(),
        variants: Vec::new(),
    };
    watch(Event::Frames(chosen.len()));
    for (index, table) in plan.tables.iter().enumerate() {
        let jobs: Vec<&Job> = chosen.iter().filter(|job| job.table == index).collect();
        let mut times = Times::new();
        for (k, job) in jobs.iter().enumerate() {
            // A frame that cannot be read has said so where it was to be scored.
            let _ = time_frame(k, job, library, &avatars, &mut times);
            watch(Event::FrameDone(String::new()));
        }
        for (v, variant) in table.variants.iter().enumerate() {
            let frames: Vec<[f64; 2]> =
                times.iter().filter(|((_, own), _)| *own == v).map(|(_, repeats)| medians(repeats)).collect();
            if !frames.is_empty() {
                let mean = |part: usize| frames.iter().map(|of| of[part]).sum::<f64>() / frames.len() as f64;
                let (table, variant) = (table.experiment.clone(), variant.clone());
                costs.variants.push(Cost { table, variant, pose: mean(0), draw: mean(1) });
            }
        }
    }
    Ok(costs)
}

/// A few frames of a table, evenly spaced over all of its sequences.
fn chosen(plan: &Plan, table: usize) -> Vec<&Job> {
    let jobs: Vec<&Job> = plan.jobs.iter().filter(|job| job.table == table).collect();
    evenly_spaced(&jobs, Some(FRAMES))
}

/// Draws a frame by every variant, several times.
///
/// # Errors
/// A frame that cannot be read.
fn time_frame(
    number: usize,
    job: &Job,
    library: &Library,
    avatars: &Avatars,
    times: &mut Times,
) -> Result<(), Error> {
    let sequence = test_sequence(job, library)?;
    let frame = Frame::load(&sequence, job.frame, None)?;
    let mut scratch = Scratch::default();
    for round in 0..=ROUNDS {
        let mut order: Vec<usize> = (0..job.variants.len()).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for v in order {
            let variant = &job.variants[v];
            let Ok(avatar) = &avatars[&variant.avatar] else { continue };
            if matches!(avatar, Drawable::Renders(_)) {
                continue;
            }
            let Ok(drawn) = draw(avatar, &frame, (job, variant), &mut scratch) else { continue };
            if round > 0 {
                let taken = [drawn.pose_seconds, drawn.render_seconds].map(|seconds| 1000.0 * seconds);
                times.entry((number, v)).or_default().push(taken);
            }
        }
    }
    Ok(())
}

fn draw(
    avatar: &Drawable<'_>,
    frame: &Frame<'_>,
    (job, variant): (&Job, &JobVariant),
    scratch: &mut Scratch,
) -> Result<Drawn, Error> {
    let noisy = noisy_pose(variant, frame.place.0, frame.place.1);
    let noisy = noisy.as_ref().map(|pose| frame.in_pose(pose)).transpose()?;
    avatar.draw(noisy.as_ref().unwrap_or(&frame.view), &look(job, variant, &frame.truth)?, scratch)
}

/// The median of each part.
fn medians(repeats: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|part| {
        let mut values: Vec<f64> = repeats.iter().map(|of| of[part]).collect();
        values.sort_by(f64::total_cmp);
        let middle = values.len() / 2;
        match values.len() % 2 {
            1 => values[middle],
            _ => 0.5 * (values[middle - 1] + values[middle]),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_repeats_counts() {
        assert_eq!(medians(&[[3.0, 1.0], [1.0, 9.0], [2.0, 2.0]]), [2.0, 2.0]);
        assert_eq!(medians(&[[3.0, 1.0], [1.0, 3.0]]), [2.0, 2.0]);
    }
}
