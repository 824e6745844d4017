//! How good an avatar is on frames that its fit did not see.

use super::Error;
use super::drawable::{Drawable, Look, Scratch};
use super::frame::{Frame, behind};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::RestBody;
use skinsplat_data::Sequence;
use skinsplat_fit::train::Fitted;
use skinsplat_metrics::{MetricId, Protocol, Wanted};
use skinsplat_posing::Strategy;
use std::borrow::Cow;
use std::sync::Arc;

/// The score on frames that the fit did not see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Iterations done; 0 is the start.
    pub iteration: u32,
    /// The sequence.
    pub sequence: String,
    /// Mean PSNR over its frames, dB; +inf, which JSON holds as `null`, if one of them is hit exactly.
    #[serde(with = "infinity_as_none")]
    pub psnr: f64,
    /// Mean SSIM over its frames; none if nobody asked.
    pub ssim: Option<f64>,
    /// Number of frames.
    pub frames: usize,
}

/// Poses, renders and scores an avatar on every frame of some sequences, by the default protocol. Binding it costs more than
/// drawing a few frames: sequences that share a body share the bound avatar.
///
/// # Errors
/// A frame that cannot be read or scored, an avatar that does not fit the sequences' body.
pub fn held_out<'a>(
    fitted: impl Into<Fitted<'a>>,
    strategy: &Strategy,
    sequences: &[Sequence],
    iteration: u32,
    ssim: bool,
) -> Result<Vec<HeldOut>, Error> {
    let Fitted { avatar, mesh } = fitted.into();
    let protocol = Protocol::parse("default")?;
    let mut bound: Option<(&Arc<RestBody>, Drawable<'_>)> = None;
    let mut scores = Vec::with_capacity(sequences.len());
    for sequence in sequences {
        let (_, drawable) = match bound.take_if(|(body, _)| Arc::ptr_eq(body, &sequence.body)) {
            Some(same) => bound.insert(same),
            None => {
                let fresh = Drawable::new(avatar, mesh.map(Cow::Borrowed), &sequence.body)?;
                bound.insert((&sequence.body, fresh))
            }
        };
        let (psnr, ssim) = of_sequence(drawable, strategy, &protocol, sequence, ssim)?;
        let (id, frames) = (sequence.id.clone(), sequence.frames.len());
        scores.push(HeldOut { iteration, sequence: id, psnr, ssim, frames });
    }
    Ok(scores)
}

/// Mean PSNR and SSIM over the frames of a sequence.
fn of_sequence(
    drawable: &Drawable<'_>,
    strategy: &Strategy,
    protocol: &Protocol,
    sequence: &Sequence,
    ssim: bool,
) -> Result<(f64, Option<f64>), Error> {
    let read = drawable.joints_read(strategy);
    let wanted = Wanted::of(if ssim { &[MetricId::PSNR, MetricId::SSIM] } else { &[MetricId::PSNR] });
    let score = |scratch: &mut Scratch, index: usize| {
        let frame = Frame::load(sequence, index, read.as_deref())?;
        let background = behind(protocol, &frame.truth)?;
        let look = Look { strategy: Some(*strategy), background, antialiased: false };
        Ok(frame.evaluate(drawable, &look, protocol, wanted, scratch)?.score)
    };
    let frames = (0..sequence.frames.len()).into_par_iter();
    let scores = frames.map_init(Scratch::default, score).collect::<Result<Vec<_>, Error>>()?;
    let summary = protocol.aggregate(&scores)?;
    let psnr = summary.value(MetricId::PSNR).unwrap_or(f64::NAN); // every frame has it
    Ok((psnr, summary.value(MetricId::SSIM)))
}

/// +inf as none, in text and in binary.
mod infinity_as_none {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_score_that_is_infinite_is_read_back_from_every_document() {
        for psnr in [f64::INFINITY, 31.25] {
            let score = HeldOut { iteration: 3, sequence: "test".into(), psnr, ssim: None, frames: 1 };
            let text = serde_json::to_string(&score).unwrap();
            assert_eq!(serde_json::from_str::<HeldOut>(&text).unwrap(), score, "{text}");
            let bytes = postcard::to_stdvec(&score).unwrap();
            assert_eq!(postcard::from_bytes::<HeldOut>(&bytes).unwrap(), score);
        }
    }
}
