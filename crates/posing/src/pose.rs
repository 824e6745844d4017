//! Canonical avatar and posed body to [`Posed`], a chunk of Gaussians at a time.

use super::bound::{Moves, expect_count};
use super::covariance::factors;
use super::frame::{Frame, Visitor};
use super::layout::{CHUNK, Lanes};
use super::rotate::{BlockInput, Turn, take};
use super::{
    BoundAvatar, ColourChoice, CovarianceChoice, JointLift, LbsProjection, RotationChoice, Strategy,
    StrategyError, colour,
};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use skinsplat_core::math::{Quaternion, rotation};
use skinsplat_core::scene::{Camera, Posed, PosedBody};
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
    pose_on(pulp::Arch::new(), bound, body, strategy, &mut PoseBuffers::default())
}

/// [`pose`] into memory that a pose of before has left: at 100,000 Gaussians fresh memory costs as much as the work.
///
/// # Errors
/// As [`pose`]; the buffers are kept.
pub fn pose_into<'a>(
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
    buffers: &mut PoseBuffers,
) -> Result<Posed<'a>, StrategyError> {
    pose_on(pulp::Arch::new(), bound, body, strategy, buffers)
}

/// [`pose_into`] for one camera: Gaussians that it surely does not see are moved, but neither turned nor coloured. The
/// image has the same bits as that of [`pose`]. For Gaussians with weights of their own and covariances that are rotated;
/// others are posed in full.
///
/// # Errors
/// As [`pose`]; the buffers are kept.
pub fn pose_seen<'a>(
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
    camera: &Camera,
    buffers: &mut PoseBuffers,
) -> Result<Posed<'a>, StrategyError> {
    let frame = Frame::new(pulp::Arch::new(), bound, body, strategy, None)?.seen_by(camera);
    Ok(pose_frame(&frame, bound, buffers))
}

/// [`pose_into`] with the signs of a sequence: [`RotationChoice::LiftedSum`] reads `lift`, which is that of `body`, where
/// [`pose`] takes the one from rest. Other strategies have no use for it.
///
/// # Errors
/// As [`pose`], and [`StrategyError::Scene`] for a lift of another number of joints.
pub fn pose_lifted<'a>(
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
    lift: &JointLift,
    buffers: &mut PoseBuffers,
) -> Result<Posed<'a>, StrategyError> {
    expect_count("joint quaternions", lift.quaternions().len(), body.joints.len())?;
    let frame = Frame::new(pulp::Arch::new(), bound, body, strategy, Some(lift))?;
    Ok(pose_frame(&frame, bound, buffers))
}

/// Memory of poses that are no longer needed: [`pose_into`] takes it, [`PoseBuffers::reclaim`] gives it back.
#[derive(Debug, Default)]
pub struct PoseBuffers {
    means: Vec<Vec3>,
    factors: Vec<Mat3>,
    rotations: Vec<Quaternion<f32>>,
    view_frames: Vec<Mat3>,
    sh: Vec<[f32; 3]>,
}

impl PoseBuffers {
    /// Takes the memory of a pose. What it does not have (a strategy does not produce everything) is kept.
    pub fn reclaim(&mut self, posed: Posed<'_>) {
        self.means = posed.means;
        self.factors = posed.factors;
        if let Some(rotations) = posed.rotations {
            self.rotations = rotations;
        }
        if let Some(view_frames) = posed.view_frames {
            self.view_frames = view_frames;
        }
        if let Cow::Owned(sh) = posed.sh {
            self.sh = sh;
        }
    }
}

/// The memory, with `n` entries of any value.
fn sized<T: Clone>(memory: &mut Vec<T>, n: usize, zero: T) -> Vec<T> {
    let mut memory = std::mem::take(memory);
    memory.resize(n, zero);
    memory
}

/// [`pose_into`] with the instructions of one kind of processor.
fn pose_on<'a>(
    arch: pulp::Arch,
    bound: &'a BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
    buffers: &mut PoseBuffers,
) -> Result<Posed<'a>, StrategyError> {
    Ok(pose_frame(&Frame::new(arch, bound, body, strategy, None)?, bound, buffers))
}

/// Walks all blocks of a frame of `bound`.
fn pose_frame<'a>(frame: &Frame<'_>, bound: &'a BoundAvatar, buffers: &mut PoseBuffers) -> Posed<'a> {
    let strategy = frame.strategy;
    let produces = Produces::of(strategy, bound);
    let n = bound.len();
    let mut means = sized(&mut buffers.means, n, Vec3::ZERO);
    let mut factors = sized(&mut buffers.factors, n, Mat3::ZERO);
    let mut rotations = produces.rotations.then(|| sized(&mut buffers.rotations, n, [0.0; 4]));
    let mut view_frames = produces.view_frames.then(|| sized(&mut buffers.view_frames, n, Mat3::ZERO));
    let mut sh = produces.sh.then(|| sized(&mut buffers.sh, bound.sh.len(), [0.0; 3]));
    let outputs = Outputs {
        means: &mut means,
        factors: &mut factors,
        rotations: rotations.as_deref_mut().unwrap_or_default(),
        view_frames: view_frames.as_deref_mut().unwrap_or_default(),
        sh: sh.as_deref_mut().unwrap_or_default(),
    };
    let parts = outputs.split(bound.sh_count());
    parts.into_par_iter().enumerate().for_each(|(c, outputs)| {
        PoseChunk { frame, start: c * CHUNK, outputs, turns: Vec::new() }.run(c);
    });
    Posed {
        means,
        factors,
        opacities: Cow::Borrowed(&bound.opacities),
        sh_degree: bound.sh_degree,
        sh: sh.map_or(Cow::Borrowed(&bound.sh), Cow::Owned),
        view_frames,
        colour_clamp: strategy.clamp.into(),
        rotations,
    }
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
    turns: Vec<Quaternion<f32>>,
}

impl PoseChunk<'_, '_, '_> {
    /// Blocks are visited by joints; what streams through memory, SH and mesh, follows in the order of the Gaussians.
    fn run(mut self, number: usize) {
        let (frame, start) = (self.frame, self.start);
        if !self.outputs.sh.is_empty() {
            self.turns.resize(self.outputs.means.len(), [0.0; 4]);
        }
        let chunk = &frame.bound.chunks(frame.strategy.covariance)[number];
        frame.walk(chunk, start, &mut self);
        self.means_on_mesh();
        let (degree, count) = (frame.bound.sh_degree, frame.bound.sh_count());
        let input = frame.bound.sh[start * count..].chunks_exact(count);
        for ((turn, input), output) in
            self.turns.iter().zip(input).zip(self.outputs.sh.chunks_exact_mut(count))
        {
            if *turn != [0.0; 4] {
                colour::rotate_sh(*turn, degree, input, output);
            }
        }
    }

    /// Means that follow the mesh: those of face-bound Gaussians, and all under HAHA's scaled frames.
    fn means_on_mesh(&mut self) {
        let Frame { bound, body, .. } = self.frame;
        let Some(surface) = &bound.surface else { return };
        let on_faces = bound.moves == Moves::WithFaces;
        if !on_faces && !self.frame.scales_with_faces() {
            return;
        }
        let mesh = body.mesh();
        let seats = &surface.seats[self.start..];
        for (i, (mean, seat)) in self.outputs.means.iter_mut().zip(seats).enumerate() {
            let gaussian = self.start + i;
            if let Some(motion) = self.frame.face_motion(gaussian) {
                *mean = motion.apply(bound.means[gaussian]);
            } else if on_faces {
                *mean = seat.point(mesh);
            }
        }
    }
}

impl Visitor for PoseChunk<'_, '_, '_> {
    #[inline(always)]
    fn block(&mut self, _: usize, input: &BlockInput<'_>, turn: &Turn, scales: &[Lanes; 3]) {
        let Frame { bound, strategy, .. } = self.frame;
        let block = input.block;
        let factors = factors(strategy.covariance, &turn.posed, input.blend, &block.rotations, scales);
        let means = match (bound.moves, &turn.means) {
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
                *rotation = take(&turn.posed, lane);
            }
            if let Some(relative) = self.turns.get_mut(i) {
                *relative = take(&turn.relative, lane);
            }
        }
        if !outputs.view_frames.is_empty() {
            for lane in 0..block.count {
                let frame = colour::view_frame(strategy.colour, &turn.relative, input, lane);
                outputs.view_frames[usize::from(block.index[lane])] = frame;
            }
        }
    }

    /// What is left of a Gaussian that is not drawn has a place and no extent.
    #[inline(always)]
    fn unseen(&mut self, input: &BlockInput<'_>, means: &[Lanes; 3]) {
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
    use super::super::adjoint::backward_on;
    use super::*;
    use glam::DVec3;
    use skinsplat_core::scene::{
        Avatar, AvatarGradient, Binding, Gaussians, Pose, PosedGradient, RestBody, Skeleton, SkinWeights,
    };

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
            let narrow =
                pose_on(pulp::Arch::Scalar, &bound, &body, &preset.strategy, &mut PoseBuffers::default())
                    .unwrap();
            assert_eq!(narrow, pose(&bound, &body, &preset.strategy).unwrap(), "{}", preset.id);

            // The pose serves as its own derivative.
            let upstream = PosedGradient {
                means: narrow.means,
                factors: narrow.factors,
                opacities: narrow.opacities.into_owned(),
                sh: narrow.sh.into_owned(),
                ..PosedGradient::default()
            };
            let [narrow, wide] = [pulp::Arch::Scalar, pulp::Arch::new()].map(|arch| {
                let mut gradient = AvatarGradient::default();
                let gaussians = &avatar.gaussians;
                gradient.reset(gaussians, false);
                let strategy = &preset.strategy;
                backward_on(arch, &bound, &body, strategy, gaussians, &upstream, &mut gradient).unwrap();
                gradient
            });
            assert_eq!(narrow, wide, "{}", preset.id);
        }
    }
}
