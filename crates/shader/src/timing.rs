//! Six avatars a frame, timed.

use super::cases;
use super::gpu::{Avatar, Frame, Gpu, GpuError, Skinning};
use super::{Colour, Rotation, Shape};

/// What is timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Avatars of a frame, each in a pose of its own.
    pub avatars: usize,
    /// Gaussians of each.
    pub gaussians: usize,
    /// Frames of a repeat, and how many repeats; a slow adapter does fewer frames.
    pub frames: u32,
    /// Repeats of the whole list of choices.
    pub repeats: usize,
}

/// The times of one choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// What was dispatched.
    pub frame: Frame,
    /// Milliseconds of a frame by the device's clock, median over frames, one per repeat.
    pub device_ms: Vec<f64>,
    /// Milliseconds of a frame by the wall clock, recording and submission included, one per repeat.
    pub wall_ms: Vec<f64>,
}

impl Timing {
    /// Median over the repeats: by the device's clock, by the wall clock.
    pub fn medians(&self) -> (f64, f64) {
        (median(&self.device_ms), median(&self.wall_ms))
    }
}

/// The choices that are timed: each rotation with the colour read along the turned view, then what differs with the closed form.
pub fn choices() -> Vec<Frame> {
    let along = Some(Colour::AlongView);
    let mut frames: Vec<Frame> =
        Rotation::ALL.map(|rotation| Frame { rotation, shape: Shape::Covariance, colour: along }).into();
    let closed = frames[1];
    frames.push(Frame { shape: Shape::Quaternion, ..closed });
    frames.push(Frame { colour: Some(Colour::TurnSh), ..closed });
    frames.push(Frame { shape: Shape::Quaternion, colour: None, ..closed });
    frames
}

/// Times every choice. Choices take turns, so that a device that changes its clock does so to all of them.
///
/// # Errors
/// The device was lost.
pub fn time(gpu: &Gpu, options: Options) -> Result<Vec<Timing>, GpuError> {
    let skinning = Skinning::new(gpu)?;
    let batches = (0..options.avatars).map(|pose| cases::avatar(options.gaussians, pose as u64));
    let avatars: Vec<Avatar> = batches.map(|batch| skinning.upload(&batch)).collect();
    let avatars: Vec<&Avatar> = avatars.iter().collect();
    let mut timings: Vec<Timing> = choices()
        .into_iter()
        .map(|frame| Timing { frame, device_ms: Vec::new(), wall_ms: Vec::new() })
        .collect();
    for timing in &timings {
        // A clock that idled rises within tenths of a second.
        let frames = affordable(skinning.wall_time(&avatars, timing.frame, 1)?, options.frames);
        skinning.wall_time(&avatars, timing.frame, frames)?;
    }
    for _ in 0..options.repeats {
        for timing in &mut timings {
            let frames = affordable(skinning.wall_time(&avatars, timing.frame, 1)?, options.frames);
            timing.wall_ms.push(skinning.wall_time(&avatars, timing.frame, frames)?);
            timing.device_ms.push(median(&skinning.times(&avatars, timing.frame, frames)?));
        }
    }
    Ok(timings)
}

/// Frames that fit into a second, two at least.
fn affordable(ms: f64, frames: u32) -> u32 {
    ((1000.0 / ms) as u32).clamp(2, frames.max(2))
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
