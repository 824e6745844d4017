//! PSNR over the pixels that bent parts of the body paint: by the widest angle between the joints that move the surface
//! there.

use super::{FrameInput, Measure, Measured, Metric, OverFrames};
use crate::{ErrorSums, MetricsError};

/// Fewest pixels of a frame of which a PSNR is taken.
const LEAST_PIXELS: usize = 64;

/// What these metrics need.
pub(super) const NEEDS: &str = "the posed body";

/// Beyond every angle between rotations, degrees.
const END: u32 = 181;

/// From which angle on and below which other, degrees, by id: the classes that share out the body.
pub(super) const CLASSES: [(&str, [u32; 2]); 6] = [
    (BELOW_15.id, [0, 15]),
    (FROM_15.id, [15, 30]),
    (FROM_30.id, [30, 60]),
    (FROM_60.id, [60, 90]),
    (FROM_90.id, [90, 120]),
    (FROM_120.id, [120, 180]),
];

pub(super) const BELOW_15: Metric = metric(
    "psnr-bend-0",
    "PSNR, below 15°",
    "PSNR where joints are less than 15 degrees apart",
    score::<0, 15>,
);
pub(super) const FROM_15: Metric =
    metric("psnr-bend-15", "PSNR, 15-30°", "PSNR where joints are 15 to 30 degrees apart", score::<15, 30>);
pub(super) const FROM_30: Metric =
    metric("psnr-bend-30", "PSNR, 30-60°", "PSNR where joints are 30 to 60 degrees apart", score::<30, 60>);
pub(super) const FROM_60: Metric =
    metric("psnr-bend-60", "PSNR, 60-90°", "PSNR where joints are 60 to 90 degrees apart", score::<60, 90>);
pub(super) const FROM_90: Metric = metric(
    "psnr-bend-90",
    "PSNR, 90-120°",
    "PSNR where joints are 90 to 120 degrees apart",
    score::<90, 120>,
);
pub(super) const FROM_120: Metric = metric(
    "psnr-bend-120",
    "PSNR, 120° and more",
    "PSNR where joints are 120 degrees apart or more",
    score::<120, END>,
);
pub(super) const BENT: Metric =
    metric("psnr-bent", "PSNR, bent", "PSNR where joints are 60 degrees apart or more", score::<60, END>);

type Score = fn(&FrameInput<'_>) -> Result<Measured, MetricsError>;

const fn metric(id: &'static str, title: &'static str, summary: &'static str, score: Score) -> Metric {
    Metric {
        id,
        title,
        unit: "dB",
        summary,
        higher_is_better: true,
        decimals: 2,
        tolerance: 0.005,
        needs: NEEDS,
        measure: Measure::Frame { score, over_frames: OverFrames::MeanWhereThere },
    }
}

/// PSNR over the pixels of the protocol's region whose angle is at least `FROM` and below `TO` degrees.
fn score<const FROM: u32, const TO: u32>(frame: &FrameInput<'_>) -> Result<Measured, MetricsError> {
    let images = frame.images;
    let Some(bend) = &images.bend else { return Ok(Measured::NotComputed(MetricsError::NoBend)) };
    let of_class = |&angle: &f32| f64::from(u8::from(angle >= FROM as f32 && angle < TO as f32));
    let mut weights: Vec<f64> = bend.iter().map(of_class).collect();
    for (weight, &inside) in weights.iter_mut().zip(images.weights.iter().flatten()) {
        *weight *= inside;
    }
    let pixels = weights.iter().filter(|&&weight| weight > 0.0).count();
    if pixels < LEAST_PIXELS {
        return Ok(Measured::NotComputed(MetricsError::FewBentPixels { pixels, least: LEAST_PIXELS }));
    }
    let errors = ErrorSums::new(&images.render, &images.truth, Some(&weights))?;
    Ok(Measured::Value(frame.protocol.psnr.psnr(errors.channel_mse())))
}
