//! The frame before a frame, drawn again for metrics of motion.

use super::Error;
use super::drawable::{Drawable, PosedView, Scratch};
use super::frame::Frame;
use super::looks::{look, noisy_pose};
use crate::experiment::{Job, JobVariant};
use skinsplat_core::scene::Image;
use skinsplat_metrics::{Before, MetricId, ROTATION_JUMP_DEGREES, Wanted};

/// What metrics of motion see of the frame before, or why they do not.
pub(super) struct FrameBefore<'f, 'd> {
    drawn: Result<(Image, &'f Frame<'d>), String>,
    rotation_jumps: Result<u64, String>,
}

/// A frame as one variant of a job sees it.
#[derive(Clone, Copy)]
pub(super) struct Seen<'s> {
    pub(super) job: &'s Job,
    pub(super) variant: &'s JobVariant,
    pub(super) avatar: &'s Drawable<'static>,
    /// The frame in the pose that the variant has it in.
    pub(super) view: &'s PosedView<'s>,
}

impl<'f, 'd> FrameBefore<'f, 'd> {
    /// Draws the frame before as a variant draws the frame, and compares the rotations. What no metric of the job asks for is
    /// left out.
    pub(super) fn of(seen: Seen<'_>, frame: &'f Frame<'d>, scratch: &mut Scratch) -> Self {
        let nothing = |why: &str| Self { drawn: Err(why.to_owned()), rotation_jumps: Err(why.to_owned()) };
        if !seen.job.metrics.iter().any(|metric| metric.needs_before()) {
            return nothing("nobody asked");
        }
        match frame.before() {
            Err(why) => {
                // What no frame has is the better reason.
                let never = seen.avatar.turned_by(seen.variant.strategy).err().map(|error| error.to_string());
                Self { rotation_jumps: Err(never.unwrap_or_else(|| why.to_owned())), ..nothing(why) }
            }
            Ok(before) => {
                seen.with(before, scratch).unwrap_or_else(|problem: Error| nothing(&problem.to_string()))
            }
        }
    }

    /// What is wanted of the frame, with what is known of the one before.
    pub(super) fn wanted<'w>(&'w self, wanted: Wanted<'w>) -> Wanted<'w> {
        let drawn = self.drawn.as_ref();
        let before = drawn.map(|(render, frame)| Before { render, truth: frame.straight_truth() });
        let (before, jumps) = (before.map_err(String::as_str), self.rotation_jumps.as_ref());
        Wanted { before, rotation_jumps: jumps.copied().map_err(String::as_str), ..wanted }
    }
}

impl Seen<'_> {
    /// Draws and compares, given the frame before.
    fn with<'f, 'd>(
        self,
        before: &'f Frame<'d>,
        scratch: &mut Scratch,
    ) -> Result<FrameBefore<'f, 'd>, Error> {
        let Self { job, variant, avatar, view } = self;
        let (sequence, index) = before.place;
        let noisy = noisy_pose(variant, sequence, index);
        let noisy = noisy.as_ref().map(|pose| before.in_pose(pose)).transpose()?;
        let earlier = noisy.as_ref().unwrap_or(&before.view);
        let look = look(job, variant, &before.truth)?;
        let draw = |scratch| Ok((avatar.draw(earlier, &look, scratch)?.image, before));
        let jumps = || avatar.rotation_jumps(earlier, view, look.strategy, ROTATION_JUMP_DEGREES);
        let asked = |metric| match job.metrics.contains(&metric) {
            true => Ok(()),
            false => Err("nobody asked".to_owned()),
        };
        let told = |error: Error| error.to_string();
        Ok(FrameBefore {
            drawn: asked(MetricId::FLICKER).and_then(|()| draw(scratch).map_err(told)),
            rotation_jumps: asked(MetricId::ROTATION_JUMPS).and_then(|()| jumps().map_err(told)),
        })
    }
}
