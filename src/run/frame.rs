//! One frame: its truth, its camera, the body in its pose, and what a variant draws of it.

use super::Error;
use super::avatars::Prepared;
use crate::experiment::{Job, JobVariant, Seconds};
use skinsplat_core::scene::{Camera, Image, Pose, Posed, PosedBody};
use skinsplat_data::{Sequence, Truth};
use skinsplat_fit::texture::{SAMPLES, TexturedBody};
use skinsplat_metrics::Protocol;
use skinsplat_posing::{PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::mesh::SamplePattern;
use skinsplat_render::splat::Renderer;
use std::time::Instant;

/// A frame, loaded.
pub(super) struct Frame<'a> {
    pub(super) truth: Truth,
    camera: &'a Camera,
    pose: &'a Pose,
    body: PosedBody<'a>,
}

impl<'a> Frame<'a> {
    pub(super) fn load(sequence: &'a Sequence, index: usize) -> Result<Self, Error> {
        let truth = sequence.truth(index)?;
        let frame = &sequence.frames[index];
        let (pose, camera) = (&sequence.poses[frame.pose], &sequence.cameras[frame.camera]);
        Ok(Self { truth, camera, pose, body: PosedBody::new(&sequence.body, pose)? })
    }

    /// Draws the frame as a variant poses it, over the background of the job's protocol.
    pub(super) fn draw(
        &self,
        job: &Job,
        variant: &JobVariant,
        avatar: &Prepared,
        renderer: &mut Renderer,
        seconds: &mut Seconds,
    ) -> Result<Drawn, Error> {
        let background = background(job)?;
        let (bound, mesh) = match avatar {
            Prepared::Textured(textured) => {
                let start = Instant::now();
                let pattern = SamplePattern::new(SAMPLES);
                let image = textured.draw(self.pose, self.camera, pattern, background)?.image;
                seconds.render = start.elapsed().as_secs_f64();
                return Ok(Drawn { image, splats: None, visible_splats: None });
            }
            Prepared::Gaussians(bound) => (bound, None),
            Prepared::Hybrid(bound, mesh) => (bound, Some(mesh)),
        };
        let strategy: Strategy = variant.strategy.as_deref().unwrap_or_default().parse()?;
        let start = Instant::now();
        let mut poser = Poser::new();
        let options = PoseOptions { seen_by: Some(self.camera), ..PoseOptions::default() };
        let posed = poser.pose(bound, &self.body, &strategy, &options)?;
        seconds.pose = start.elapsed().as_secs_f64();
        let view = View::new(self.camera).over(background).antialiased(job.antialiased);
        let start = Instant::now();
        let image = match mesh {
            None => renderer.render(&posed, &view)?.image.clone(),
            Some(mesh) => together(renderer, &posed, (mesh, self.pose), view)?,
        };
        seconds.render = start.elapsed().as_secs_f64();
        let (splats, visible) = (posed.len() as u64, renderer.visible() as u64);
        Ok(Drawn { image, splats: Some(splats), visible_splats: Some(visible) })
    }
}

/// Gaussians and a textured mesh in a pose, drawn together.
pub(super) fn together(
    renderer: &mut Renderer,
    posed: &Posed<'_>,
    (mesh, pose): (&TexturedBody, &Pose),
    view: View<'_>,
) -> Result<Image, Error> {
    let drawing = mesh.drawing(pose, view.camera, SamplePattern::new(SAMPLES))?;
    Ok(renderer.render(posed, &view.with_underlay(Some(drawing.underlay())))?.image.clone())
}

/// What a variant looks like.
pub(super) struct Drawn {
    pub(super) image: Image,
    /// Gaussians of the avatar; none for a textured mesh.
    pub(super) splats: Option<u64>,
    /// Those that reach the image.
    pub(super) visible_splats: Option<u64>,
}

/// The background of a job's protocol.
pub(super) fn background(job: &Job) -> Result<[f32; 3], Error> {
    let none = || Error::NoBackground { protocol: job.protocol.clone() };
    Protocol::parse(&job.protocol)?.background_colour().ok_or_else(none)
}
