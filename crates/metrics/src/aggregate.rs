//! Frames to one number per metric.

use super::score::infinite_as_null;
use super::{FrameScore, MetricsError, Protocol, ProtocolId};
use serde::{Deserialize, Serialize};

/// How the PSNR of a sequence comes from its frames. SSIM and LPIPS are always means of frames.
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
    /// Frames whose PSNR is infinite; one is enough to make the mean infinite, as in numpy.
    pub identical_frames: u64,
    /// Pixels of all frames.
    pub pixels: u64,
    /// Mean squared error over all pixels.
    pub mse: f64,
    /// The protocol's PSNR, dB: one of the next two; `null` in JSON is +inf.
    #[serde(with = "infinite_as_null")]
    pub psnr: f64,
    /// Mean of the frames' PSNRs.
    #[serde(with = "infinite_as_null")]
    pub psnr_mean_of_frames: f64,
    /// PSNR of the pooled mean squared errors.
    #[serde(with = "infinite_as_null")]
    pub psnr_pooled: f64,
    /// Mean of frames; `None` (`null`) unless every frame has it.
    pub ssim: Option<f64>,
    /// Mean of frames; `None` (`null`) unless every frame has it.
    pub lpips: Option<f64>,
}

impl Protocol {
    /// The metrics of a sequence. Sums run in f64 in the order of `frames`: keep it the order of the sequence, and the
    /// result is the same bit for bit.
    ///
    /// # Errors
    /// No frames, or a frame that was scored under another protocol or version.
    pub fn aggregate(&self, frames: &[FrameScore]) -> Result<Summary, MetricsError> {
        let error = |index, problem: &str, expected: String| {
            Err(MetricsError::Frames { index, problem: problem.to_owned(), expected })
        };
        if frames.is_empty() {
            return error(0, "there are no frames", "at least one".to_owned());
        }
        let key = self.key();
        if let Some(index) = frames.iter().position(|frame| frame.protocol != key) {
            let ProtocolId { id, version } = &frames[index].protocol;
            let problem = format!("scored under protocol \"{id}\" version {version}");
            return error(index, &problem, format!("\"{}\" version {}", self.id, self.version));
        }
        let count = frames.len() as f64;
        let mean = |value: fn(&FrameScore) -> f64| frames.iter().map(value).sum::<f64>() / count;
        let pixels: u64 = frames.iter().map(|frame| frame.pixels).sum();
        let pooled = |c: usize| {
            let squares = frames.iter().map(|frame| frame.channel_mse[c] * frame.pixels as f64);
            squares.sum::<f64>() / pixels as f64
        };
        let channel_mse = [pooled(0), pooled(1), pooled(2)];
        let psnr_mean_of_frames = mean(|frame| frame.psnr);
        let psnr_pooled = self.psnr.psnr(channel_mse);
        let known = |value: fn(&FrameScore) -> Option<f64>| -> Option<f64> {
            let sum: Option<f64> = frames.iter().map(value).sum();
            sum.map(|sum| sum / count)
        };
        Ok(Summary {
            protocol: key,
            frames: frames.len() as u64,
            identical_frames: frames.iter().filter(|frame| frame.psnr.is_infinite()).count() as u64,
            pixels,
            mse: super::psnr::mean(channel_mse),
            psnr: match self.aggregate {
                Aggregation::MeanOfFrames => psnr_mean_of_frames,
                Aggregation::PooledMse => psnr_pooled,
            },
            psnr_mean_of_frames,
            psnr_pooled,
            ssim: known(|frame| frame.ssim),
            lpips: known(|frame| frame.lpips),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PsnrVariant;

    fn frame(protocol: &Protocol, pixels: u64, mse: f64, lpips: Option<f64>) -> FrameScore {
        let channel_mse = [mse; 3];
        let psnr = PsnrVariant::Image.psnr(channel_mse);
        FrameScore {
            protocol: protocol.key(),
            pixels,
            channel_mse,
            mse,
            psnr,
            ssim: Some(1.0 - mse),
            lpips,
            lpips_missing: None,
        }
    }

    #[test]
    fn mean_of_frames_and_pooled() {
        for (id, pooled) in [("default", false), ("haha", true)] {
            let protocol = Protocol::preset(id).unwrap();
            let frames = [frame(protocol, 300, 0.01, Some(0.25)), frame(protocol, 100, 0.0001, Some(0.75))];
            let summary = protocol.aggregate(&frames).unwrap();
            let mse = (3.0 * 0.01 + 0.0001) / 4.0;
            assert!((summary.mse - mse).abs() < 1e-15);
            assert!((summary.psnr_mean_of_frames - 30.0).abs() < 1e-12);
            assert!((summary.psnr_pooled - -10.0 * mse.log10()).abs() < 1e-12);
            let chosen = if pooled { summary.psnr_pooled } else { summary.psnr_mean_of_frames };
            assert_eq!(summary.psnr, chosen);
            assert!((summary.ssim.unwrap() - 0.99495).abs() < 1e-12);
            assert_eq!((summary.frames, summary.pixels, summary.lpips), (2, 400, Some(0.5)));
        }
    }

    #[test]
    fn a_missing_lpips_is_not_averaged_and_identical_frames_show() {
        let protocol = Protocol::default();
        let frames = [frame(&protocol, 10, 0.0, Some(0.0)), frame(&protocol, 10, 0.1, None)];
        let summary = protocol.aggregate(&frames).unwrap();
        assert_eq!((summary.lpips, summary.identical_frames), (None, 1));
        assert_eq!(summary.psnr, f64::INFINITY);
        assert!((summary.psnr_pooled - -10.0 * 0.05f64.log10()).abs() < 1e-12);
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
