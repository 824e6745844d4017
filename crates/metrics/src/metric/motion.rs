//! What moves from one frame to the next that should not: pixels that flicker, rotations that jump.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::{MetricsError, Prepared};

/// By how many degrees a Gaussian may turn, from a frame to the next, beyond the widest turn of any joint that it hangs on: more
/// is a jump of its rotation. An average that follows its joints turns no further than they do, unless they are nearly half a turn apart.
pub const ROTATION_JUMP_DEGREES: f64 = 5.0;

/// What these metrics need.
pub(super) const NEEDS: &str = "the frame before";

/// Levels of an 8-bit image.
const LEVELS: f64 = 255.0;

pub(super) const FLICKER: Metric = Metric {
    id: "flicker",
    title: "Flicker",
    unit: "1/255",
    summary: "mean absolute difference, in levels of 8 bits, between what changes in the render and what changes in the truth \
              since the frame before",
    higher_is_better: false,
    decimals: 3,
    tolerance: 0.0005,
    needs: NEEDS,
    measure: Measure::Frame { score: flicker, over_frames: OverFrames::MeanWhereThere },
};

pub(super) const ROTATION_JUMPS: Metric = Metric {
    id: "rotation-jumps",
    title: "Rotation jumps",
    unit: "",
    summary: "Gaussians that turn, since the frame before, by over 5 degrees more than any of their joints",
    higher_is_better: false,
    decimals: 1,
    tolerance: 0.05,
    needs: NEEDS,
    measure: Measure::Frame { score: rotation_jumps, over_frames: OverFrames::MeanWhereThere },
};

fn flicker(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    Ok(match frame.succession {
        Ok(succession) => Measured::Value(LEVELS * change_of_error(succession)),
        Err(why) => Measured::NotComputed(MetricsError::NoFrameBefore { why: why.to_owned() }),
    })
}

fn rotation_jumps(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    Ok(match frame.rotation_jumps {
        Ok(jumps) => Measured::Value(jumps as f64),
        Err(why) => Measured::NotComputed(MetricsError::NoRotations { why: why.to_owned() }),
    })
}

/// The mean over pixels and channels of |(R1 - R0) - (T1 - T0)| for renders R and truths T, frame 0 before frame 1. Summed in the
/// order of the pixels.
fn change_of_error([before, now]: &[Prepared; 2]) -> f64 {
    let pixels = now.render.pixels();
    let weight = |pixel: usize| now.weights.as_ref().map_or(1.0, |weights| weights[pixel]);
    let [r1, t1, r0, t0] = [&now.render, &now.truth, &before.render, &before.truth].map(|of| of.channels());
    let of_channel = |c: usize| -> f64 {
        let change = |i: usize| ((r1[c][i] - r0[c][i]) - (t1[c][i] - t0[c][i])).abs();
        (0..pixels).map(|i| weight(i) * change(i)).sum()
    };
    let counted: f64 = (0..pixels).map(weight).sum();
    (0..3).map(of_channel).sum::<f64>() / (3.0 * counted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_names_the_threshold() {
        assert!(ROTATION_JUMPS.summary.contains(&format!("over {ROTATION_JUMP_DEGREES} degrees")));
    }
}
