//! Numbers on which avatars depend, by subject: what was found to work, as data that recipes may vary and content keys
//! hold. `Default` is what every recipe of the program uses.

use crate::Error;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// How the body's outline is brought onto those of the masks ([`crate::clothing`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clothing {
    /// How often the outlines are compared and the surface moved; zero leaves the body as it is.
    pub rounds: usize,
    /// How far along the normal an outline is looked for, pixels.
    pub reach: f64,
    /// Steps per pixel along the normal.
    pub steps_per_pixel: f64,
    /// A point takes part where the cosine between its normal and the view is at most this: on the outline it is zero.
    pub most_facing: f64,
    /// A point lies on the body's outline if that is within so many pixels of it.
    pub on_outline: f64,
    /// Something this much nearer hides a point, metres.
    pub hidden: f64,
    /// Pull of each vertex towards its neighbours, in observations per neighbour.
    pub smoothness: f64,
    /// Pull of each vertex towards no offset, in observations.
    pub shrinkage: f64,
    /// Gauss-Seidel steps of the smoothing.
    pub smoothing_steps: usize,
}

impl Default for Clothing {
    fn default() -> Self {
        Self {
            rounds: 2,
            reach: 12.0,
            steps_per_pixel: 4.0,
            most_facing: 0.35,
            on_outline: 2.0,
            hidden: 0.03,
            smoothness: 1.0,
            shrinkage: 0.05,
            smoothing_steps: 200,
        }
    }
}

/// Which sights of a surface point are trusted, and how far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sighting {
    /// Weight of a sight: cosine of the angle between normal and view, to this power. A frontal sight has more pixels per
    /// area and less blur.
    pub facing_power: i32,
    /// Surfaces seen at a smaller cosine are not looked at.
    pub least_facing: f64,
    /// The depth buffer has this many samples per pixel side.
    pub oversampling: u32,
    /// Points within this many samples of an edge of the depth buffer are not trusted: the image filter mixes both sides.
    pub edge_radius: u32,
    /// How far behind the depth buffer a visible point may lie, metres, beside what the slope explains.
    pub depth_tolerance: f64,
    /// Factor of a sight beside an occluder: it shows the occluder's colour.
    pub beside_occluder: f64,
    /// Factor of a sight beside the surface's own outline or over a part that is not fully covered.
    pub beside_outline: f64,
    /// Coverage from which a pixel counts as fully covered.
    pub full_coverage: f32,
    /// Coverage below which a pixel says nothing.
    pub least_coverage: f32,
}

impl Default for Sighting {
    fn default() -> Self {
        Self {
            facing_power: 2,
            least_facing: 0.1,
            oversampling: 2,
            edge_radius: 3,
            depth_tolerance: 0.003,
            beside_occluder: 1e-4,
            beside_outline: 1e-2,
            full_coverage: 0.99,
            least_coverage: 0.5,
        }
    }
}

/// How a surface is covered with Gaussians or texels, and where their colours come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cover {
    /// At most so many training frames are looked at, evenly spread over the sequence.
    pub most_frames: usize,
    /// Observations this far from the consensus of the others, in colour, count a quarter.
    pub robust_scale: f64,
    /// Steps of diffusion, after the first guess, of the colours of what no frame shows.
    pub diffusion_steps: usize,
    /// No face is divided more often: 4 to this power parts.
    pub most_divisions: u32,
    /// The longest axis of a Gaussian is at most this many times the shorter one in the plane.
    pub largest_aspect: f64,
    /// No standard deviation is smaller, metres: parts without area still need a valid Gaussian.
    pub least_sigma: f64,
    /// The next layer of the surface is looked for in a cone around the inward normal: at most this far aside, relative to
    /// its depth.
    pub room_cone: f64,
    /// Gaussians sink by at most this share of the room below them: they must not come out on the other side of a lip or an
    /// ear.
    pub share_of_room: f64,
}

impl Default for Cover {
    fn default() -> Self {
        Self {
            most_frames: 64,
            robust_scale: 0.1,
            diffusion_steps: 200,
            most_divisions: 8,
            largest_aspect: 4.0,
            least_sigma: 1e-5,
            room_cone: 0.7,
            share_of_room: 0.4,
        }
    }
}

/// The decay and floor of Adam's moments.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moments {
    /// Decay of the first moment.
    pub beta1: f32,
    /// Decay of the second moment.
    pub beta2: f32,
    /// Added to the root of the second moment: gradients far below it move nothing.
    pub epsilon: f32,
}

impl Moments {
    /// β 0.9 and 0.999, as everywhere, with an ε.
    pub const fn with_epsilon(epsilon: f32) -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon }
    }
}

/// When things happen in the course of a fit, and how its steps are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Schedule {
    /// Iterations between two bindings of the avatar to its body: Gaussians that have moved meet other faces and weights.
    pub between_bindings: u32,
    /// Iterations of the fit of the shape (`start.surface = "silhouettes"`) as a share of the fit's own (§4.4 of the paper).
    pub shape_share: f64,
    /// No more iterations of the fit of the shape: beyond, outlines gain a ten-thousandth of their overlap and what lies
    /// between them drifts.
    pub most_shape_iterations: u32,
    /// As many iterations more as that first stage would look at frames: for a recipe without it that is compared with one that has
    /// it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub and_shape_visits: bool,
    /// Of the moments of the Gaussians' parameters; the ε is that of 3DGS.
    pub moments: Moments,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            between_bindings: 50,
            shape_share: 0.25,
            most_shape_iterations: 400,
            and_shape_visits: false,
            moments: Moments::with_epsilon(1e-15),
        }
    }
}

/// How what has changed about a Gaussian since the start is drawn towards what has changed about those around it: per pair of neighbours
/// the squared difference, over the number of Gaussians and of neighbours each, times a weight. What no frame shows follows what
/// frames show, and what few frames show is not learnt by heart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Coupling {
    /// So many are looked for around each Gaussian, among those whose normal at the start is less than 60 degrees off.
    pub neighbours: u32,
    /// Of displacements, per square metre; of face-bound Gaussians those along the normal.
    pub position: f32,
    /// Of log standard deviations.
    pub scale: f32,
    /// Of opacity logits.
    pub opacity: f32,
    /// Of SH coefficients of degree 0.
    pub colour: f32,
    /// Of the other SH coefficients.
    pub colour_rest: f32,
}

impl Default for Coupling {
    fn default() -> Self {
        Self { neighbours: 6, position: 0.0, scale: 0.0, opacity: 0.0, colour: 0.0, colour_rest: 0.0 }
    }
}

impl Coupling {
    /// True for the values of [`Default`].
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// True if nothing is coupled.
    pub(crate) fn is_off(&self) -> bool {
        let Self { position, scale, opacity, colour, colour_rest, .. } = *self;
        [position, scale, opacity, colour, colour_rest].iter().all(|&weight| weight == 0.0)
    }

    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("neighbours", f64::from(self.neighbours), 1.0..=64.0),
                ("position", f64::from(self.position), NOT_NEGATIVE),
                ("scale", f64::from(self.scale), NOT_NEGATIVE),
                ("opacity", f64::from(self.opacity), NOT_NEGATIVE),
                ("colour", f64::from(self.colour), NOT_NEGATIVE),
                ("colour_rest", f64::from(self.colour_rest), NOT_NEGATIVE),
            ],
        )
    }
}

/// How the poses of training frames are fitted with the avatar (`poses = "refine"`): one state of Adam per pose, over a rotation
/// vector per joint and the translation of the body.
///
/// HUGS takes 1e-4 for both over 250 visits of a frame, HAHA 2e-4 over 400 (`cfg_files/release/neuman`, `configs` of their
/// repositories): rates times visits, which is how far a pose can go, are what the rates here are set to reach with fewer visits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseRefinement {
    /// Learning rate of joint rotations, radians per visit of a frame.
    pub rate: f32,
    /// Learning rate of the translation, metres per visit.
    pub translation_rate: f32,
    /// What both are multiplied by at the last iteration; in between they fall by a constant factor per iteration.
    pub decay: f32,
    /// Share of the iterations before which poses stay as they are given: an avatar that shows nothing yet pulls them astray.
    pub from: f32,
    /// A joint that turns further than this from the given pose has lost its way, degrees: its pose is fitted no further.
    pub most_degrees: f64,
    /// Of Adam. Its ε keeps joints that hardly move a pixel from wandering.
    pub moments: Moments,
}

impl Default for PoseRefinement {
    fn default() -> Self {
        Self {
            rate: 1e-2,
            translation_rate: 2e-3,
            decay: 0.1,
            from: 0.1,
            most_degrees: 60.0,
            moments: Moments::with_epsilon(1e-5),
        }
    }
}

impl PoseRefinement {
    /// True for the values of [`Default`].
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("rate", f64::from(self.rate), NOT_NEGATIVE),
                ("translation_rate", f64::from(self.translation_rate), NOT_NEGATIVE),
                ("decay", f64::from(self.decay), f64::MIN_POSITIVE..=1.0),
                ("from", f64::from(self.from), SHARE),
                ("most_degrees", self.most_degrees, f64::MIN_POSITIVE..=180.0),
            ],
        )?;
        self.moments.check(&format!("{section}.moments"))
    }
}

/// How the pose of a test image is fitted with the avatar frozen ([`crate::pose_fit`]). HAHA takes 100 steps of gradient descent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseFit {
    /// Steps of Adam.
    pub steps: u32,
    /// Learning rate of joint rotations at the first step, radians.
    pub rate: f32,
    /// Learning rate of the translation at the first step, metres.
    pub translation_rate: f32,
    /// What both are multiplied by at the last step; in between they fall by a constant factor.
    pub decay: f32,
    /// A joint that turns further than this from the given pose has lost its way, degrees: the fit has failed.
    pub most_degrees: f64,
    /// Share of `1 - SSIM` in the colour term; the rest is L1.
    pub ssim: f32,
    /// Weight of the L1 distance of the silhouettes.
    pub silhouette: f32,
    /// Of Adam.
    pub moments: Moments,
}

impl Default for PoseFit {
    fn default() -> Self {
        Self {
            steps: 60,
            rate: 1e-2,
            translation_rate: 3e-3,
            decay: 0.05,
            most_degrees: 60.0,
            ssim: 0.2,
            silhouette: 0.1,
            moments: Moments::with_epsilon(1e-5),
        }
    }
}

impl PoseFit {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first field out of range, below `section`.
    pub fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("steps", f64::from(self.steps), 1.0..=1e5),
                ("rate", f64::from(self.rate), NOT_NEGATIVE),
                ("translation_rate", f64::from(self.translation_rate), NOT_NEGATIVE),
                ("decay", f64::from(self.decay), f64::MIN_POSITIVE..=1.0),
                ("most_degrees", self.most_degrees, f64::MIN_POSITIVE..=180.0),
                ("ssim", f64::from(self.ssim), SHARE),
                ("silhouette", f64::from(self.silhouette), NOT_NEGATIVE),
            ],
        )?;
        self.moments.check(&format!("{section}.moments"))
    }
}

/// A field, its value, and the values that it may have.
pub(crate) type Bound = (&'static str, f64, RangeInclusive<f64>);

/// The range of positive numbers.
pub(crate) const POSITIVE: RangeInclusive<f64> = f64::MIN_POSITIVE..=f64::MAX;
/// The range of numbers that are not negative.
pub(crate) const NOT_NEGATIVE: RangeInclusive<f64> = 0.0..=f64::MAX;
/// The range of shares.
pub(crate) const SHARE: RangeInclusive<f64> = 0.0..=1.0;

/// Refuses the first value out of its range; NaN is out of every range.
pub(crate) fn within(section: &str, bounds: &[Bound]) -> Result<(), Error> {
    let Some((field, value, range)) = bounds.iter().find(|(_, value, range)| !range.contains(value)) else {
        return Ok(());
    };
    let expected = match (*range.start(), *range.end()) {
        (f64::MIN_POSITIVE, f64::MAX) => "a finite number above 0".to_owned(),
        (low, f64::MAX) => format!("a finite number, at least {low}"),
        (f64::MIN_POSITIVE, high) => format!("above 0, at most {high}"),
        (low, high) => format!("{low} to {high}"),
    };
    let field = if section.is_empty() { (*field).to_owned() } else { format!("{section}.{field}") };
    Err(Error::invalid(field, value.to_string(), expected))
}

impl Clothing {
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("rounds", self.rounds as f64, 0.0..=100.0),
                ("reach", self.reach, 0.0..=1000.0),
                ("steps_per_pixel", self.steps_per_pixel, f64::MIN_POSITIVE..=100.0),
                ("most_facing", self.most_facing, f64::MIN_POSITIVE..=1.0),
                ("on_outline", self.on_outline, NOT_NEGATIVE),
                ("hidden", self.hidden, NOT_NEGATIVE),
                ("smoothness", self.smoothness, NOT_NEGATIVE),
                ("shrinkage", self.shrinkage, POSITIVE),
                ("smoothing_steps", self.smoothing_steps as f64, 0.0..=1e6),
            ],
        )
    }
}

impl Sighting {
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("facing_power", f64::from(self.facing_power), 0.0..=64.0),
                ("least_facing", self.least_facing, f64::MIN_POSITIVE..=1.0),
                ("oversampling", f64::from(self.oversampling), 1.0..=8.0),
                ("edge_radius", f64::from(self.edge_radius), 0.0..=64.0),
                ("depth_tolerance", self.depth_tolerance, NOT_NEGATIVE),
                ("beside_occluder", self.beside_occluder, SHARE),
                ("beside_outline", self.beside_outline, SHARE),
                ("full_coverage", f64::from(self.full_coverage), SHARE),
                ("least_coverage", f64::from(self.least_coverage), SHARE),
            ],
        )
    }
}

impl Cover {
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("most_frames", self.most_frames as f64, 1.0..=f64::MAX),
                ("robust_scale", self.robust_scale, POSITIVE),
                ("diffusion_steps", self.diffusion_steps as f64, 0.0..=1e6),
                ("most_divisions", f64::from(self.most_divisions), 0.0..=16.0),
                ("largest_aspect", self.largest_aspect, 1.0..=f64::MAX),
                ("least_sigma", self.least_sigma, POSITIVE),
                ("room_cone", self.room_cone, NOT_NEGATIVE),
                ("share_of_room", self.share_of_room, f64::MIN_POSITIVE..=1.0),
            ],
        )
    }
}

impl Moments {
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        let below_one = 0.0..=0.999_999_9;
        within(
            section,
            &[
                ("beta1", f64::from(self.beta1), below_one.clone()),
                ("beta2", f64::from(self.beta2), below_one),
                ("epsilon", f64::from(self.epsilon), NOT_NEGATIVE),
            ],
        )
    }
}

impl Schedule {
    pub(crate) fn check(&self, section: &str) -> Result<(), Error> {
        within(
            section,
            &[
                ("between_bindings", f64::from(self.between_bindings), 1.0..=f64::from(u32::MAX)),
                ("shape_share", self.shape_share, SHARE),
                ("most_shape_iterations", f64::from(self.most_shape_iterations), 1.0..=f64::from(u32::MAX)),
            ],
        )?;
        self.moments.check(&format!("{section}.moments"))
    }
}
