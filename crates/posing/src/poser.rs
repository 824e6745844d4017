//! Canonical avatar and posed body to [`Posed`], a chunk of Gaussians at a time, in memory that is kept.

use super::adjoint;
use super::bound::Moves;
use super::covariance::{self, factors};
use super::frame::{Frame, Visitor};
use super::lanes::{Lanes, take};
use super::layout::CHUNK;
use super::options::{Gradients, PoseOptions};
use super::rotate::{BlockInput, Rotated};
use super::{BoundAvatar, ColourChoice, CovarianceChoice, PosingError, Strategy, colour};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use skinsplat_core::math::{Quaternion, rotation};
use skinsplat_core::scene::{Gaussians, OwnedPosed, Posed, PosedBody, PosedGradient};

/// Poses avatars, and owns the memory of the last pose: at 100,000 Gaussians fresh memory costs as much as the work.
#[derive(Debug)]
pub struct Poser {
    arch: pulp::Arch,
    means: Vec<Vec3>,
    factors: Vec<Mat3>,
    rotations: Vec<Quaternion<f32>>,
    view_frames: Vec<Mat3>,
    sh: Vec<[f32; 3]>,
}

impl Default for Poser {
    fn default() -> Self {
        Self::new()
    }
}

impl Poser {
    /// One without memory yet, for the vector instructions of [`skinsplat_simd::arch`].
    pub fn new() -> Self {
        Self::on(skinsplat_simd::arch())
    }

    /// With the instructions of one kind of processor.
    fn on(arch: pulp::Arch) -> Self {
        let (means, factors, rotations, view_frames, sh) = Default::default();
        Self { arch, means, factors, rotations, view_frames, sh }
    }

    /// Poses an avatar.
    ///
    /// Means: Eq. 6 (LBS) for Gaussians with weights of their own, except under dual-quaternion blending and HAHA's scaled
    /// frames; `Σ b_k v_k + unit(Σ b_k n_k) offset` on the posed mesh for face-bound ones, under every strategy but the
    /// latter. Where joints scale, by one factor s_j each, standard deviations and offsets are multiplied by Σ w_j s_j
    /// (covariances that B deforms and faces that scale follow anyway); of unequal factors the geometric mean counts, see
    /// [`Strategy::ignored_scale`]. What a strategy does not need is not computed. The result is the same, bit for bit, for any number of
    /// threads and any width of vector instructions.
    ///
    /// # Errors
    /// [`PosingError::NoFaces`] if the strategy reads faces and the body has none, [`PosingError::OtherBody`] if the avatar
    /// was bound to a body of other counts, [`PosingError::Scene`] for a lift of another number of joints and rotations of
    /// another number of Gaussians.
    pub fn pose<'p>(
        &'p mut self,
        bound: &'p BoundAvatar,
        body: &PosedBody<'_>,
        strategy: &Strategy,
        options: &PoseOptions<'_>,
    ) -> Result<Posed<'p>, PosingError> {
        let frame = Frame::new(self.arch, bound, body, strategy, options)?;
        let produces = Produces::of(&frame);
        let parts = self.outputs(bound, &produces).split(bound.sh_count());
        parts.into_par_iter().enumerate().for_each(|(number, outputs)| {
            let (relative, growth) = Default::default();
            PoseChunk { frame: &frame, start: number * CHUNK, outputs, relative, growth }.run(number);
        });
        Ok(Posed {
            means: &self.means,
            factors: &self.factors,
            opacities: &bound.opacities,
            sh_degree: bound.sh_degree,
            sh: if produces.sh { &self.sh } else { &bound.sh },
            view_frames: produces.view_frames.then_some(self.view_frames.as_slice()),
            colour_clamp: strategy.clamp.into(),
            rotations: produces.rotations.then_some(self.rotations.as_slice()),
        })
    }

    /// Adds to the gradients what a pose contributes, so that the frames of a batch sum in the order of the calls: the
    /// transposed derivative of [`Self::pose`] applied to `upstream`. `gaussians` are those that `bound` was made of or
    /// last updated with, read only if the avatar's gradient is asked for; `into` is an [`AvatarGradient`](skinsplat_core::scene::AvatarGradient) that [`reset`](skinsplat_core::scene::AvatarGradient::reset) made for them, or [`Gradients`]. A
    /// camera in the options changes nothing: what it does not see has no derivatives.
    ///
    /// Exact for every strategy, piecewise where a strategy chooses (the branch of a matrix-to-quaternion conversion, the
    /// thin axis of a disc, the side that a quaternion is brought to). Dependencies that are left out, as the stock methods
    /// leave them out:
    /// * barycentric coordinates move the position only, neither the skinning weights mixed with them nor a vertex average;
    /// * frames in which view directions are read do not follow parameters of the avatar (only those of a conversion of B R_c
    ///   could); they do follow the body;
    /// * the body is not followed through rotations that were given, nor where a strategy falls back on another because what
    ///   it reads is degenerate (a face without area, a tie of the average, a blend that vanishes); how large joints are is a
    ///   constant.
    ///
    /// The result is the same, bit for bit, for any number of threads and any width of vector instructions.
    ///
    /// # Errors
    /// Those of [`Self::pose`], and [`PosingError::Scene`] for arrays whose length does not fit the bound avatar or the body.
    /// Nothing was added then.
    pub fn backward<'g>(
        &mut self,
        bound: &BoundAvatar,
        body: &PosedBody<'_>,
        strategy: &Strategy,
        options: &PoseOptions<'_>,
        gaussians: &Gaussians,
        upstream: &PosedGradient,
        into: impl Into<Gradients<'g>>,
    ) -> Result<(), PosingError> {
        let options = PoseOptions { seen_by: None, ..*options };
        let frame = Frame::new(self.arch, bound, body, strategy, &options)?;
        adjoint::add(&frame, gaussians, upstream, into.into())
    }

    /// The memory, with an entry of any value for everything that is produced.
    fn outputs(&mut self, bound: &BoundAvatar, produces: &Produces) -> Outputs<'_> {
        let n = bound.len();
        let count = |produced, count| if produced { count } else { 0 };
        self.means.resize(n, Vec3::ZERO);
        self.factors.resize(n, Mat3::ZERO);
        self.rotations.resize(count(produces.rotations, n), [0.0; 4]);
        self.view_frames.resize(count(produces.view_frames, n), Mat3::ZERO);
        self.sh.resize(count(produces.sh, bound.sh.len()), [0.0; 3]);
        Outputs {
            means: &mut self.means,
            factors: &mut self.factors,
            rotations: &mut self.rotations,
            view_frames: &mut self.view_frames,
            sh: &mut self.sh,
        }
    }
}

/// One pose, to keep: [`Poser::pose`] without options, in memory of its own.
///
/// # Errors
/// As [`Poser::pose`].
pub fn pose(
    bound: &BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
) -> Result<OwnedPosed, PosingError> {
    let mut poser = Poser::new();
    poser.pose(bound, body, strategy, &PoseOptions::default()).map(Posed::into_owned)
}

/// Which of the optional outputs a strategy produces. Colours of degree 0 look the same from everywhere.
struct Produces {
    rotations: bool,
    view_frames: bool,
    sh: bool,
}

impl Produces {
    fn of(Frame { bound, strategy, source, .. }: &Frame<'_>) -> Self {
        let rotations = match strategy.covariance {
            CovarianceChoice::Rotate | CovarianceChoice::Surfel => !source.is_raw(),
            CovarianceChoice::RotateByAverage => true,
            CovarianceChoice::Affine
            | CovarianceChoice::AffineConjugate
            | CovarianceChoice::PushForward
            | CovarianceChoice::PushForwardNormal => false,
        };
        let (view_frames, sh) = match strategy.colour {
            ColourChoice::None => (false, false),
            ColourChoice::RotateSh => (false, true),
            ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse | ColourChoice::ViewRotation => {
                (true, false)
            }
        };
        let seen = bound.sh_degree > 0;
        Self { rotations, view_frames: view_frames && seen, sh: sh && seen }
    }
}

/// Where the results go. Parts that a strategy does not produce are empty.
struct Outputs<'o> {
    means: &'o mut [Vec3],
    factors: &'o mut [Mat3],
    rotations: &'o mut [Quaternion<f32>],
    view_frames: &'o mut [Mat3],
    sh: &'o mut [[f32; 3]],
}

impl<'o> Outputs<'o> {
    /// The parts of consecutive chunks.
    fn split(self, sh_count: usize) -> Vec<Self> {
        let mut rotations = self.rotations.chunks_mut(CHUNK);
        let mut view_frames = self.view_frames.chunks_mut(CHUNK);
        let mut sh = self.sh.chunks_mut(CHUNK * sh_count);
        let means = self.means.chunks_mut(CHUNK).zip(self.factors.chunks_mut(CHUNK));
        means
            .map(|(means, factors)| Self {
                means,
                factors,
                rotations: rotations.next().unwrap_or_default(),
                view_frames: view_frames.next().unwrap_or_default(),
                sh: sh.next().unwrap_or_default(),
            })
            .collect()
    }
}

/// The work on one chunk.
struct PoseChunk<'f, 'a, 'o> {
    frame: &'f Frame<'a>,
    /// Index of the first Gaussian.
    start: usize,
    outputs: Outputs<'o>,
    /// R of each Gaussian, for the SH, zero for one that is not seen; empty if they stay.
    relative: Vec<Quaternion<f32>>,
    /// By how much each Gaussian grows; empty unless joints scale and offsets follow.
    growth: Vec<f32>,
}

impl PoseChunk<'_, '_, '_> {
    /// Blocks are visited by joints; what streams through memory, SH and mesh, follows in the order of the Gaussians.
    fn run(mut self, number: usize) {
        let (frame, start) = (self.frame, self.start);
        if !self.outputs.sh.is_empty() {
            self.relative.resize(self.outputs.means.len(), [0.0; 4]);
        }
        if frame.offsets_grow() {
            self.growth.resize(self.outputs.means.len(), 1.0);
        }
        let chunk = &frame.bound.chunks(frame.strategy.covariance)[number];
        frame.walk(chunk, start, &mut self);
        self.means_on_mesh();
        let (degree, count) = (frame.bound.sh_degree, frame.bound.sh_count());
        let input = frame.bound.sh[start * count..].chunks_exact(count);
        let output = self.outputs.sh.chunks_exact_mut(count);
        for ((quat, input), output) in self.relative.iter().zip(input).zip(output) {
            if *quat != [0.0; 4] {
                colour::rotate_sh(*quat, degree, input, output);
            }
        }
    }

    /// Means that follow the mesh: those of face-bound Gaussians, and all under HAHA's scaled frames.
    fn means_on_mesh(&mut self) {
        let Frame { bound, body, .. } = self.frame;
        let Some(surface) = &bound.surface else { return };
        let on_faces = bound.moves == Moves::WithFaces;
        if !on_faces && self.frame.source.scaled_faces().is_none() {
            return;
        }
        let mesh = body.mesh();
        let embeddings = &surface.embeddings[self.start..];
        for (i, (mean, embedding)) in self.outputs.means.iter_mut().zip(embeddings).enumerate() {
            let gaussian = self.start + i;
            if let Some(motion) = self.frame.face_motion(gaussian) {
                *mean = motion.apply(bound.means[gaussian]);
            } else if on_faces {
                let growth = self.growth.get(i).copied().unwrap_or(1.0);
                *mean = embedding.grown(growth).point(mesh);
            }
        }
    }
}

impl Visitor for PoseChunk<'_, '_, '_> {
    #[inline(always)]
    fn block(&mut self, _: usize, input: &BlockInput<'_>, rotated: &Rotated, scales: &[Lanes; 3]) {
        let Frame { bound, strategy, .. } = self.frame;
        let block = input.block;
        let map = covariance::deforming(strategy.covariance, input);
        let factors = factors(strategy.covariance, &rotated.posed, map, &block.rotations, scales);
        let means = match (bound.moves, &rotated.means) {
            (Moves::Not | Moves::WithFaces, _) => block.means,
            (Moves::ByWeights, Some(means)) => *means,
            (Moves::ByWeights, None) => input.blend.transform(&block.means),
        };
        let outputs = &mut self.outputs;
        for lane in 0..block.count {
            let i = usize::from(block.index[lane]);
            outputs.means[i] = Vec3::new(means[0][lane], means[1][lane], means[2][lane]);
            let column = |c: usize| Vec3::new(factors[c][lane], factors[3 + c][lane], factors[6 + c][lane]);
            outputs.factors[i] = Mat3::from_cols(column(0), column(1), column(2));
            if let Some(rotation) = outputs.rotations.get_mut(i) {
                *rotation = take(&rotated.posed, lane);
            }
            if let Some(relative) = self.relative.get_mut(i) {
                *relative = take(&rotated.relative, lane);
            }
        }
        if let (false, Some(growth)) = (self.growth.is_empty(), input.growth()) {
            for lane in 0..block.count {
                self.growth[usize::from(block.index[lane])] = growth[lane];
            }
        }
        if !outputs.view_frames.is_empty() {
            for lane in 0..block.count {
                let frame = colour::view_frame(strategy.colour, &rotated.relative, input, lane);
                outputs.view_frames[usize::from(block.index[lane])] = frame;
            }
        }
    }

    /// What is left of a Gaussian that is not drawn has a place and no extent.
    #[inline(always)]
    fn culled(&mut self, input: &BlockInput<'_>, means: &[Lanes; 3]) {
        let outputs = &mut self.outputs;
        for lane in 0..input.block.count {
            let i = usize::from(input.block.index[lane]);
            outputs.means[i] = Vec3::new(means[0][lane], means[1][lane], means[2][lane]);
            outputs.factors[i] = Mat3::ZERO;
            if let Some(rotation) = outputs.rotations.get_mut(i) {
                *rotation = rotation::identity();
            }
            if let Some(frame) = outputs.view_frames.get_mut(i) {
                *frame = Mat3::IDENTITY;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::PRESETS;
    use super::*;
    use glam::DVec3;
    use skinsplat_core::scene::{Avatar, AvatarGradient, Binding, Pose, RestBody, Skeleton, SkinWeights};

    /// A fan of triangles over a chain of six joints, and a Gaussian per vertex that hangs on one to six of them.
    fn fan() -> (RestBody, Avatar) {
        let chain: Vec<DVec3> = (0..6).map(|j| DVec3::X * f64::from(j)).collect();
        let parents = (0..6).map(|j: usize| j.checked_sub(1)).collect();
        let skeleton = Skeleton::from_joint_positions(vec![String::new(); 6], parents, &chain).unwrap();
        let wave = |i: u32, k: u32| f64::from(i * k + k).sin();
        let vertices: Vec<DVec3> = (0..90).map(|i| DVec3::new(wave(i, 3), wave(i, 5), wave(i, 7))).collect();
        let row = |i: usize| {
            let sum = (0..=i % 6).map(|j| 1.0 + j as f32).sum::<f32>();
            (0..=i % 6).map(move |j| (j, (1.0 + j as f32) / sum))
        };
        let weights = SkinWeights::from_rows((0..90).map(row), 6).unwrap();
        let gaussians = Gaussians {
            means: vertices.iter().map(|v| v.as_vec3()).collect(),
            rotations: (0..90)
                .map(|i| [wave(i, 2) as f32, wave(i, 4) as f32, wave(i, 6) as f32, 0.3])
                .collect(),
            log_scales: vertices.iter().map(|v| v.as_vec3() - 3.0).collect(),
            opacity_logits: vec![0.0; 90],
            sh_degree: 3,
            sh: (0..90 * 16).map(|i| [wave(i, 11) as f32, 0.5, wave(i, 13) as f32]).collect(),
        };
        let binding = Binding::Vertex(weights.clone());
        let faces = (1..89).map(|i| [0, i, i + 1]).collect();
        let body = RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() };
        (body, Avatar { gaussians, binding })
    }

    #[test]
    fn every_processor_computes_the_same_bits() {
        let (body, avatar) = fan();
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let angles: Vec<DVec3> = (0..6).map(|j| DVec3::new(0.3, f64::from(j).sin(), -0.5)).collect();
        let at = Pose::from_axis_angles(&body.skeleton, &angles, DVec3::Z);
        let body = PosedBody::new(&body, &at).unwrap();
        for preset in PRESETS {
            let (strategy, options) = (&preset.strategy, PoseOptions::default());
            let mut posers = [pulp::Arch::Scalar, skinsplat_simd::arch()].map(Poser::on);
            let narrow = posers[0].pose(&bound, &body, strategy, &options).unwrap().into_owned();
            assert_eq!(narrow, pose(&bound, &body, strategy).unwrap(), "{}", preset.id);

            // The pose serves as its own derivative.
            let upstream = PosedGradient {
                means: narrow.means,
                factors: narrow.factors,
                opacities: narrow.opacities,
                sh: narrow.sh,
                ..PosedGradient::default()
            };
            let [narrow, wide] = posers.each_mut().map(|poser| {
                let mut gradient = AvatarGradient::default();
                let gaussians = &avatar.gaussians;
                gradient.reset(gaussians, false);
                poser
                    .backward(&bound, &body, strategy, &options, gaussians, &upstream, &mut gradient)
                    .unwrap();
                gradient
            });
            assert_eq!(narrow, wide, "{}", preset.id);
        }
    }
}
