//! Frames to one number per metric.

use super::{FrameScore, Measure, MetricId, MetricsError, OverFrames, Protocol, ProtocolId, Values};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// How the value of a sequence comes from its frames, for metrics that have a pooled form (PSNR); the others are always
/// means of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aggregation {
    /// The mean of the frames' PSNRs.
    #[default]
    MeanOfFrames,
    /// The PSNR of the mean squared error over the pixels of all frames, as HAHA computes it.
    PooledMse,
}

/// The metrics of a sequence under a protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// The protocol.
    pub protocol: ProtocolId,
    /// Number of frames.
    pub frames: u64,
    /// Frames with an infinite value (a PSNR); one is enough to make the mean infinite, as in numpy.
    pub identical_frames: u64,
    /// Pixels of all frames.
    pub pixels: u64,
    /// Mean squared error over all pixels.
    pub mse: f64,
    /// The metrics that every frame has, as the protocol aggregates them.
    pub values: Values,
    /// Of metrics that have a pooled form: the mean of the frames.
    pub mean_of_frames: Values,
    /// Of metrics that have a pooled form: the pooled value.
    pub pooled: Values,
    /// Why those are missing that some frames were scored by.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub not_computed: BTreeMap<MetricId, String>,
}

impl Summary {
    /// The value of a metric, if every frame has it.
    pub fn value(&self, id: MetricId) -> Option<f64> {
        self.values.get(id)
    }
}

impl Protocol {
    /// The metrics of a sequence. Sums run in f64 in the order of `frames`: keep it the order of the sequence, and the
    /// result is the same bit for bit.
    ///
    /// # Errors
    /// No frames, or a frame that was scored under another protocol or version.
    pub fn aggregate(&self, frames: &[FrameScore]) -> Result<Summary, MetricsError> {
        self.check_frames(frames)?;
        let channel_mse = pooled_mse(frames);
        let infinite = |frame: &&FrameScore| frame.values.iter().any(|(_, value)| value.is_infinite());
        let mut summary = Summary {
            protocol: self.key(),
            frames: frames.len() as u64,
            identical_frames: frames.iter().filter(infinite).count() as u64,
            pixels: frames.iter().map(|frame| frame.pixels).sum(),
            mse: super::psnr::mean(channel_mse),
            values: Values::default(),
            mean_of_frames: Values::default(),
            pooled: Values::default(),
            not_computed: BTreeMap::new(),
        };
        for id in scored_by(frames) {
            match id.metric().measure {
                Measure::Avatar(_) => {
                    let values = frames.iter().filter_map(|frame| frame.value(id));
                    summary.values.insert(id, values.fold(f64::NEG_INFINITY, f64::max));
                }
                Measure::Frame { over_frames, .. } => match mean_of_frames(frames, id, over_frames) {
                    Ok(mean) => summary.insert(id, mean, over_frames, self, channel_mse),
                    Err(reason) => drop(summary.not_computed.insert(id, reason)),
                },
            }
        }
        Ok(summary)
    }

    /// There are frames, and all of them were scored under this protocol.
    fn check_frames(&self, frames: &[FrameScore]) -> Result<(), MetricsError> {
        let error = |index, problem: &str, expected: String| {
            Err(MetricsError::Frames { index, problem: problem.to_owned(), expected })
        };
        if frames.is_empty() {
            return error(0, "there are no frames", "at least one".to_owned());
        }
        let key = self.key();
        match frames.iter().position(|frame| frame.protocol != key) {
            None => Ok(()),
            Some(index) => {
                let ProtocolId { id, version } = &frames[index].protocol;
                let problem = format!("scored under protocol \"{id}\" version {version}");
                error(index, &problem, format!("\"{}\" version {}", self.id, self.version))
            }
        }
    }
}

impl Summary {
    /// Adds a metric of frames, given the mean of its values and the mean squared errors of all pixels.
    fn insert(
        &mut self,
        id: MetricId,
        mean: f64,
        over_frames: OverFrames,
        protocol: &Protocol,
        channel_mse: [f64; 3],
    ) {
        let OverFrames::Pooled(pool) = over_frames else { return self.values.insert(id, mean) };
        let pooled = pool(protocol, channel_mse);
        self.mean_of_frames.insert(id, mean);
        self.pooled.insert(id, pooled);
        let value = match protocol.aggregate {
            Aggregation::MeanOfFrames => mean,
            Aggregation::PooledMse => pooled,
        };
        self.values.insert(id, value);
    }
}

/// The mean squared errors of R, G and B over the pixels of all frames.
fn pooled_mse(frames: &[FrameScore]) -> [f64; 3] {
    let pixels: u64 = frames.iter().map(|frame| frame.pixels).sum();
    std::array::from_fn(|c| {
        let squares = frames.iter().map(|frame| frame.channel_mse[c] * frame.pixels as f64);
        squares.sum::<f64>() / pixels as f64
    })
}

/// Metrics that any of the frames has or could not have.
fn scored_by(frames: &[FrameScore]) -> BTreeSet<MetricId> {
    let values = frames.iter().flat_map(|frame| frame.values.iter().map(|(id, _)| id));
    values.chain(frames.iter().flat_map(|frame| frame.not_computed.keys().copied())).collect()
}

/// The mean of a metric, or why there is none.
fn mean_of_frames(frames: &[FrameScore], id: MetricId, over_frames: OverFrames) -> Result<f64, String> {
    let values: Vec<f64> = frames.iter().filter_map(|frame| frame.value(id)).collect();
    let enough = match over_frames {
        OverFrames::MeanWhereThere => !values.is_empty(),
        OverFrames::Mean | OverFrames::Pooled(_) => values.len() == frames.len(),
    };
    enough.then(|| values.iter().sum::<f64>() / values.len() as f64).ok_or_else(|| {
        let reason = frames.iter().find_map(|frame| frame.not_computed.get(&id));
        reason.cloned().unwrap_or_else(|| "not asked for in every frame".to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PsnrVariant;

    fn frame(protocol: &Protocol, pixels: u64, mse: f64, lpips: Option<f64>) -> FrameScore {
        let channel_mse = [mse; 3];
        let psnr = PsnrVariant::Image.psnr(channel_mse);
        let values = [(MetricId::PSNR, psnr), (MetricId::SSIM, 1.0 - mse), (MetricId::SPLATS, 9.0)];
        let values = values.into_iter().chain(lpips.map(|lpips| (MetricId::LPIPS, lpips))).collect();
        let (protocol, not_computed) = (protocol.key(), BTreeMap::new());
        FrameScore { protocol, pixels, channel_mse, mse, values, not_computed }
    }

    #[test]
    fn mean_of_frames_and_pooled() {
        for (id, pooled) in [("default", false), ("haha", true)] {
            let protocol = Protocol::preset(id).unwrap();
            let frames = [frame(protocol, 300, 0.01, Some(0.25)), frame(protocol, 100, 0.0001, Some(0.75))];
            let summary = protocol.aggregate(&frames).unwrap();
            let mse = (3.0 * 0.01 + 0.0001) / 4.0;
            assert!((summary.mse - mse).abs() < 1e-15);
            let of = |values: &Values| values.get(MetricId::PSNR).unwrap();
            assert!((of(&summary.mean_of_frames) - 30.0).abs() < 1e-12);
            assert!((of(&summary.pooled) - -10.0 * mse.log10()).abs() < 1e-12);
            let chosen = if pooled { &summary.pooled } else { &summary.mean_of_frames };
            assert_eq!(of(&summary.values), of(chosen));
            assert_eq!(chosen.iter().count(), 1, "only PSNR has two");
            assert!((summary.value(MetricId::SSIM).unwrap() - 0.99495).abs() < 1e-12);
            assert_eq!((summary.frames, summary.pixels), (2, 400));
            let [lpips, splats] = [MetricId::LPIPS, MetricId::SPLATS].map(|id| summary.value(id));
            assert_eq!((lpips, splats), (Some(0.5), Some(9.0)));
        }
    }

    #[test]
    fn a_missing_lpips_is_not_averaged_and_identical_frames_show() {
        let protocol = Protocol::default();
        let mut frames = [frame(&protocol, 10, 0.0, Some(0.0)), frame(&protocol, 10, 0.1, None)];
        let unasked = protocol.aggregate(&frames).unwrap();
        assert_eq!(unasked.not_computed[&MetricId::LPIPS], "not asked for in every frame");
        frames[1].not_computed.insert(MetricId::LPIPS, "too small".to_owned());
        let summary = protocol.aggregate(&frames).unwrap();
        assert_eq!((summary.value(MetricId::LPIPS), summary.identical_frames), (None, 1));
        assert_eq!(summary.not_computed[&MetricId::LPIPS], "too small");
        assert_eq!(summary.value(MetricId::PSNR), Some(f64::INFINITY));
        let pooled = summary.pooled.get(MetricId::PSNR).unwrap();
        assert!((pooled - -10.0 * 0.05f64.log10()).abs() < 1e-12);
        let text = serde_json::to_string(&summary).unwrap();
        assert_eq!(serde_json::from_str::<Summary>(&text).unwrap(), summary);
    }

    #[test]
    fn frames_of_another_protocol_are_refused() {
        let (protocol, other) = (Protocol::default(), Protocol::preset("haha").unwrap());
        let frames = [frame(&protocol, 10, 0.1, None), frame(other, 10, 0.1, None)];
        let error = protocol.aggregate(&frames).unwrap_err().to_string();
        let expected = "frame 1: scored under protocol \"haha\" version 1; expected \"avatar-v1\" version 1";
        assert_eq!(error, expected);
        assert!(protocol.aggregate(&[]).is_err());
    }
}
