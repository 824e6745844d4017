//! How a variant of a job is drawn: over what, and in which pose.

use super::Error;
use super::drawable::Look;
use super::frame::behind;
use crate::experiment::{Job, JobVariant};
use skinsplat_core::scene::Pose;
use skinsplat_data::{Sequence, Truth};

/// How a variant of a job is drawn where its truth is this one.
pub(super) fn look<'a>(job: &Job, variant: &JobVariant, truth: &'a Truth) -> Result<Look<'a>, Error> {
    let background = behind(&job.protocol, truth)?;
    Ok(Look { strategy: variant.strategy, background, antialiased: job.antialiased })
}

/// The pose of a frame with the variant's noise, if it has any.
pub(super) fn noisy_pose(variant: &JobVariant, sequence: &Sequence, frame: usize) -> Option<Pose> {
    let noise = variant.noise?;
    Some(sequence.noisy_pose(sequence.frames[frame].pose, noise.degrees, noise.seed))
}
