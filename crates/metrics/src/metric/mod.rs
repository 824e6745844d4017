//! The metrics by name.
//!
//! A new metric is a file in this folder, with its function and a [`Metric`], and its line in [`METRICS`]. Columns of tables,
//! tolerances of comparisons, aggregates of sequences, printed numbers of papers and lists follow from there by name.

mod bend;
mod id;
mod lpips;
mod mae;
mod measure;
mod motion;
mod psnr;
mod splats;
mod ssim;
mod values;

pub use id::MetricId;
pub use measure::{AvatarStats, FrameInput, Measure, Measured, Metric, OverFrames};
pub use motion::ROTATION_JUMP_DEGREES;
pub use values::Values;

/// Every metric, in the order in which documents and lists name them.
pub const METRICS: &[Metric] = &[
    psnr::METRIC,
    ssim::METRIC,
    lpips::METRIC,
    splats::METRIC,
    mae::METRIC,
    bend::BENT,
    bend::BELOW_15,
    bend::FROM_15,
    bend::FROM_30,
    bend::FROM_60,
    bend::FROM_90,
    bend::FROM_120,
    motion::FLICKER,
    motion::ROTATION_JUMPS,
];
