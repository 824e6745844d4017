//! What a metric is, and what it is computed from.

use crate::score::Prepared;
use crate::{ErrorSums, MetricsError, PerceptualDistance, Protocol};

/// A quantity that tables show: its name, what a table and a comparison need to know about it, and its function.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Stable name in files: lower-case letters, digits and dashes.
    pub id: &'static str,
    /// Column title.
    pub title: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// What it is, in one line, for lists.
    pub summary: &'static str,
    /// Whether more is better.
    pub higher_is_better: bool,
    /// Digits after the point.
    pub decimals: usize,
    /// How far it may move between two runs without counting: half of the last digit that tables print, or 0 for a count.
    pub tolerance: f64,
    /// What it needs besides two images of the protocol's region, for notes on values that are not there; empty if nothing.
    pub needs: &'static str,
    /// How it is computed.
    pub measure: Measure,
}

/// What a metric is a function of.
#[derive(Clone, Copy, Debug)]
pub enum Measure {
    /// Of a render and its truth.
    Frame {
        /// The function. An error is one of the input: it is the error of the whole frame.
        score: fn(&FrameInput<'_>) -> Result<Measured, MetricsError>,
        /// From frames to a sequence.
        over_frames: OverFrames,
    },
    /// Of the avatar, and so the same in every frame; `None` for an avatar that has no such quantity.
    Avatar(fn(&AvatarStats) -> Option<f64>),
}

/// How the value of a sequence comes from its frames.
#[derive(Clone, Copy, Debug)]
pub enum OverFrames {
    /// The mean of the frames; none unless every frame has a value.
    Mean,
    /// The mean of the frames that have a value: frames in which there is nothing to measure say nothing.
    MeanWhereThere,
    /// As the protocol's [`Aggregation`](crate::Aggregation) says: the mean of the frames, or this function of the mean
    /// squared errors of R, G and B over the pixels of all frames.
    Pooled(fn(&Protocol, [f64; 3]) -> f64),
}

/// A frame as its metrics see it.
#[derive(Clone, Copy)]
pub struct FrameInput<'a> {
    /// Which variants of the metrics are meant.
    pub protocol: &'a Protocol,
    /// Render, truth and weights after steps 1 to 3 of the protocol.
    pub images: &'a Prepared,
    /// Sums of their differences.
    pub errors: &'a ErrorSums,
    /// What computes LPIPS, if anything does.
    pub lpips: Option<&'a dyn PerceptualDistance>,
    /// The frame before and this one, cut to the pixels that the protocol scores in either, or why there is none.
    pub succession: Result<&'a [Prepared; 2], &'a str>,
    /// [`Wanted::rotation_jumps`](crate::Wanted::rotation_jumps).
    pub rotation_jumps: Result<u64, &'a str>,
}

/// What a metric says of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Measured {
    /// Its value.
    Value(f64),
    /// There is none, for a reason that says nothing against the images.
    NotComputed(MetricsError),
}

/// What is known of the avatar that was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AvatarStats {
    /// Its Gaussians; none for a textured mesh.
    pub gaussians: Option<u64>,
}
