//! An avatar in one pose, walked block by block: what posing and its adjoint share.

use super::blend::Blend;
use super::bound::Moves;
use super::error::expect_count;
use super::face_frame;
use super::frustum::Frustum;
use super::joints::Joints;
use super::lanes::{LANES, Lanes};
use super::layout::{CHUNK, Chunk};
use super::options::PoseOptions;
use super::push_forward::{Derivative, Tangents};
use super::rotate::{BlockInput, Rotated, Source, rotate, rotate_by_average};
use super::{Across, BoundAvatar, ColourChoice, CovarianceChoice, PosingError, Strategy};
use glam::{Quat, Vec3};
use skinsplat_core::math::{Quaternion, dot4};
use skinsplat_core::scene::{Camera, PosedBody, SceneError};

/// How far the squared length of a given quaternion may be from 1.
const UNIT_TOLERANCE: f32 = 1e-3;

/// What all chunks of a frame share.
pub(super) struct Frame<'a> {
    pub(super) bound: &'a BoundAvatar,
    pub(super) body: &'a PosedBody<'a>,
    pub(super) strategy: &'a Strategy,
    pub(super) joints: Joints,
    pub(super) source: Source<'a>,
    /// That of the only camera that will look, if what it does not see may be left out.
    frustum: Option<Frustum>,
    pub(super) arch: pulp::Arch,
    /// Of each chunk, where the strategy reads the derivative of LBS.
    pub(super) tangents: Option<&'a [Tangents]>,
    /// It also reads that with the normal carried.
    with_normal: bool,
}

/// What a walk does with each block.
pub(super) trait Visitor {
    /// `rotated` and `scales` (standard deviations) are those of the block at that position in its chunk. To be inlined, so
    /// that it is compiled for each instruction set.
    fn block(&mut self, position: usize, input: &BlockInput<'_>, rotated: &Rotated, scales: &[Lanes; 3]);

    /// In place of [`Visitor::block`] for one that the camera of the options does not see. Nothing is to be done by
    /// visitors of frames without a camera.
    fn culled(&mut self, _: &BlockInput<'_>, _: &[Lanes; 3]) {}
}

impl<'a> Frame<'a> {
    /// Everything that is computed once per pose.
    pub(super) fn new(
        arch: pulp::Arch,
        bound: &'a BoundAvatar,
        body: &'a PosedBody<'a>,
        strategy: &'a Strategy,
        options: &PoseOptions<'a>,
    ) -> Result<Self, PosingError> {
        bound.check_body(body)?;
        let reads_faces = options.rotations.is_none() && strategy.rotation.needs_faces();
        let [of_rotation, of_covariance] = strategy.across();
        let across = [of_rotation.filter(|_| options.rotations.is_none()), of_covariance];
        let pushes = across.iter().any(Option::is_some);
        let needs_faces = reads_faces || pushes || strategy.covariance == CovarianceChoice::Surfel;
        if needs_faces && bound.surface.is_none() && bound.moves != Moves::Not {
            return Err(PosingError::NoFaces { strategy: strategy.to_string() });
        }
        if let Some(lift) = options.lift {
            expect_count("joint quaternions", lift.quaternions().len(), body.joints.len())?;
        }
        let joints = Joints::new(body);
        let source = match options.rotations {
            Some(rotations) => {
                check_rotations(rotations, bound.len())?;
                Source::given(rotations)
            }
            None if reads_rotation(strategy) => {
                Source::new(strategy.rotation, &joints, body, bound.surface.as_ref(), options.lift)
            }
            None => Source::Identity,
        };
        let tangents = if pushes { bound.tangents(body.rest) } else { None };
        let with_normal = across.contains(&Some(Across::Normal));
        let frame =
            Self { bound, body, strategy, joints, source, frustum: None, arch, tangents, with_normal };
        Ok(Self { frustum: options.seen_by.and_then(|camera| frame.frustum_of(camera)), ..frame })
    }

    /// What a camera sees, where that is known before Gaussians are rotated: they move by their weights and keep their
    /// size.
    fn frustum_of(&self, camera: &Camera) -> Option<Frustum> {
        let follows_weights = self.bound.moves == Moves::ByWeights && !self.source.moves_means();
        let rotates = self.strategy.covariance == CovarianceChoice::Rotate && !self.source.is_raw();
        let keeps_size = rotates && self.joints.scale.is_none();
        (follows_weights && keeps_size).then(|| Frustum::new(camera))
    }

    /// Visits the blocks of a chunk, whose first Gaussian has index `start`, with the instructions of this processor.
    pub(super) fn walk(&self, chunk: &Chunk, start: usize, visitor: &mut impl Visitor) {
        self.arch.dispatch(Walk { frame: self, chunk, start, visitor });
    }

    /// True if Gaussians on faces stand off further where joints scale.
    pub(super) fn offsets_grow(&self) -> bool {
        self.bound.moves == Moves::WithFaces && self.joints.scale.is_some()
    }

    /// How the mean of a Gaussian moves under HAHA's scaled frames; `None` under other strategies, for static Gaussians
    /// and on faces without area in either pose.
    pub(super) fn face_motion(&self, gaussian: usize) -> Option<FaceMotion> {
        let (surface, faces) = (self.bound.surface.as_ref()?, self.source.scaled_faces()?);
        let [w, x, y, z] = faces.of_gaussian(gaussian)?;
        let embedding = &surface.embeddings[gaussian];
        let corners = embedding.corners.map(|v| self.body.mesh().vertices[v as usize]);
        Some(FaceMotion {
            from: surface.faces.centroids[embedding.face as usize],
            to: face_frame::centroid(&corners),
            rotation: Quat::from_xyzw(x, y, z, w),
            growth: face_frame::haha_size(&corners) / surface.faces.sizes[embedding.face as usize],
        })
    }

    #[inline(never)]
    fn grown(&self, input: &BlockInput<'_>) -> [Lanes; 3] {
        let mut scales = input.block.scales;
        for lane in 0..LANES {
            let growth = self.face_motion(input.gaussian(lane)).map_or(1.0, |motion| motion.growth);
            scales.iter_mut().for_each(|axis| axis[lane] *= growth);
        }
        scales
    }
}

/// A similarity: from the centroid of the rest face to that of the posed one, turned and grown.
pub(super) struct FaceMotion {
    from: Vec3,
    to: Vec3,
    rotation: Quat,
    /// HAHA's k over its value at rest.
    growth: f32,
}

impl FaceMotion {
    pub(super) fn apply(&self, point: Vec3) -> Vec3 {
        self.to + self.rotation * (point - self.from) * self.growth
    }

    /// The derivatives with respect to a further rotation and to the growth; that with respect to the posed centroid is the
    /// gradient itself.
    pub(super) fn motion_adjoint(&self, point: Vec3, gradient: Vec3) -> (Vec3, f32) {
        let turned = self.rotation * (point - self.from);
        ((turned * self.growth).cross(gradient), turned.dot(gradient))
    }

    /// By how much a Gaussian grows.
    pub(super) fn growth(&self) -> f32 {
        self.growth
    }

    /// The derivative with respect to the point.
    pub(super) fn adjoint(&self, gradient: Vec3) -> Vec3 {
        self.rotation.conjugate() * gradient * self.growth
    }
}

struct Walk<'w, 'a, V> {
    frame: &'w Frame<'a>,
    chunk: &'w Chunk,
    start: usize,
    visitor: &'w mut V,
}

impl<V: Visitor> pulp::WithSimd for Walk<'_, '_, V> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { frame, chunk, start, visitor } = self;
        let tangents = frame.tangents.map(|tangents| &tangents[start / CHUNK]);
        for (position, block) in chunk.blocks.iter().enumerate() {
            let (indices, weights) = chunk.influences(block);
            let blend = Blend::new(&frame.joints, indices, weights);
            let jacobian = tangents.map(|tangents| {
                let of_block = Derivative { joints: &frame.joints, chunk, position, tangents, blend: &blend };
                of_block.jacobian(frame.arch, frame.with_normal)
            });
            let (joints, jacobian) = (&frame.joints, jacobian.as_ref());
            let input = BlockInput { joints, chunk, block, start, blend: &blend, jacobian };
            if let Some(means) = frame.frustum.as_ref().and_then(|frustum| frustum.culls(block, &blend)) {
                visitor.culled(&input, &means);
                continue;
            }
            let mut rotated = rotate(frame.arch, &frame.source, &input);
            if frame.strategy.covariance == CovarianceChoice::RotateByAverage {
                rotate_by_average(frame.arch, &input, &mut rotated);
            }
            let scales = match (frame.source.scaled_faces(), &frame.joints.scale) {
                (Some(_), _) => frame.grown(&input),
                (None, Some(_)) if frame.strategy.covariance.keeps_shape() => grown_with_joints(&input),
                (None, _) => block.scales,
            };
            visitor.block(position, &input, &rotated, &scales);
        }
    }
}

/// The scales of a block whose joints scale.
#[inline(never)]
fn grown_with_joints(input: &BlockInput<'_>) -> [Lanes; 3] {
    let mut scales = input.block.scales;
    if let Some(growth) = input.growth() {
        for lane in 0..LANES {
            scales.iter_mut().for_each(|axis| axis[lane] *= growth[lane]);
        }
    }
    scales
}

/// That there is a unit quaternion for each of n Gaussians.
fn check_rotations(rotations: &[Quaternion<f32>], n: usize) -> Result<(), SceneError> {
    expect_count("rotations", rotations.len(), n)?;
    let off = |q: &Quaternion<f32>| {
        (dot4(*q, *q) - 1.0).abs().partial_cmp(&UNIT_TOLERANCE).is_none_or(std::cmp::Ordering::is_gt)
    };
    match rotations.iter().position(off) {
        Some(i) => {
            let problem = format!("{:?}", rotations[i]);
            Err(SceneError::new(format!("rotations[{i}]"), problem, "a quaternion of length 1"))
        }
        None => Ok(()),
    }
}

/// False if nothing depends on R: not the means, not the covariance, not the colour.
fn reads_rotation(strategy: &Strategy) -> bool {
    let for_covariance = match strategy.covariance {
        CovarianceChoice::Rotate | CovarianceChoice::Surfel => true,
        CovarianceChoice::Affine
        | CovarianceChoice::AffineConjugate
        | CovarianceChoice::PushForward
        | CovarianceChoice::PushForwardNormal
        | CovarianceChoice::RotateByAverage => false,
    };
    let for_colour = match strategy.colour {
        ColourChoice::RotateSh | ColourChoice::ViewRotation => true,
        ColourChoice::None | ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse => false,
    };
    for_covariance || for_colour || strategy.rotation.moves_means()
}
