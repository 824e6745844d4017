//! Structural similarity.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::MetricsError;
use crate::score::Prepared;
use crate::ssim::ssim_of_planes;

pub(super) const METRIC: Metric = Metric {
    id: "ssim",
    title: "SSIM",
    unit: "",
    summary: "structural similarity",
    higher_is_better: true,
    decimals: 4,
    tolerance: 0.00005,
    needs: "",
    measure: Measure::Frame { score, over_frames: OverFrames::Mean },
};

fn score(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    let Prepared { render, truth, weights, .. } = frame.images;
    let variant = frame.protocol.ssim;
    ssim_of_planes(render, truth, &variant.settings(), variant.id(), weights.as_deref()).map(Measured::Value)
}
