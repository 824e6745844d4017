//! Mean absolute error.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::MetricsError;

pub(super) const METRIC: Metric = Metric {
    id: "mae",
    title: "MAE",
    unit: "",
    summary: "mean absolute error over the region, of colours in [0, 1]",
    higher_is_better: false,
    decimals: 4,
    tolerance: 0.00005,
    needs: "",
    measure: Measure::Frame { score, over_frames: OverFrames::Mean },
};

fn score(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    Ok(Measured::Value(frame.errors.mae()))
}
