//! Canonical avatar and posed body to [`Posed`], a chunk of Gaussians at a time.

use super::blend::Blend;
use super::bound::{BodyShape, Moves, Surface};
use super::covariance::{Canonical, factors};
use super::joints::Joints;
use super::layout::{Block, CHUNK, Chunk, LANES, Lanes};
use super::rotate::{BlockInput, Source, Turn, dual_means, take, turn};
use super::{
    BoundAvatar, ColourChoice, CovarianceChoice, FaceFrame, LbsProjection, RotationChoice, Strategy,
    StrategyError, colour, face_frame,
};
use crate::scene::{Posed, PosedBody};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Poses an avatar.
///
/// Means: Eq. 6 (LBS) for Gaussians with weights of their own, except under dual-quaternion blending and HAHA's scaled
/// frames; `Σ b_k v_k + unit(Σ b_k n_k) offset` on the posed mesh for face-bound ones, under every strategy but the
/// latter. What a strategy does not need is not computed. The result does not depend on the number of threads.
///
/// # Errors
/// [`StrategyError::NoFaces`] if the strategy reads faces and the body has none, [`StrategyError::OtherBody`] if the
/// avatar was bound to a body of other counts.
pub fn pose<'a>(
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
) -> Result<Posed<'a>, StrategyError> {
    let shape = BodyShape::of(body.rest);
    if shape != bound.shape {
        let (found, expected) = (shape.to_string(), bound.shape.to_string());
        return Err(StrategyError::OtherBody { found, expected });
    }
    let n = bound.len();
    let joints = Joints::new(body);
    let stays = bound.moves == Moves::Not;
    let no_faces = || StrategyError::NoFaces { strategy: strategy.to_string() };
    if strategy.covariance == CovarianceChoice::Surfel && bound.surface.is_none() && !stays {
        return Err(no_faces());
    }
    let source = match Source::new(strategy.rotation, &joints, body, bound.surface.as_ref()) {
        Some(source) => source,
        None if stays => Source::Dual,
        None => return Err(no_faces()),
    };
    let frame = Frame { bound, body, strategy, joints, source };

    let proper = matches!(strategy.covariance, CovarianceChoice::Rotate | CovarianceChoice::Surfel)
        && strategy.rotation != RotationChoice::Lbs(LbsProjection::MatrixToQuaternionRaw);
    let rotates_sh = strategy.colour == ColourChoice::RotateSh && bound.sh_degree > 0;
    let views = match strategy.colour {
        ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse | ColourChoice::ViewRotation => {
            bound.sh_degree > 0
        }
        ColourChoice::None | ColourChoice::RotateSh => false,
    };
    let mut means = vec![Vec3::ZERO; n];
    let mut factors = vec![Mat3::ZERO; n];
    let mut rotations = proper.then(|| vec![[0.0; 4]; n]);
    let mut view_frames = views.then(|| vec![Mat3::ZERO; n]);
    let mut sh = rotates_sh.then(|| vec![[0.0; 3]; bound.sh.len()]);
    let outputs = Outputs {
        means: &mut means,
        factors: &mut factors,
        rotations: rotations.as_deref_mut().unwrap_or_default(),
        view_frames: view_frames.as_deref_mut().unwrap_or_default(),
        sh: sh.as_deref_mut().unwrap_or_default(),
    };
    let arch = pulp::Arch::new();
    let parts = outputs.split(bound.sh_count());
    bound.chunks.par_iter().zip(parts).enumerate().for_each(|(c, (chunk, outputs))| {
        arch.dispatch(PoseChunk { arch, frame: &frame, chunk, start: c * CHUNK, outputs });
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

/// What all chunks of a frame share.
struct Frame<'a> {
    bound: &'a BoundAvatar,
    body: &'a PosedBody<'a>,
    strategy: &'a Strategy,
    joints: Joints,
    source: Source,
}

/// Where the results go. Parts that a strategy does not produce are empty.
struct Outputs<'o> {
    means: &'o mut [Vec3],
    factors: &'o mut [Mat3],
    rotations: &'o mut [[f32; 4]],
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

/// The work on one chunk, compiled for each instruction set.
struct PoseChunk<'a, 'o> {
    arch: pulp::Arch,
    frame: &'a Frame<'a>,
    chunk: &'a Chunk,
    start: usize,
    outputs: Outputs<'o>,
}

impl pulp::WithSimd for PoseChunk<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        for block in &self.chunk.blocks {
            self.block(block);
        }
    }
}

impl PoseChunk<'_, '_> {
    #[inline(always)]
    fn block(&mut self, block: &Block) {
        let Frame { bound, strategy, joints, source, .. } = self.frame;
        let (indices, weights) = self.chunk.influences(block);
        let blend = Blend::new(joints, indices, weights);
        let canonical = Canonical::new(strategy.covariance, block, self.start, bound.surface.as_ref());
        let input = BlockInput {
            joints,
            chunk: self.chunk,
            block,
            start: self.start,
            blend: &blend,
            canonical: &canonical.rotations,
        };
        let turn = turn(self.arch, source, &input);
        let (means, scales) = self.place(&input, canonical.scales);
        let factors = factors(strategy.covariance, &turn.posed, &blend, &canonical.rotations, &scales);
        self.store(block, &means, &factors, &turn, &blend);
    }

    /// Posed means, and the scales, which HAHA multiplies.
    #[inline(always)]
    fn place(&self, input: &BlockInput<'_>, mut scales: [Lanes; 3]) -> ([Lanes; 3], [Lanes; 3]) {
        let Frame { bound, strategy, source, .. } = self.frame;
        let mut means = match (bound.moves, source) {
            (Moves::Not, _) => input.block.means,
            (Moves::ByWeights, Source::Dual) => dual_means(input),
            (Moves::ByWeights, _) => input.blend.transform(&input.block.means),
            (Moves::WithFaces, _) => [[0.0; LANES]; 3],
        };
        let scaled = strategy.rotation == RotationChoice::FaceFrame(FaceFrame::HahaScaled);
        let surface = match &bound.surface {
            Some(surface) if bound.moves == Moves::WithFaces || scaled => surface,
            _ => return (means, scales),
        };
        self.place_on_mesh(input, surface, &mut means, &mut scales);
        (means, scales)
    }

    /// Means that follow the mesh.
    #[inline(never)]
    fn place_on_mesh(
        &self,
        input: &BlockInput<'_>,
        surface: &Surface,
        means: &mut [Lanes; 3],
        scales: &mut [Lanes; 3],
    ) {
        let Frame { bound, body, strategy, source, .. } = self.frame;
        let scaled = strategy.rotation == RotationChoice::FaceFrame(FaceFrame::HahaScaled);
        let mesh = body.mesh();
        for lane in 0..LANES {
            let gaussian = self.start + usize::from(input.block.index[lane]);
            let seat = &surface.seats[gaussian];
            let mut mean = if bound.moves == Moves::WithFaces {
                surface.point(seat, &mesh.vertices, &mesh.normals)
            } else {
                Vec3::new(means[0][lane], means[1][lane], means[2][lane])
            };
            if let (true, Source::Faces(turns)) = (scaled, source)
                && let Some([w, x, y, z]) = turns.of_gaussian(gaussian)
            {
                let face = seat.face as usize;
                let corners = surface.faces.corners[face].map(|v| mesh.vertices[v as usize]);
                let ratio = face_frame::haha_size(&corners) / surface.faces.sizes[face];
                let offset = bound.means[gaussian] - surface.faces.centroids[face];
                let turned = glam::Quat::from_xyzw(x, y, z, w) * offset;
                mean = face_frame::centroid(&corners) + turned * ratio;
                scales.iter_mut().for_each(|axis| axis[lane] *= ratio);
            }
            for axis in 0..3 {
                means[axis][lane] = mean[axis];
            }
        }
    }

    #[inline(always)]
    fn store(&mut self, block: &Block, means: &[Lanes; 3], factors: &[Lanes; 9], turn: &Turn, blend: &Blend) {
        let Frame { bound, strategy, .. } = self.frame;
        let sh_count = bound.sh_count();
        for lane in 0..block.count {
            let i = usize::from(block.index[lane]);
            self.outputs.means[i] = Vec3::new(means[0][lane], means[1][lane], means[2][lane]);
            let column = |c: usize| Vec3::new(factors[c][lane], factors[3 + c][lane], factors[6 + c][lane]);
            self.outputs.factors[i] = Mat3::from_cols(column(0), column(1), column(2));
            if let Some(rotation) = self.outputs.rotations.get_mut(i) {
                *rotation = take(&turn.posed, lane);
            }
            if let Some(frame) = self.outputs.view_frames.get_mut(i)
                && let Some(view) = colour::view_frame(strategy.colour, &turn.relative, blend, lane)
            {
                *frame = view;
            }
            if let Some(output) = self.outputs.sh.get_mut(i * sh_count..(i + 1) * sh_count) {
                let first = (self.start + i) * sh_count;
                let input = &bound.sh[first..first + sh_count];
                colour::rotate_sh(&turn.relative, lane, bound.sh_degree, input, output);
            }
        }
    }
}
