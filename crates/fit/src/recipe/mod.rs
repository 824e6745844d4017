//! Fitting recipes as data: which parameters of an avatar are fitted, from what, against which loss, for how long.
//!
//! A recipe says nothing about code: `recipes.toml` holds those that come with the program, one section each, and a
//! section may build on another (`base`). The strategy under which an avatar is posed while it is fitted is part of the
//! recipe, and the only part in which the two variants of a table should differ.

mod file;
mod free;
mod mesh;

pub use file::RECIPES;
pub use free::{Free, FreePosition, FreeRotation, FreeScale};
pub use mesh::{MeshLayer, Stage};

use crate::Error;
use crate::options::{
    Clothing, Coupling, Cover, NOT_NEGATIVE, POSITIVE, PoseRefinement, Schedule, Sighting, within,
};
use crate::shape::ShapeOptions;
use serde::{Deserialize, Serialize};

/// How an avatar is fitted to the frames of a training sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Name; a varied recipe's is its whole specification.
    pub id: String,
    /// One line for people.
    pub title: String,
    /// Where the choices come from.
    pub source: String,
    /// How Gaussians are posed while they are fitted: a strategy's id or spec.
    pub strategy: String,
    /// SH degree that is reached in the end, 0 to 3.
    pub sh_degree: u8,
    /// Share of the iterations after which the SH degree is raised by one, again and again; 0 starts at the full degree.
    pub sh_step: f32,
    /// Iterations (one training frame each) of the method itself; profiles may allow fewer.
    pub iterations: u32,
    /// How often the method itself sees each training image, where its length is stated so; 0: `iterations` says.
    pub epochs: u32,
    /// What is behind the avatar and the truth in the loss.
    pub background: FitBackground,
    /// Where the Gaussians are before the first iteration.
    pub start: Start,
    /// What is fitted.
    pub free: Free,
    /// Learning rates of Adam.
    pub rates: Rates,
    /// What is minimised.
    pub loss: LossTerms,
    /// How Gaussians follow their neighbours.
    #[serde(default, skip_serializing_if = "Coupling::is_default")]
    pub coupling: Coupling,
    /// How Gaussians come and go; their number is fixed if absent.
    #[serde(default)]
    pub densify: Option<Densify>,
    /// A textured mesh that is drawn with the Gaussians; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshLayer>,
    /// Whether the poses of training frames are fitted too.
    #[serde(default, skip_serializing_if = "Poses::are_given")]
    pub poses: Poses,
    /// How, where they are.
    #[serde(default, skip_serializing_if = "PoseRefinement::is_default")]
    pub pose: PoseRefinement,
    /// How the body's outline is brought onto those of the masks.
    #[serde(default)]
    pub clothing: Clothing,
    /// Which sights of the surface count.
    #[serde(default)]
    pub sighting: Sighting,
    /// How the surface is covered.
    #[serde(default)]
    pub cover: Cover,
    /// How the surface is fitted to the silhouettes, where `start.surface` asks for it.
    #[serde(default)]
    pub shape: ShapeOptions,
    /// When things happen, and how steps are made.
    #[serde(default)]
    pub schedule: Schedule,
}

/// A recipe with a budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitOptions {
    /// What is fitted, and to what.
    pub recipe: Recipe,
    /// Number of iterations, one training frame each.
    pub iterations: u32,
    /// Seed of the order of frames and of backgrounds.
    pub seed: u64,
    /// Edges of the surface on which Gaussians start are halved until none is longer, millimetres.
    pub edge_mm: u32,
}

impl FitOptions {
    /// Iterations of the first stage, where there is one: a share of the fit's, but no more than help. Its steps look at
    /// several frames each.
    pub fn shape_iterations(&self) -> u32 {
        self.recipe.shape_iterations(self.iterations)
    }
}

/// What becomes of the poses of training frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Poses {
    /// They stay as they are given.
    #[default]
    Given,
    /// They are fitted with the avatar ([`PoseRefinement`]), as HUGS, HAHA and InstantAvatar do. The avatar's start is made with
    /// those given.
    Refine,
}

impl Poses {
    fn are_given(&self) -> bool {
        *self == Self::Given
    }
}

/// What is behind the avatar and the truth in the loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitBackground {
    /// Another colour for each iteration: nothing can hide in it.
    Random,
    /// White.
    White,
    /// Black.
    Black,
}

/// Where the Gaussians sit on the (tessellated) mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// One per vertex.
    Vertices,
    /// One per face, at its centroid.
    Faces,
}

/// How the Gaussians move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BindTo {
    /// By linear blend skinning, with the interpolated weights of the body's vertices.
    Joints,
    /// With the face of the body on which they sit.
    Faces,
}

/// The surface on which the Gaussians start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surface {
    /// The body, its vertices moved onto the outlines in the masks.
    Outlines,
    /// The body, fitted to the silhouettes by gradient descent (stage 1 of the pure skinned baseline).
    Silhouettes,
}

/// Where the Gaussians are before the first iteration. Their colours are gathered from the training frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// The surface.
    pub surface: Surface,
    /// Where they sit on it.
    pub placement: Placement,
    /// How they move.
    pub bind_to: BindTo,
    /// Standard deviations in the tangent plane, in units of those of the part of the surface that a Gaussian stands for.
    pub scale: f64,
    /// Standard deviation along the normal, in units of the mean one in the tangent plane.
    pub thickness: f64,
    /// Opacity, in (0, 1).
    pub opacity: f64,
    /// How far below the surface, in pixels of the training frames.
    pub inset: f64,
    /// Gaussians drawn from the surface, evenly by area and as large as their share of it; 0: all that `placement` has.
    #[serde(default)]
    pub samples: u32,
    /// What they look like.
    #[serde(default)]
    pub shape: StartShape,
}

/// The shape of a Gaussian before the first iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartShape {
    /// Flat on the surface.
    #[default]
    Disc,
    /// As wide across the surface as along it, at the identity: 3DGS, Animatable 3D Gaussians.
    Ball,
}

/// Learning rates of Adam, per iteration, in the units of the stored parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rates {
    /// Positions at the first iteration, metres.
    pub position: f32,
    /// Positions at the last iteration; in between the rate falls by a constant factor per iteration.
    pub position_last: f32,
    /// Raw quaternions, or the angle in radians.
    pub rotation: f32,
    /// Log standard deviations.
    pub scale: f32,
    /// Opacity logits.
    pub opacity: f32,
    /// SH coefficients of degree 0.
    pub colour: f32,
    /// Other SH coefficients.
    pub colour_rest: f32,
    /// What all rates but that of positions are multiplied by at the last iteration; in between they fall by a constant factor.
    #[serde(default = "defaults::one", skip_serializing_if = "defaults::is_one")]
    pub decay: f32,
}

/// Weights of what is minimised: `(1 - ssim) L1 + ssim (1 - SSIM)` on colour plus the terms below.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossTerms {
    /// Share of `1 - SSIM` in the colour term.
    pub ssim: f32,
    /// Of the L1 distance of the silhouettes.
    pub silhouette: f32,
    /// Of Gaussians that are long and thin, as `long_thin_form` counts them.
    pub long_thin: f32,
    /// What is summed over them.
    pub long_thin_form: LongThin,
    /// The ratio above which a Gaussian counts as long and thin.
    pub long_thin_ratio: f32,
    /// The standard deviation above which a Gaussian counts as long, metres.
    pub long_thin_limit: f32,
    /// Of the mean squared standard deviation, per square metre; what the frame does not see counts as nothing.
    pub scale: f32,
    /// Of the mean squared opacity; what the frame does not see counts as nothing.
    pub opacity: f32,
    /// Of the mean squared distance from where the Gaussians started, per square metre.
    pub displacement: f32,
    /// Of the mean over Gaussians of the squared norm of their SH coefficients beyond degree 0: directions from which
    /// nothing was seen look like those from which something was.
    pub sh_rest: f32,
}

/// What counts as a long and thin Gaussian, and how much.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LongThin {
    /// The mean over all Gaussians of `max(longest / second - ratio, 0) + max(longest - limit, 0)`, with the two larger standard
    /// deviations: flat discs are not thin.
    Excess,
    /// The mean longest standard deviation of the Gaussians with `longest > limit` and `longest / shortest > ratio`:
    /// SplattingAvatar's own.
    SplattingAvatar,
}

/// How Gaussians come and go: adaptive density control of 3DGS, on a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Densify {
    /// Share of the iterations before the first change.
    pub from: f32,
    /// Share of the iterations after the last one.
    pub until: f32,
    /// Number of changes in between, or more where `interval` says so.
    pub rounds: u32,
    /// In fits that are long enough, a change every so many iterations; 0: `rounds` whatever their length.
    #[serde(default, skip_serializing_if = "defaults::is_zero")]
    pub interval: u32,
    /// Gaussians whose mean gradient on screen (per half image) is larger are cloned or split.
    pub gradient: f32,
    /// Gaussians with a standard deviation above this are split, others cloned, metres.
    pub split_above: f32,
    /// Gaussians less opaque than this are removed.
    pub prune_opacity: f32,
    /// No more Gaussians than this times the number at the start.
    pub most: f32,
    /// Whether face-bound Gaussians walk onto the triangle that they slide into (SplattingAvatar).
    pub walk: bool,
    /// A Gaussian that walks crosses at most so many edges at a time.
    #[serde(default = "defaults::most_crossings")]
    pub most_crossings: u32,
    /// What a Gaussian that is split shrinks by (3DGS).
    #[serde(default = "defaults::shrink")]
    pub shrink: f32,
    /// How far the halves of a split Gaussian sit from the whole, standard deviations.
    #[serde(default = "defaults::apart")]
    pub apart: f32,
}

/// Values of fields that recipes need not name.
mod defaults {
    pub(super) fn one() -> f32 {
        1.0
    }

    pub(super) fn is_zero(value: &u32) -> bool {
        *value == 0
    }

    pub(super) fn is_one(value: &f32) -> bool {
        *value == 1.0
    }

    pub(super) fn most_crossings() -> u32 {
        16
    }

    pub(super) fn shrink() -> f32 {
        1.6
    }

    pub(super) fn apart() -> f32 {
        0.5
    }
}

impl Recipe {
    /// The recipe of this name, or with other choices: `hugs-like`, `hugs-like+rates.rotation=0.01+free.opacity=false`.
    /// Fields and values are those of `recipes.toml`.
    ///
    /// # Errors
    /// An unknown recipe, field or value, or a number out of range.
    pub fn parse(specification: &str) -> Result<Self, Error> {
        file::parse(specification)
    }

    /// Number of iterations of a fit to so many training images: `iterations`, but no more than a profile allows; without such a
    /// bound, the method's own number. `schedule.and_shape_visits` comes on top.
    pub fn length(&self, images: usize, most: Option<u32>) -> u32 {
        let images = u32::try_from(images).unwrap_or(u32::MAX);
        let length = match (most, self.epochs) {
            (Some(most), _) => self.iterations.min(most),
            (None, 0) => self.iterations,
            (None, epochs) => epochs.saturating_mul(images).max(1),
        };
        if !self.schedule.and_shape_visits {
            return length;
        }
        let frames = u32::try_from(self.shape.batch).unwrap_or(u32::MAX);
        length.saturating_add(self.shape_iterations(length).saturating_mul(frames))
    }

    fn shape_iterations(&self, iterations: u32) -> u32 {
        let Schedule { shape_share, most_shape_iterations, .. } = self.schedule;
        ((f64::from(iterations) * shape_share) as u32).clamp(1, most_shape_iterations.max(1))
    }

    /// The SH degree in force at an iteration out of a number.
    pub fn sh_degree_at(&self, iteration: u32, iterations: u32) -> usize {
        let full = usize::from(self.sh_degree);
        let step = (f64::from(self.sh_step) * f64::from(iterations)).round() as u32;
        iteration.checked_div(step).map_or(full, |raised| full.min(raised as usize))
    }

    /// What is drawn and fitted at an iteration out of a number.
    pub fn stage_at(&self, iteration: u32, iterations: u32) -> Stage {
        self.mesh.as_ref().map_or(Stage::Gaussians, |mesh| mesh.stage_at(iteration, iterations))
    }

    /// What is minimised in a stage: Gaussians without a mesh beside them are not asked to be transparent.
    pub(crate) fn loss_in(&self, stage: Stage) -> LossTerms {
        let alone = self.mesh.is_some() && stage == Stage::Gaussians;
        LossTerms { opacity: if alone { 0.0 } else { self.loss.opacity }, ..self.loss.clone() }
    }

    /// The recipe without its names: what a fit depends on.
    pub fn choices(&self) -> Self {
        Self { id: String::new(), title: String::new(), source: String::new(), ..self.clone() }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Names the first field out of range.
    pub fn check(&self) -> Result<(), Error> {
        let Self { start, rates, loss, .. } = self;
        let positive = [
            ("start.scale", start.scale),
            ("start.thickness", start.thickness),
            ("start.opacity", start.opacity),
            ("loss.long_thin_ratio", f64::from(loss.long_thin_ratio)),
            ("loss.long_thin_limit", f64::from(loss.long_thin_limit)),
            ("iterations", f64::from(self.iterations)),
        ];
        let not_negative = [
            ("rates.position", rates.position),
            ("rates.position_last", rates.position_last),
            ("rates.rotation", rates.rotation),
            ("rates.scale", rates.scale),
            ("rates.opacity", rates.opacity),
            ("rates.colour", rates.colour),
            ("rates.colour_rest", rates.colour_rest),
            ("loss.silhouette", loss.silhouette),
            ("loss.long_thin", loss.long_thin),
            ("loss.scale", loss.scale),
            ("loss.opacity", loss.opacity),
            ("loss.displacement", loss.displacement),
            ("loss.sh_rest", loss.sh_rest),
            ("free.scale_most", self.free.scale_most),
        ];
        let shares = [("sh_step", self.sh_step), ("loss.ssim", loss.ssim)];
        let refuse = |key: &str, value: String, expected: &str| {
            Err(Error::invalid(format!("recipe {}: {key}", self.id), value, expected))
        };
        if let Some((key, value)) = positive.iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            return refuse(key, value.to_string(), "a finite number above 0");
        }
        if !(rates.decay > 0.0 && rates.decay <= 1.0) {
            return refuse("rates.decay", rates.decay.to_string(), "above 0, at most 1");
        }
        if let Some((key, value)) = not_negative.iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
            return refuse(key, value.to_string(), "a finite number, at least 0");
        }
        if let Some((key, value)) = shares.iter().find(|(_, v)| !(0.0..=1.0).contains(v)) {
            return refuse(key, value.to_string(), "0 to 1");
        }
        if start.opacity >= 1.0 {
            return refuse("start.opacity", start.opacity.to_string(), "below 1");
        }
        if !start.inset.is_finite() {
            return refuse("start.inset", start.inset.to_string(), "a finite number of pixels");
        }
        if start.surface == Surface::Silhouettes && start.bind_to == BindTo::Faces {
            let expected = "outlines: a surface fitted to the silhouettes has other faces than the body";
            return refuse(
                "start.surface",
                "silhouettes, with Gaussians bound to faces".to_owned(),
                expected,
            );
        }
        if self.sh_degree > 3 {
            return refuse("sh_degree", self.sh_degree.to_string(), "0 to 3");
        }
        if self.strategy.parse::<skinsplat_posing::Strategy>().is_err() {
            return refuse("strategy", format!("`{}`", self.strategy), "the id or spec of a strategy");
        }
        let tied = self.free.position == FreePosition::AlongNormal
            || self.free.rotation == FreeRotation::AboutNormal;
        if self.densify.is_some() && tied {
            let expected = "free.position and free.rotation that are not measured from the start";
            return refuse("densify", "new Gaussians have no start".to_owned(), expected);
        }
        self.mesh.as_ref().map_or(Ok(()), |mesh| mesh.check(&self.id))?;
        self.coupling.check("coupling")?;
        self.pose.check("pose")?;
        self.clothing.check("clothing")?;
        self.sighting.check("sighting")?;
        self.cover.check("cover")?;
        self.shape.check("shape")?;
        self.schedule.check("schedule")?;
        self.densify.as_ref().map_or(Ok(()), |densify| densify.check(&self.id))
    }
}

impl Densify {
    fn check(&self, id: &str) -> Result<(), Error> {
        let refuse = |key: &str, value: f32, expected: &str| {
            Err(Error::invalid(format!("recipe {id}: densify.{key}"), value.to_string(), expected))
        };
        if !(0.0 <= self.from && self.from < self.until && self.until <= 1.0) {
            return refuse("from", self.from, "shares with 0 <= from < until <= 1");
        }
        let positive = [("gradient", self.gradient), ("split_above", self.split_above)];
        if let Some((key, value)) = positive.iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            return refuse(key, *value, "a finite number above 0");
        }
        within(
            "densify",
            &[
                ("shrink", f64::from(self.shrink), POSITIVE),
                ("apart", f64::from(self.apart), NOT_NEGATIVE),
                ("most_crossings", f64::from(self.most_crossings), 0.0..=1e6),
            ],
        )?;
        if !(self.most.is_finite() && self.most >= 1.0) {
            return refuse("most", self.most, "a finite number, at least 1");
        }
        if !(0.0..1.0).contains(&self.prune_opacity) {
            return refuse("prune_opacity", self.prune_opacity, "at least 0, below 1");
        }
        Ok(())
    }
}
