//! How good an avatar is on frames that its fit did not see.

use super::Error;
use super::fitting::HeldOut;
use super::frame::together;
use rayon::prelude::*;
use skinsplat_core::scene::{PosedBody, RestBody};
use skinsplat_data::Sequence;
use skinsplat_fit::texture::TexturedBody;
use skinsplat_fit::train::Fitted;
use skinsplat_metrics::{Protocol, Wanted};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::splat::Renderer;
use std::sync::Arc;

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
    let fitted = fitted.into();
    let mut bound: Option<(&Arc<RestBody>, BoundAvatar)> = None;
    let mut scores = Vec::with_capacity(sequences.len());
    for sequence in sequences {
        let (_, bound) = match bound.take_if(|(body, _)| Arc::ptr_eq(body, &sequence.body)) {
            Some(same) => bound.insert(same),
            None => {
                let fresh = BoundAvatar::new(fitted.avatar, &sequence.body)?.without_zero_bands();
                bound.insert((&sequence.body, fresh))
            }
        };
        scores.push(of_sequence(bound, fitted.mesh, strategy, sequence, Asked { iteration, ssim })?);
    }
    Ok(scores)
}

/// What is said of a sequence.
#[derive(Clone, Copy)]
struct Asked {
    iteration: u32,
    ssim: bool,
}

fn of_sequence(
    bound: &BoundAvatar,
    mesh: Option<&TexturedBody>,
    strategy: &Strategy,
    sequence: &Sequence,
    asked: Asked,
) -> Result<HeldOut, Error> {
    let protocol = Protocol::parse("default")?;
    let background = protocol.background_colour().unwrap_or([1.0; 3]);
    let read = bound.joints_read(strategy);
    let score = |renderer: &mut Renderer, index: usize| {
        let truth = sequence.truth(index)?;
        let frame = &sequence.frames[index];
        let (pose, camera) = (&sequence.poses[frame.pose], &sequence.cameras[frame.camera]);
        let body = PosedBody::with_rotations(&sequence.body, pose, |joint| read[joint])?;
        let mut poser = Poser::new();
        let options = PoseOptions { seen_by: Some(camera), ..PoseOptions::default() };
        let posed = poser.pose(bound, &body, strategy, &options)?;
        let view = View::new(camera).over(background);
        let image = match mesh {
            None => renderer.render(&posed, &view)?.image.clone(),
            Some(mesh) => together(renderer, &posed, (mesh, pose), view)?,
        };
        let truth = skinsplat_metrics::Truth::Straight { rgb: &truth.rgb, alpha: &truth.alpha };
        Ok(protocol.score_with(&image, truth, Wanted { ssim: asked.ssim, lpips: None })?)
    };
    let frames = (0..sequence.frames.len()).into_par_iter();
    let scores = frames.map_init(Renderer::new, score).collect::<Result<Vec<_>, Error>>()?;
    let summary = protocol.aggregate(&scores)?;
    Ok(HeldOut {
        iteration: asked.iteration,
        sequence: sequence.id.clone(),
        psnr: summary.psnr,
        ssim: summary.ssim,
        frames: scores.len(),
    })
}
