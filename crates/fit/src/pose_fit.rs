//! The pose of one image, fitted with the avatar frozen: what HAHA, InstantAvatar and ExAvatar do with test poses before they score.

use crate::Error;
use crate::loss::{Losses, Weights};
use crate::options::PoseFit;
use crate::poses::{FreePose, PoseRates};
use crate::texture::{SAMPLES, TexturedBody};
use crate::train::composite;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{
    BodyGradient, Camera, Gaussians, Image, Pose, Posed, PosedBody, PosedGradient, Rendered,
    RenderedGradient, RestBody, SceneError,
};
use skinsplat_data::sequence::Truth;
use skinsplat_posing::{BoundAvatar, Gradients, PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::mesh::{Drawing, SamplePattern};
use skinsplat_render::splat::{Derivatives, Renderer};

/// What is drawn while its pose is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Posable<'a> {
    /// The body that is posed.
    pub body: &'a RestBody,
    /// The Gaussians that hang on it, and how they are posed.
    pub gaussians: Option<(&'a BoundAvatar, &'a Strategy)>,
    /// The mesh that is drawn, with or without them.
    pub mesh: Option<&'a TexturedBody>,
}

/// The image that a pose is fitted to.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The image and its mask.
    pub truth: &'a Truth,
    /// Through which it was seen.
    pub camera: &'a Camera,
    /// What both are compared over.
    pub background: [f32; 3],
    /// Whether the antialiased rasterizer renders.
    pub antialiased: bool,
}

/// A pose that was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedPose {
    /// The pose.
    pub pose: Pose,
    /// The loss at the given pose and at this one.
    pub losses: [f64; 2],
    /// By how much the joint that turned most has turned, degrees.
    pub turned_degrees: f64,
}

/// Fits a pose to an image, starting at the one given, which is returned if no step made it better.
///
/// # Errors
/// An image without the body; a pose that diverges, with its joint; what does not fit together.
pub fn fit_pose(
    posable: &Posable<'_>,
    target: &Target<'_>,
    given: &Pose,
    options: &PoseFit,
) -> Result<FittedPose, Error> {
    options.check("test_pose")?;
    if target.truth.alpha.values().iter().all(|&a| a <= 0.0) {
        let expected = "an image that shows the body";
        return Err(Error::invalid("fitted pose", "the mask of the image is empty", expected));
    }
    let mut scratch = Scratch::new(target);
    let mut free = FreePose::new(given.locals.len(), options.moments);
    let mut best: Option<(f64, Pose, f64)> = None;
    let mut first = f64::NAN;
    for step in 0..=options.steps {
        let pose = free.applied(given);
        let (loss, gradient) = scratch.loss(posable, target, &pose, options).map_err(in_pose)?;
        first = if step == 0 { loss } else { first };
        if best.as_ref().is_none_or(|(least, ..)| loss < *least) {
            best = Some((loss, pose, free.turned_degrees()));
        }
        let done = f64::from(step) / f64::from(options.steps.max(1));
        let factor = portable::pow(f64::from(options.decay), done) as f32;
        let rates = PoseRates {
            rotation: options.rate * factor,
            translation: options.translation_rate * factor,
            most_degrees: options.most_degrees,
        };
        free.step(&posable.body.skeleton, &gradient, rates)
            .map_err(|stopped| Error::invalid("fitted pose", stopped.problem, "a fit that converges"))?;
    }
    let (least, pose, turned_degrees) =
        best.ok_or_else(|| Error::invalid("fitted pose", "no loss is finite", "a fit that converges"))?;
    Ok(FittedPose { pose, losses: [first, least], turned_degrees })
}

fn in_pose(problem: SceneError) -> Error {
    Error::invalid("fitted pose", problem.problem, problem.expected)
}

/// Memory that is kept from step to step.
struct Scratch {
    poser: Poser,
    renderer: Renderer,
    losses: Losses,
    /// The truth over the background.
    over: Image,
    of_rendered: RenderedGradient,
    of_posed: PosedGradient,
    of_body: BodyGradient,
}

impl Scratch {
    fn new(target: &Target<'_>) -> Self {
        let mut over = Image::filled(1, 1, [0.0; 3]);
        composite(&target.truth.rgb, &target.truth.alpha, target.background, &mut over);
        Self {
            poser: Poser::new(),
            renderer: Renderer::new(),
            losses: Losses::default(),
            over,
            of_rendered: RenderedGradient { image: Image::filled(1, 1, [0.0; 3]), alpha: None },
            of_posed: PosedGradient::default(),
            of_body: BodyGradient::default(),
        }
    }

    /// The loss at a pose, and its gradient.
    fn loss(
        &mut self,
        posable: &Posable<'_>,
        target: &Target<'_>,
        pose: &Pose,
        options: &PoseFit,
    ) -> Result<(f64, skinsplat_core::scene::PoseGradient), SceneError> {
        let Self { poser, renderer, losses, over, of_rendered, of_posed, of_body } = self;
        let Posable { body, gaussians, mesh } = *posable;
        let body = PosedBody::new(body, pose)?;
        let posing = PoseOptions::default();
        let in_posing = |error: skinsplat_posing::PosingError| {
            SceneError::new("pose", error.to_string(), "an avatar that can be posed")
        };
        let posed = match gaussians {
            Some((bound, strategy)) => poser.pose(bound, &body, strategy, &posing).map_err(in_posing)?,
            None => Posed::NOTHING,
        };
        let drawing =
            mesh.map(|mesh| mesh.drawing(pose, target.camera, SamplePattern::new(SAMPLES))).transpose()?;
        let underlay = drawing.as_ref().map(Drawing::underlay);
        let view = View::new(target.camera).over(target.background).antialiased(target.antialiased);
        let view = view.with_underlay(underlay);
        let Rendered { image, alpha, .. } = renderer.render(&posed, &view)?;
        let weights = Weights { ssim: options.ssim, silhouette: options.silhouette };
        let loss = losses.frame((image, alpha), (over, &target.truth.alpha), &weights, of_rendered);
        renderer.backward(&posed, &view, of_rendered, of_posed, Derivatives::Exact)?;
        of_body.reset(body.joints.len());
        if let Some((bound, strategy)) = gaussians {
            let into = Gradients { body: Some(&mut *of_body), ..Gradients::default() };
            poser
                .backward(bound, &body, strategy, &posing, &Gaussians::default(), of_posed, into)
                .map_err(in_posing)?;
        }
        let mut gradient = body.pose_gradient(pose, of_body)?;
        if let (Some(mesh), Some(drawing), Some(shown)) = (mesh, &drawing, renderer.underlay_weight()) {
            let seen = (pose, target.camera);
            gradient += mesh.pose_gradient(seen, drawing, target.background, of_rendered, shown)?;
        }
        Ok((loss.total, gradient))
    }
}
