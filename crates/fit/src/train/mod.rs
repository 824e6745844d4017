//! Fitting an avatar to training frames by gradient descent: the road of an evaluation, walked forwards and backwards.
//!
//! One iteration poses the avatar as one training frame shows it, renders it, compares, walks the derivatives back to the
//! stored parameters and takes a step of Adam. What may change and what is minimised is the recipe's business.
//! Everything random is a function of the seed and the iteration, so that a fit which is resumed from a checkpoint ends
//! in the same bits as one that was never interrupted.

mod backdrop;
mod checkpoint;
mod coupling;
mod density;
mod frames;
mod layer;
mod parameters;
mod poses;
mod regularise;
mod walk;

pub(crate) use backdrop::composite;
pub use checkpoint::Checkpoint;
pub use poses::RefinedPose;

use super::Error;
use super::loss::{FrameLoss, Losses, Weights};
use super::shape::{Ended, ShapeFit, fit_shape};
use super::surface::{SurfaceInit, surface_init};
use super::texture::TexturedBody;
use crate::options::Clothing;
use crate::recipe::{FitOptions, Poses, Recipe, Stage, Surface};
use backdrop::background;
use coupling::Coupled;
use density::Density;
use frames::TrainingFrames;
use layer::Layer;
use parameters::{Parameters, RatesNow};
use poses::TrainingPoses;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{
    Avatar, AvatarGradient, Binding, BodyGradient, Image, Posed, PosedBody, PosedGradient, Rendered,
    RenderedGradient, RestBody,
};
use skinsplat_data::sequence::Sequence;
use skinsplat_posing::nearest::NearestFace;
use skinsplat_posing::{BoundAvatar, Gradients, PoseOptions, Poser, PosingError, Strategy};
use skinsplat_render::View;
use skinsplat_render::mesh::Drawing;
use skinsplat_render::splat::{Derivatives, Renderer};
use std::sync::{Arc, OnceLock};

/// A checkpoint that contradicts itself, whatever its checksum says.
fn inconsistent(problem: &str) -> Error {
    Error::Checkpoint { problem: format!("it has {problem}") }
}

/// What an iteration did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Iterations so far.
    pub iteration: u32,
    /// Of this many.
    pub iterations: u32,
    /// What was minimised, regularisers included.
    pub loss: f64,
    /// PSNR on this iteration's training frame before the step, dB.
    pub psnr: f64,
    /// Number of Gaussians.
    pub splats: usize,
}

/// An avatar as a fit leaves it.
#[derive(Clone, Copy, Debug)]
pub struct Fitted<'a> {
    /// The Gaussians.
    pub avatar: &'a Avatar,
    /// The mesh that is drawn with them, of a hybrid.
    pub mesh: Option<&'a TexturedBody>,
}

impl<'a> From<&'a Avatar> for Fitted<'a> {
    fn from(avatar: &'a Avatar) -> Self {
        Self { avatar, mesh: None }
    }
}

/// An optimisation in progress.
pub struct Trainer<'a> {
    sequence: &'a Sequence,
    options: &'a FitOptions,
    strategy: Strategy,
    parameters: Parameters,
    density: Density,
    /// Who is next to whom, where neighbours are coupled.
    coupled: Option<Coupled>,
    layer: Option<Layer>,
    /// Where they are fitted too.
    poses: Option<TrainingPoses>,
    iteration: u32,
    bound: BoundAvatar,
    /// Of the body, for Gaussians that look for the face nearest to them.
    faces: Option<NearestFace<'a>>,
    frames: TrainingFrames<'a>,
    warnings: Vec<String>,
    /// [`checkpoint::key`], when it was first asked for.
    key: OnceLock<String>,
    scratch: Scratch,
}

/// The avatar with which a fit starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Started {
    /// The Gaussians and their binding.
    pub avatar: Avatar,
    /// Frames from which its shape could not be learnt, and why.
    pub warnings: Vec<String>,
}

/// Memory that is kept from iteration to iteration.
struct Scratch {
    poser: Poser,
    renderer: Renderer,
    truth: Image,
    losses: Losses,
    of_rendered: RenderedGradient,
    of_posed: PosedGradient,
    of_avatar: AvatarGradient,
    of_body: BodyGradient,
}

/// All that the avatar with which a fit starts depends on, but the frames: what a content key of it must hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Starting {
    /// The Gaussians on the surface.
    pub init: SurfaceInit,
    /// The fit of the surface itself; none if it is taken from the outlines.
    pub shape: Option<ShapeFit>,
}

impl Starting {
    /// Of a recipe and its budget.
    pub fn of(options: &FitOptions) -> Self {
        let Recipe { start, clothing, sighting, cover, shape, .. } = &options.recipe;
        let init = SurfaceInit {
            placement: start.placement,
            bind_to: start.bind_to,
            longest_edge: f64::from(options.edge_mm) / 1000.0,
            scale: start.scale,
            thickness: start.thickness,
            opacity: start.opacity,
            inset: start.inset,
            samples: start.samples,
            shape: start.shape,
            sh_degree: 0,
            refinements: 0,
            clothing: clothing.clone(),
            sighting: sighting.clone(),
            cover: cover.clone(),
            ..SurfaceInit::default()
        };
        let shape = (start.surface == Surface::Silhouettes).then(|| ShapeFit {
            iterations: options.shape_iterations() as usize,
            seed: options.seed,
            clothing: clothing.clone(),
            sighting: sighting.clone(),
            options: shape.clone(),
        });
        Self { init, shape }
    }
}

/// The avatar with which a recipe starts.
///
/// # Errors
/// As [`surface_init`] and [`fit_shape`]; a shape fit that diverges.
pub fn start(sequence: &Sequence, options: &FitOptions) -> Result<Started, Error> {
    let Starting { init, shape } = Starting::of(options);
    match shape {
        None => Ok(Started { avatar: surface_init(sequence, &init)?, warnings: Vec::new() }),
        Some(settings) => {
            let shape = fit_shape(sequence, &settings)?;
            if let Ended::NotFinite { iteration, frame } = shape.ended {
                return Err(Error::Diverged {
                    sequence: sequence.id.clone(),
                    iteration: u32::try_from(iteration).unwrap_or(u32::MAX),
                    frame,
                    parameter: "offset of the surface".to_owned(),
                });
            }
            let dressed = Sequence { body: Arc::new(shape.body), ..sequence.clone() };
            let clothing = Clothing { rounds: 0, ..init.clothing };
            let avatar = surface_init(&dressed, &SurfaceInit { clothing, ..init })?;
            let name = |warning: String| format!("{}: {warning}", sequence.id);
            Ok(Started { avatar, warnings: shape.warnings.into_iter().map(name).collect() })
        }
    }
}

impl<'a> Trainer<'a> {
    /// Prepares the first iteration on an avatar, usually that of [`start`]. The mesh of a hybrid is made here.
    ///
    /// # Errors
    /// An avatar or body that breaks an invariant, a recipe that does not suit it, a sequence without frames; as
    /// [`gather_texture`](super::texture::gather_texture) for a hybrid.
    pub fn new(sequence: &'a Sequence, options: &'a FitOptions, avatar: Avatar) -> Result<Self, Error> {
        let edge = mean_edge(&sequence.body);
        let moments = options.recipe.schedule.moments;
        let parameters = Parameters::new(avatar, edge, &options.recipe.free, moments);
        let density = Density::new(parameters.len());
        let layer = options
            .recipe
            .mesh
            .as_ref()
            .map(|mesh| Layer::new(sequence, &options.recipe, mesh))
            .transpose()?;
        let poses = (options.recipe.poses == Poses::Refine).then(TrainingPoses::default);
        Self::with_state(sequence, options, (parameters, density, layer, poses), 0)
    }

    /// Goes on from a checkpoint of the same sequence and options.
    ///
    /// # Errors
    /// A checkpoint of another fit; otherwise as [`Trainer::new`].
    pub fn resume(
        sequence: &'a Sequence,
        options: &'a FitOptions,
        checkpoint: Checkpoint,
    ) -> Result<Self, Error> {
        let key = checkpoint::key(sequence, options)?;
        let Checkpoint { parameters, density, layer, poses, iteration, .. } = checkpoint.matching(&key)?;
        let layer = match (&options.recipe.mesh, layer) {
            (Some(mesh), Some(state)) => Some(Layer::resume(sequence, mesh, state)?),
            (None, None) => None,
            _ => return Err(inconsistent("the mesh of another recipe")),
        };
        let (n, nodes) = (parameters.avatar.gaussians.len(), sequence.body.skeleton.len());
        let refines = options.recipe.poses == Poses::Refine;
        let problems = [
            (!parameters.is_for(&options.recipe.free), "not one moment per parameter"),
            (!density.is_for(n), "not one gradient per Gaussian"),
            (poses.is_some() != refines, "the poses of another recipe"),
            (poses.as_ref().is_some_and(|poses| !poses.are_for(nodes)), "poses of another skeleton"),
            (iteration > options.iterations, "more iterations than the fit has"),
        ];
        if let Some((_, problem)) = problems.into_iter().find(|(is_wrong, _)| *is_wrong) {
            return Err(inconsistent(problem));
        }
        let trainer = Self::with_state(sequence, options, (parameters, density, layer, poses), iteration)?;
        Ok(Self { key: OnceLock::from(key), ..trainer })
    }

    fn with_state(
        sequence: &'a Sequence,
        options: &'a FitOptions,
        (parameters, density, layer, poses): (Parameters, Density, Option<Layer>, Option<TrainingPoses>),
        iteration: u32,
    ) -> Result<Self, Error> {
        options
            .recipe
            .check()
            .map_err(|error| Error::invalid("recipe", error.to_string(), "a sound recipe"))?;
        if sequence.frames.is_empty() {
            let field = format!("sequence {}: frames", sequence.id);
            return Err(Error::invalid(field, "none", "at least one"));
        }
        let strategy = options.recipe.strategy.parse::<Strategy>().map_err(Error::strategy(sequence))?;
        let bound =
            BoundAvatar::new(&parameters.avatar, &sequence.body).map_err(Error::strategy(sequence))?;
        let coupled = Coupled::new(&options.recipe.coupling, &parameters.start);
        Ok(Self {
            sequence,
            options,
            strategy,
            parameters,
            density,
            coupled,
            layer,
            poses,
            iteration,
            bound,
            faces: NearestFace::new(&sequence.body),
            frames: TrainingFrames::new(sequence, options.seed),
            warnings: Vec::new(),
            key: OnceLock::new(),
            scratch: Scratch::new(),
        })
    }

    /// True after the last iteration.
    pub fn is_done(&self) -> bool {
        self.iteration >= self.options.iterations
    }

    /// True before every iteration of [`Schedule::between_bindings`](crate::options::Schedule), when the avatar is bound anew: Gaussians that have moved meet other faces and
    /// skinning weights. Only a checkpoint of such a moment continues in the same bits.
    pub fn is_resting(&self) -> bool {
        self.iteration.is_multiple_of(self.options.recipe.schedule.between_bindings)
    }

    /// The avatar as it stands.
    pub fn avatar(&self) -> &Avatar {
        &self.parameters.avatar
    }

    /// The avatar as it stands, with its mesh.
    pub fn fitted(&self) -> Fitted<'_> {
        Fitted { avatar: self.avatar(), mesh: self.layer.as_ref().map(|layer| &layer.textured) }
    }

    /// The poses of the training frames as they stand, if they are fitted, in the order of the sequence's poses.
    pub fn poses(&self) -> Option<Vec<RefinedPose>> {
        self.poses.as_ref().map(|poses| poses.refined(self.sequence))
    }

    /// Warnings since they were last taken.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Everything that a later [`Trainer::resume`] needs, at a moment that [`Trainer::is_resting`]. The first call digests
    /// the training data.
    ///
    /// # Errors
    /// A training image that cannot be read.
    pub fn checkpoint(&self) -> Result<Checkpoint, Error> {
        let key = match self.key.get() {
            Some(key) => key.clone(),
            None => {
                let key = checkpoint::key(self.sequence, self.options)?;
                self.key.get_or_init(|| key).clone()
            }
        };
        let layer = self.layer.as_ref().map(Layer::state);
        let (parameters, density, poses) =
            (self.parameters.clone(), self.density.clone(), self.poses.clone());
        Ok(Checkpoint::new(key, parameters, density, layer, poses, self.iteration))
    }

    /// One iteration.
    ///
    /// # Errors
    /// A frame that cannot be read, no frame that shows the body, a loss or a parameter that is not finite.
    pub fn step(&mut self) -> Result<Step, Error> {
        let (recipe, iterations) = (&self.options.recipe, self.options.iterations);
        self.parameters.raise_sh_degree(recipe.sh_degree_at(self.iteration, iterations));
        let (in_strategy, in_scene) = (Error::strategy(self.sequence), Error::scene(self.sequence));
        self.bind().map_err(&in_strategy)?;
        let frame = self.frames.of_iteration(self.iteration as usize, &mut self.warnings)?;
        let refined = self.poses.as_ref().map(|poses| poses.applied(frame.pose_index, frame.pose));
        let pose = refined.as_ref().unwrap_or(frame.pose);
        let body = PosedBody::new(&self.sequence.body, pose).map_err(&in_scene)?;
        let (strategy, posing) = (&self.strategy, PoseOptions::default());
        let Scratch { poser, renderer, truth, losses, of_rendered, of_posed, of_avatar, of_body } =
            &mut self.scratch;
        let stage = recipe.stage_at(self.iteration, iterations);
        let posed = match stage {
            Stage::Texture => Posed::NOTHING,
            Stage::Gaussians | Stage::Together => {
                poser.pose(&self.bound, &body, strategy, &posing).map_err(&in_strategy)?
            }
        };
        let background = background(recipe.background, self.options.seed, self.iteration);
        let mesh = self.layer.as_mut().filter(|_| stage != Stage::Gaussians);
        let drawing = mesh.as_ref().map(|mesh| mesh.draw(pose, frame.camera));
        let drawing = drawing.transpose().map_err(&in_scene)?;
        let underlay = drawing.as_ref().map(Drawing::underlay);
        let view = View::new(frame.camera).over(background).with_underlay(underlay);
        let Rendered { image, alpha, .. } = renderer.render(&posed, &view).map_err(&in_scene)?;
        composite(&frame.truth.rgb, &frame.truth.alpha, background, truth);
        let weights = Weights { ssim: recipe.loss.ssim, silhouette: recipe.loss.silhouette };
        let loss = losses.frame((image, alpha), (truth, &frame.truth.alpha), &weights, of_rendered);
        renderer.backward(&posed, &view, of_rendered, of_posed, Derivatives::Exact).map_err(&in_scene)?;
        let pose_rates = poses::rates(&recipe.pose, self.iteration, iterations);
        let free = self.poses.as_mut().zip(pose_rates).filter(|_| stage != Stage::Texture);
        let mut of_mesh = None;
        if let (Some(mesh), Some(drawing), Some(shown)) = (mesh, &drawing, renderer.underlay_weight()) {
            if free.is_some() {
                let seen = (pose, frame.camera);
                let gradient = mesh.textured.pose_gradient(seen, drawing, background, of_rendered, shown);
                of_mesh = Some(gradient.map_err(&in_scene)?);
            }
            mesh.step(pose, frame.camera, &of_rendered.image, shown).map_err(&in_scene)?;
        }
        let frame_name = frame.name.to_owned();
        if stage == Stage::Texture {
            return self.finish(loss, &frame_name, stage);
        }
        let Avatar { gaussians, binding } = &self.parameters.avatar;
        of_avatar.reset(gaussians, matches!(binding, Binding::Face(_)));
        of_body.reset(body.joints.len());
        let into = Gradients { avatar: Some(of_avatar), body: free.is_some().then_some(&mut *of_body) };
        poser
            .backward(&self.bound, &body, strategy, &posing, gaussians, of_posed, into)
            .map_err(&in_strategy)?;
        if let Some((poses, rates)) = free {
            let mut gradient = body.pose_gradient(pose, of_body).map_err(&in_scene)?;
            if let Some(of_mesh) = of_mesh {
                gradient += of_mesh;
            }
            let Sequence { id, body, .. } = self.sequence;
            let stopped = poses.step(frame.pose_index, &body.skeleton, &gradient, (&recipe.pose, rates));
            self.warnings.extend(stopped.map(|problem| {
                format!(
                    "{id}: the pose of frame {frame_name} is fitted no further: {problem}; kept as it was"
                )
            }));
        }
        self.finish(loss, &frame_name, stage)
    }

    /// Follows the avatar's parameters: now and then it is bound anew.
    fn bind(&mut self) -> Result<(), PosingError> {
        let avatar = &self.parameters.avatar;
        match self.is_resting() {
            true => self.bound.rebind(avatar, &self.sequence.body, self.faces.as_ref()),
            false => self.bound.update(avatar),
        }
    }

    /// The second half of an iteration: regularisers, the step, Gaussians that come and go.
    fn finish(&mut self, loss: FrameLoss, frame: &str, stage: Stage) -> Result<Step, Error> {
        let (recipe, iterations) = (&self.options.recipe, self.options.iterations);
        let mut total = loss.total;
        if stage != Stage::Texture {
            let Parameters { avatar, start, .. } = &self.parameters;
            let gradient = &mut self.scratch.of_avatar;
            let seen = regularise::seen(gradient);
            total += regularise::add(&recipe.loss_in(stage), avatar, start, &seen, gradient);
            if let Some(coupled) = &self.coupled {
                total += coupled.add(&recipe.coupling, avatar, start, &mut self.scratch.of_avatar);
            }
            let rates = RatesNow::of(recipe, self.iteration, iterations);
            self.density.observe(&self.scratch.of_posed);
            self.parameters.step(&mut self.scratch.of_avatar, &recipe.free, &rates);
        }
        if !total.is_finite() || self.parameters.broken().is_some() {
            return Err(self.diverged(frame));
        }
        self.iteration += 1;
        if stage != Stage::Texture
            && let Some(settings) = &recipe.densify
            && density::is_due(settings, self.iteration, iterations)
        {
            let (body, faces) = (&self.sequence.body, self.faces.as_ref());
            density::change(settings, &mut self.parameters, &mut self.density, body, faces)
                .map_err(Error::scene(self.sequence))?;
            self.bound
                .rebind(&self.parameters.avatar, body, faces)
                .map_err(Error::strategy(self.sequence))?;
            self.coupled = Coupled::new(&recipe.coupling, &self.parameters.start);
        }
        Ok(Step {
            iteration: self.iteration,
            iterations,
            loss: total,
            psnr: -10.0 * portable::log10(loss.mse.max(1e-12)),
            splats: self.parameters.len(),
        })
    }

    fn diverged(&self, frame: &str) -> Error {
        let parameter = match self.parameters.broken() {
            Some((name, gaussian)) => format!("{name} of Gaussian {gaussian}"),
            None => "no parameter yet, only the loss".to_owned(),
        };
        Error::Diverged {
            sequence: self.sequence.id.clone(),
            iteration: self.iteration,
            frame: frame.to_owned(),
            parameter,
        }
    }
}

impl Scratch {
    fn new() -> Self {
        let image = || Image::filled(1, 1, [0.0; 3]);
        Self {
            poser: Poser::new(),
            renderer: Renderer::new(),
            truth: image(),
            losses: Losses::default(),
            of_rendered: RenderedGradient { image: image(), alpha: None },
            of_posed: PosedGradient::default(),
            of_avatar: AvatarGradient::default(),
            of_body: BodyGradient::default(),
        }
    }
}

/// Mean edge of a body's faces, metres; 1 if it has none.
fn mean_edge(body: &RestBody) -> f32 {
    let edges = body.faces.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let lengths: Vec<f64> =
        edges.map(|(a, b)| body.vertices[a as usize].distance(body.vertices[b as usize])).collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    if mean > 0.0 { mean as f32 } else { 1.0 }
}
