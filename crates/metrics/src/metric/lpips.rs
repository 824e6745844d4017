//! Learned perceptual distance.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::MetricsError;
use crate::score::Prepared;

pub(super) const METRIC: Metric = Metric {
    id: "lpips",
    title: "LPIPS",
    unit: "",
    summary: "learned perceptual distance",
    higher_is_better: false,
    decimals: 4,
    tolerance: 0.00005,
    needs: "it needs the network's weights and images of its minimum size",
    measure: Measure::Frame { score, over_frames: OverFrames::Mean },
};

fn score(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    let Prepared { render, truth, weights, .. } = frame.images;
    let variant = frame.protocol.lpips;
    let distance = match (weights, frame.lpips) {
        (Some(_), _) => Err(MetricsError::NoImage { region: frame.protocol.region.id() }),
        (None, None) => Err(MetricsError::NoWeights { net: variant.net.id() }),
        (None, Some(scorer)) => scorer.distance(render, truth, variant),
    };
    match distance {
        Ok(distance) => Ok(Measured::Value(distance)),
        Err(error) if leaves_it_open(&error) => Ok(Measured::NotComputed(error)),
        Err(error) => Err(error),
    }
}

/// Whether it only says that there can be no LPIPS, of images that are sound.
fn leaves_it_open(error: &MetricsError) -> bool {
    matches!(
        error,
        MetricsError::NoWeights { .. } | MetricsError::NoImage { .. } | MetricsError::TooSmall { .. }
    )
}
