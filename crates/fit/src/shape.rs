//! The shape of a subject, fitted to silhouettes: the first stage of the pure skinned baseline (§4.4 of the paper).
//!
//! Every vertex of the once-subdivided body mesh moves along its rest normal; the displaced mesh is posed by Eq. 6 and
//! its silhouette compared with the masks (intersection over union), next to three terms that keep it a body
//! (`regularity`). The steps are Adam's on parameters of which the offsets are a smoothed image (`diffusion`): outlines
//! visit a thin line of vertices per frame, and what lies between two such lines should follow both.

mod diffusion;
mod regularity;
mod surface;
mod views;

use super::adam::Adam;
use super::frame_order::shuffled;
use super::options::{Clothing, Moments, NOT_NEGATIVE, POSITIVE, SHARE, Sighting, within};
use super::silhouette::Blur;
use super::{Error, clothing, training};
use diffusion::Diffusion;
use rayon::prelude::*;
use regularity::{Regularity, Weights};
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::scene::RestBody;
use skinsplat_data::sequence::Sequence;
use std::sync::Arc;
use surface::Surface;
use views::{Cache, View};

/// How a shape is fitted. The defaults were chosen on a clothed subject, by the overlap with held-out masks; they move a
/// naked one by a fraction of a pixel. 400 iterations gain another 0.0002 of intersection over union.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapeFit {
    /// Steps.
    pub iterations: usize,
    /// Of the order of the frames.
    pub seed: u64,
    /// The fit starts from the offsets that this finds; from the body for no rounds.
    pub clothing: Clothing,
    /// What counts as hidden for `clothing`.
    pub sighting: Sighting,
    /// What is minimised, and how.
    pub options: ShapeOptions,
}

/// What the fit of a shape minimises, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapeOptions {
    /// Frames per step.
    pub batch: usize,
    /// Adam's step at the start, metres; falls to zero along a half cosine.
    pub learning_rate: f64,
    /// Adam's moments, their ε in units of the objective per metre: vertices that hardly matter to it hardly move. With a
    /// smaller one, those that no outline visits follow the last digits of the regularisers at full pace.
    pub moments: Moments,
    /// Weight of one minus the intersection over union.
    pub iou: f64,
    /// Weight of the variance of edge lengths relative to the rest mesh.
    pub edge_length: f64,
    /// Weight of the mean squared difference between the turns of adjacent faces' normals.
    pub normal_consistency: f64,
    /// Weight of the mean squared Laplacian of the offsets, in mean edge lengths.
    pub laplacian: f64,
    /// How often the offsets are averages over their neighbours.
    pub smoothing: usize,
    /// Standard deviation of the filter over silhouettes and masks, pixels; zero for none.
    pub softness: f64,
    /// Frames are reduced to at most so many pixels on their longer side.
    pub longest_side: u32,
    /// The filter reaches so many standard deviations.
    pub filter_reach: f64,
    /// Pixels around the mask and the body at rest that are looked at beside what the filter needs.
    pub margin: usize,
    /// A mask of less area than this is empty, pixels.
    pub least_area: f64,
    /// A mask that covers more than this part of its image has no outline.
    pub most_covered: f64,
}

impl Default for ShapeFit {
    fn default() -> Self {
        Self {
            iterations: 150,
            seed: 0,
            clothing: Clothing::default(),
            sighting: Sighting::default(),
            options: ShapeOptions::default(),
        }
    }
}

impl Default for ShapeOptions {
    fn default() -> Self {
        Self {
            batch: 4,
            learning_rate: 1e-3,
            moments: Moments::with_epsilon(1e-4),
            iou: 1.0,
            edge_length: 1e-3,
            normal_consistency: 2e-3,
            laplacian: 5e-3,
            smoothing: 8,
            softness: 1.0,
            longest_side: 512,
            filter_reach: 3.0,
            margin: 8,
            least_area: 1.0,
            most_covered: 0.999,
        }
    }
}

/// Why a fit ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ended {
    /// All steps were made.
    Finished,
    /// A loss or a gradient was not finite; the shape is that of the step before.
    NotFinite {
        /// The step.
        iteration: usize,
        /// The frame, or "regularisers".
        frame: String,
    },
}

/// A fitted shape.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedShape {
    /// The sequence's body, subdivided once and displaced; same skeleton.
    pub body: RestBody,
    /// The displacement of its vertices along the rest normals of the subdivided body, metres.
    pub offsets: Vec<f32>,
    /// Iteration, loss and intersection over union of every step.
    pub curve: Vec<(usize, f64, f64)>,
    /// Frames that were left out, and why.
    pub warnings: Vec<String>,
    /// Why the fit ended.
    pub ended: Ended,
}

/// Fits the shape of a sequence's body to its masks.
///
/// # Errors
/// A setting out of range, a sequence without frames, a body without faces or that breaks an invariant, a frame that
/// cannot be read, no frame whose mask says anything about the shape.
pub fn fit_shape(sequence: &Sequence, settings: &ShapeFit) -> Result<FittedShape, Error> {
    let ShapeFit { clothing, sighting, options, .. } = settings;
    sighting.check("sighting")?;
    options.check("")?;
    let training = training::prepared(sequence, usize::MAX)?.reduced(options.longest_side);
    let start = clothing::offsets_from_outlines(&training, clothing, sighting)?;
    let (surface, start) = Surface::new(&training.body, &start).map_err(Error::scene(&training))?;
    Fit::new(&training, settings, &surface, start).run()
}

impl ShapeOptions {
    /// Checks every number; fields are named within `section`.
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        let bounds = [
            ("batch", self.batch as f64, 1.0..=f64::MAX),
            ("learning_rate", self.learning_rate, NOT_NEGATIVE),
            ("iou", self.iou, NOT_NEGATIVE),
            ("edge_length", self.edge_length, NOT_NEGATIVE),
            ("normal_consistency", self.normal_consistency, NOT_NEGATIVE),
            ("laplacian", self.laplacian, NOT_NEGATIVE),
            ("smoothing", self.smoothing as f64, 0.0..=1e6),
            // wider filters leave nothing of a silhouette
            ("softness", self.softness, 0.0..=32.0),
            ("filter_reach", self.filter_reach, 0.0..=16.0),
            ("longest_side", f64::from(self.longest_side), 1.0..=f64::MAX),
            ("margin", self.margin as f64, 0.0..=1e6),
            ("least_area", self.least_area, POSITIVE),
            ("most_covered", self.most_covered, SHARE),
        ];
        within(section, &bounds)?;
        let dot = if section.is_empty() { "" } else { "." };
        self.moments.check(&format!("{section}{dot}moments"))
    }
}

impl ShapeFit {
    fn rate(&self, iteration: usize) -> f32 {
        let done = iteration as f64 / self.iterations as f64;
        (self.options.learning_rate * 0.5 * (1.0 + portable::cos(std::f64::consts::PI * done))) as f32
    }
}

struct Fit<'a> {
    sequence: &'a Sequence,
    settings: &'a ShapeFit,
    surface: &'a Surface,
    blur: Blur,
    /// Offsets at the start, metres: the parameters are relative to them.
    start: Vec<f32>,
    cache: Cache,
    /// Frames still to come in this round, the next one last.
    queue: Vec<usize>,
    rounds: u64,
    /// Frames that say nothing about the shape.
    unusable: Vec<bool>,
    warnings: Vec<String>,
}

impl<'a> Fit<'a> {
    fn new(sequence: &'a Sequence, settings: &'a ShapeFit, surface: &'a Surface, start: Vec<f32>) -> Self {
        let frames = sequence.frames.len();
        Self {
            sequence,
            settings,
            surface,
            blur: Blur::new(settings.options.softness, settings.options.filter_reach),
            start,
            cache: Cache::new(frames),
            queue: Vec::new(),
            rounds: 0,
            unusable: vec![false; frames],
            warnings: Vec::new(),
        }
    }

    fn run(mut self) -> Result<FittedShape, Error> {
        let Surface { body, normals, topology } = self.surface;
        let regularity = Regularity::new(topology, &body.vertices, normals);
        let diffusion = Diffusion::new(body.vertices.len(), &body.faces, self.settings.options.smoothing);
        let weights = self.settings.options.weights();
        let mut parameters = vec![0.0f32; self.start.len()];
        let mut adam = Adam::new(parameters.len(), self.settings.options.moments);
        let mut curve = Vec::with_capacity(self.settings.iterations);
        let mut ended = Ended::Finished;
        let mut offsets = self.offsets(&diffusion, &parameters);
        for iteration in 0..self.settings.iterations {
            let batch = self.next_batch()?;
            let step = self.evaluate(&batch, &regularity, weights, &offsets);
            let step = match step {
                Ok(step) => step,
                Err(frame) => {
                    ended = Ended::NotFinite { iteration, frame };
                    break;
                }
            };
            let kept = parameters.clone();
            adam.step(&mut parameters, &diffusion.pulled_back(step.gradient), self.settings.rate(iteration));
            offsets = self.offsets(&diffusion, &parameters);
            if offsets.iter().any(|o| !o.is_finite()) {
                parameters = kept;
                ended = Ended::NotFinite { iteration, frame: "offsets".into() };
                break;
            }
            curve.push((iteration, step.loss, step.iou));
        }
        let offsets: Vec<f32> = self.offsets(&diffusion, &parameters).into_iter().map(|o| o as f32).collect();
        let body = body.clone().with_normal_offset(&offsets).map_err(Error::scene(self.sequence))?;
        Ok(FittedShape { body, offsets, curve, warnings: self.warnings, ended })
    }

    fn offsets(&self, diffusion: &Diffusion, parameters: &[f32]) -> Vec<f64> {
        diffusion.apply(parameters).iter().zip(&self.start).map(|(p, &s)| p + f64::from(s)).collect()
    }

    /// The next usable frames and their numbers. Each comes once per round; a round is cut into batches of nearly equal
    /// size.
    fn next_batch(&mut self) -> Result<Vec<(usize, Arc<View>)>, Error> {
        loop {
            if self.queue.is_empty() {
                self.fill_queue()?;
            }
            let batches = self.queue.len().div_ceil(self.settings.options.batch);
            let size = self.queue.len().div_ceil(batches);
            let next = self.queue.split_off(self.queue.len() - size);
            let batch = self.loaded(next)?;
            if !batch.is_empty() {
                return Ok(batch);
            }
        }
    }

    fn fill_queue(&mut self) -> Result<(), Error> {
        self.queue = shuffled(self.unusable.len(), self.settings.seed, self.rounds);
        self.queue.retain(|&frame| !self.unusable[frame]);
        self.rounds += 1;
        if self.queue.is_empty() {
            let field = format!("sequence {}: masks", self.sequence.id);
            let problem =
                format!("none of {} frames is usable: {}", self.unusable.len(), self.warnings.join("; "));
            return Err(Error::invalid(field, problem, "masks that overlap with the projected body"));
        }
        Ok(())
    }

    /// The views of frames, without those that turn out to be unusable.
    fn loaded(&mut self, frames: Vec<usize>) -> Result<Vec<(usize, Arc<View>)>, Error> {
        let start: Vec<f64> = self.start.iter().map(|&o| f64::from(o)).collect();
        let load = |&frame: &usize| match self.cache.get(frame) {
            Some(view) => Ok(Ok(view)),
            None => Ok(View::load(
                self.sequence,
                frame,
                self.surface,
                &start,
                &self.blur,
                &self.settings.options,
            )?
            .map(Arc::new)),
        };
        let views: Vec<Result<Arc<View>, _>> = frames.par_iter().map(load).collect::<Result<_, Error>>()?;
        let mut usable = Vec::with_capacity(frames.len());
        for (frame, view) in frames.into_iter().zip(views) {
            match view {
                Ok(view) => {
                    self.cache.keep(frame, &view);
                    usable.push((frame, view));
                }
                Err(problem) => {
                    self.unusable[frame] = true;
                    self.warnings.push(format!("frame {}: {problem}", self.sequence.frames[frame].name));
                }
            }
        }
        Ok(usable)
    }

    /// The objective and its derivative by the offsets; the name of what is not finite.
    fn evaluate(
        &self,
        batch: &[(usize, Arc<View>)],
        regularity: &Regularity<'_>,
        weights: Weights,
        offsets: &[f64],
    ) -> Result<Step, String> {
        let compare = |(_, view): &(usize, Arc<View>)| view.compare(self.surface, offsets, &self.blur);
        let (compared, (mut loss, mut gradient)) = rayon::join(
            || batch.par_iter().map(compare).collect::<Vec<_>>(),
            || regularity.evaluate(offsets, weights),
        );
        if !is_finite(loss, &gradient) {
            return Err("regularisers".into());
        }
        let share = 1.0 / batch.len() as f64;
        let mut mean = 0.0;
        for ((frame, _), (iou, by_offset)) in batch.iter().zip(&compared) {
            if !is_finite(*iou, by_offset) {
                return Err(self.sequence.frames[*frame].name.clone());
            }
            mean += iou * share;
            let weight = -self.settings.options.iou * share;
            gradient.iter_mut().zip(by_offset).for_each(|(sum, g)| *sum += weight * g);
        }
        loss += self.settings.options.iou * (1.0 - mean);
        Ok(Step { loss, iou: mean, gradient })
    }
}

struct Step {
    loss: f64,
    iou: f64,
    gradient: Vec<f64>,
}

fn is_finite(value: f64, gradient: &[f64]) -> bool {
    value.is_finite() && gradient.iter().all(|g| g.is_finite())
}

impl ShapeOptions {
    fn weights(&self) -> Weights {
        Weights {
            edge_length: self.edge_length,
            normal_consistency: self.normal_consistency,
            laplacian: self.laplacian,
        }
    }
}
