//! Peak signal-to-noise ratio.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::MetricsError;

pub(super) const METRIC: Metric = Metric {
    id: "psnr",
    title: "PSNR",
    unit: "dB",
    summary: "peak signal-to-noise ratio",
    higher_is_better: true,
    decimals: 2,
    tolerance: 0.005,
    needs: "",
    measure: Measure::Frame {
        score,
        over_frames: OverFrames::Pooled(|protocol, channel_mse| protocol.psnr.psnr(channel_mse)),
    },
};

fn score(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    Ok(Measured::Value(frame.protocol.psnr.psnr(frame.errors.channel_mse())))
}
