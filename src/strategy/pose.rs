//! Canonical avatar and posed body to [`Posed`], a chunk of Gaussians at a time.

use super::blend::Blend;
use super::bound::{BodyShape, Moves};
use super::covariance::factors;
use super::joints::Joints;
use super::layout::{Block, CHUNK, Chunk, LANES, Lanes};
use super::rotate::{BlockInput, Source, Turn, take, turn};
use super::{
    BoundAvatar, ColourChoice, CovarianceChoice, FaceFrame, LbsProjection, RotationChoice, Strategy,
    StrategyError, colour, face_frame,
};
use crate::math::Quaternion;
use crate::scene::{Posed, PosedBody};
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Poses an avatar.
///
/// Means: Eq. 6 (LBS) for Gaussians with weights of their own, except under dual-quaternion blending and HAHA's scaled
/// frames; `Σ b_k v_k + unit(Σ b_k n_k) offset` on the posed mesh for face-bound ones, under every strategy but the
/// latter. What a strategy does not need is not computed. The result is the same, bit
/// for bit, for any number of threads and any width of vector instructions.
///
/// # Errors
/// [`StrategyError::NoFaces`] if the strategy reads faces and the body has none, [`StrategyError::OtherBody`] if the
/// avatar was bound to a body of other counts.
pub fn pose<'a>(
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
) -> Result<Posed<'a>, StrategyError> {
    pose_on(pulp::Arch::new(), bound, body, strategy)
}

/// [`pose`] with the instructions of one kind of processor.
fn pose_on<'a>(
    arch: pulp::Arch,
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
) -> Result<Posed<'a>, StrategyError> {
    let shape = BodyShape::of(body.rest);
    if shape != bound.shape {
        let (found, expected) = (shape.to_string(), bound.shape.to_string());
        return Err(StrategyError::OtherBody { found, expected });
    }
    let needs_faces = strategy.rotation.needs_faces() || strategy.covariance == CovarianceChoice::Surfel;
    if needs_faces && bound.surface.is_none() && bound.moves != Moves::Not {
        return Err(StrategyError::NoFaces { strategy: strategy.to_string() });
    }
    let joints = Joints::new(body);
    let source = if reads_rotation(strategy) {
        Source::new(strategy.rotation, &joints, body, bound.surface.as_ref())
    } else {
        Source::Identity
    };
    let frame = Frame { bound, body, strategy, joints, source, arch };
    let produces = Produces::of(strategy, bound);
    let n = bound.len();
    let mut means = vec![Vec3::ZERO; n];
    let mut factors = vec![Mat3::ZERO; n];
    let mut rotations = produces.rotations.then(|| vec![[0.0; 4]; n]);
    let mut view_frames = produces.view_frames.then(|| vec![Mat3::ZERO; n]);
    let mut sh = produces.sh.then(|| vec![[0.0; 3]; bound.sh.len()]);
    let outputs = Outputs {
        means: &mut means,
        factors: &mut factors,
        rotations: rotations.as_deref_mut().unwrap_or_default(),
        view_frames: view_frames.as_deref_mut().unwrap_or_default(),
        sh: sh.as_deref_mut().unwrap_or_default(),
    };
    let parts = outputs.split(bound.sh_count());
    let chunks = bound.chunks(strategy.covariance).par_iter().zip(parts).enumerate();
    chunks.for_each(|(c, (chunk, outputs))| {
        PoseChunk { frame: &frame, chunk, start: c * CHUNK, outputs }.run();
    });
    Ok(Posed {
        means,
        factors,
        opacities: Cow::Borrowed(&bound.opacities),
        sh_degree: bound.sh_degree,
        sh: sh.map_or(Cow::Borrowed(&bound.sh), Cow::Owned),
        view_frames,
        colour_clamp: strategy.clamp.into(),
        rotations,
    })
}

/// False if nothing depends on R: not the means, not the covariance, not the colour.
fn reads_rotation(strategy: &Strategy) -> bool {
    let for_covariance = match strategy.covariance {
        CovarianceChoice::Rotate | CovarianceChoice::Surfel => true,
        CovarianceChoice::Affine | CovarianceChoice::AffineConjugate => false,
    };
    let for_colour = match strategy.colour {
        ColourChoice::RotateSh | ColourChoice::ViewRotation => true,
        ColourChoice::None | ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse => false,
    };
    let for_means = matches!(
        strategy.rotation,
        RotationChoice::DualQuaternion | RotationChoice::FaceFrame(FaceFrame::HahaScaled)
    );
    for_covariance || for_colour || for_means
}

/// Which of the optional outputs a strategy produces. Colours of degree 0 look the same from everywhere.
struct Produces {
    rotations: bool,
    view_frames: bool,
    sh: bool,
}

impl Produces {
    fn of(strategy: &Strategy, bound: &BoundAvatar) -> Self {
        let raw = strategy.rotation == RotationChoice::Lbs(LbsProjection::MatrixToQuaternionRaw);
        let rotations = match strategy.covariance {
            CovarianceChoice::Rotate | CovarianceChoice::Surfel => !raw,
            CovarianceChoice::Affine | CovarianceChoice::AffineConjugate => false,
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

/// What all chunks of a frame share.
struct Frame<'a> {
    bound: &'a BoundAvatar,
    body: &'a PosedBody<'a>,
    strategy: &'a Strategy,
    joints: Joints,
    source: Source<'a>,
    arch: pulp::Arch,
}

impl Frame<'_> {
    /// HAHA's k over its value at rest; 1 for static Gaussians and on faces without area in either pose.
    fn growth(&self, gaussian: usize) -> f32 {
        let Frame { bound, body, source, .. } = self;
        let (Some(surface), Source::Faces(turns)) = (&bound.surface, source) else { return 1.0 };
        if turns.of_gaussian(gaussian).is_none() {
            return 1.0;
        }
        let seat = &surface.seats[gaussian];
        let corners = seat.corners.map(|v| body.mesh().vertices[v as usize]);
        face_frame::haha_size(&corners) / surface.faces.sizes[seat.face as usize]
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
struct PoseChunk<'a, 'o> {
    frame: &'a Frame<'a>,
    chunk: &'a Chunk,
    /// Index of the first Gaussian.
    start: usize,
    outputs: Outputs<'o>,
}

/// The part of it that is compiled for each instruction set.
struct Blocks<'c, 'a, 'o> {
    job: &'c mut PoseChunk<'a, 'o>,
    /// R of each Gaussian, for the SH; empty if they stay.
    turns: &'c mut [Quaternion<f32>],
}

impl pulp::WithSimd for Blocks<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        for block in &self.job.chunk.blocks {
            self.job.block(block, self.turns);
        }
    }
}

impl PoseChunk<'_, '_> {
    /// Blocks are visited by joints; what streams through memory, SH and mesh, follows in the order of the Gaussians.
    fn run(mut self) {
        let frame = self.frame;
        let rotates_sh = !self.outputs.sh.is_empty();
        let mut turns = vec![[0.0; 4]; if rotates_sh { self.outputs.means.len() } else { 0 }];
        frame.arch.dispatch(Blocks { job: &mut self, turns: &mut turns });
        self.means_on_mesh();
        let (degree, count) = (frame.bound.sh_degree, frame.bound.sh_count());
        let input = frame.bound.sh[self.start * count..].chunks_exact(count);
        for ((turn, input), output) in turns.iter().zip(input).zip(self.outputs.sh.chunks_exact_mut(count)) {
            colour::rotate_sh(*turn, degree, input, output);
        }
    }

    #[inline(always)]
    fn block(&mut self, block: &Block, turns: &mut [Quaternion<f32>]) {
        let Frame { bound, strategy, joints, source, arch, .. } = self.frame;
        let (indices, weights) = self.chunk.influences(block);
        let blend = Blend::new(joints, indices, weights);
        let input = BlockInput { joints, chunk: self.chunk, block, start: self.start, blend: &blend };
        let turn = turn(*arch, source, &input);
        let mut scales = block.scales;
        if strategy.rotation == RotationChoice::FaceFrame(FaceFrame::HahaScaled) {
            self.scale_with_faces(block, &mut scales);
        }
        let factors = factors(strategy.covariance, &turn.posed, &blend, &block.rotations, &scales);
        let means = match (bound.moves, &turn.means) {
            (Moves::Not, _) | (Moves::WithFaces, _) => block.means,
            (Moves::ByWeights, Some(means)) => *means,
            (Moves::ByWeights, None) => blend.transform(&block.means),
        };
        self.store(block, &means, &factors, &turn, turns);
        if !self.outputs.view_frames.is_empty() {
            for lane in 0..block.count {
                let frame = colour::view_frame(strategy.colour, &turn.relative, &input, lane);
                self.outputs.view_frames[usize::from(block.index[lane])] = frame;
            }
        }
    }

    #[inline(always)]
    fn store(
        &mut self,
        block: &Block,
        means: &[Lanes; 3],
        factors: &[Lanes; 9],
        turn: &Turn,
        turns: &mut [Quaternion<f32>],
    ) {
        for lane in 0..block.count {
            let i = usize::from(block.index[lane]);
            self.outputs.means[i] = Vec3::new(means[0][lane], means[1][lane], means[2][lane]);
            let column = |c: usize| Vec3::new(factors[c][lane], factors[3 + c][lane], factors[6 + c][lane]);
            self.outputs.factors[i] = Mat3::from_cols(column(0), column(1), column(2));
            if let Some(rotation) = self.outputs.rotations.get_mut(i) {
                *rotation = take(&turn.posed, lane);
            }
            if let Some(relative) = turns.get_mut(i) {
                *relative = take(&turn.relative, lane);
            }
        }
    }

    /// Means that follow the mesh: those of face-bound Gaussians, and all under HAHA's scaled frames.
    fn means_on_mesh(&mut self) {
        let Frame { bound, body, strategy, source, .. } = self.frame;
        let scaled = strategy.rotation == RotationChoice::FaceFrame(FaceFrame::HahaScaled);
        let Some(surface) = &bound.surface else { return };
        if bound.moves != Moves::WithFaces && !scaled {
            return;
        }
        let mesh = body.mesh();
        let seats = &surface.seats[self.start..];
        if bound.moves == Moves::WithFaces {
            for (mean, seat) in self.outputs.means.iter_mut().zip(seats) {
                *mean = seat.point(&mesh.vertices, &mesh.normals);
            }
        }
        let (true, Source::Faces(turns)) = (scaled, source) else { return };
        for (i, (mean, seat)) in self.outputs.means.iter_mut().zip(seats).enumerate() {
            let gaussian = self.start + i;
            let Some([w, x, y, z]) = turns.of_gaussian(gaussian) else { continue };
            let corners = seat.corners.map(|v| mesh.vertices[v as usize]);
            let offset = bound.means[gaussian] - surface.faces.centroids[seat.face as usize];
            let turned = Quat::from_xyzw(x, y, z, w) * offset;
            *mean = face_frame::centroid(&corners) + turned * self.frame.growth(gaussian);
        }
    }

    #[inline(never)]
    fn scale_with_faces(&self, block: &Block, scales: &mut [Lanes; 3]) {
        for lane in 0..LANES {
            let growth = self.frame.growth(self.start + usize::from(block.index[lane]));
            scales.iter_mut().for_each(|axis| axis[lane] *= growth);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::PRESETS;
    use super::*;
    use crate::scene::{Avatar, Binding, Gaussians, Pose, RestBody, Skeleton, SkinWeights};
    use glam::DVec3;

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
            let narrow = pose_on(pulp::Arch::Scalar, &bound, &body, &preset.strategy).unwrap();
            assert_eq!(narrow, pose(&bound, &body, &preset.strategy).unwrap(), "{}", preset.id);
        }
    }
}
