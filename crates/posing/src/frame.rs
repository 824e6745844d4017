//! An avatar in one pose, walked block by block: what [`pose`](super::pose()) and its adjoint share.

use super::blend::Blend;
use super::bound::Moves;
use super::face_frame;
use super::joints::Joints;
use super::layout::{Chunk, LANES, Lanes};
use super::rotate::{BlockInput, Source, Turn, turn};
use super::sight::Sight;
use super::{
    BoundAvatar, ColourChoice, CovarianceChoice, FaceFrame, JointLift, LbsProjection, RotationChoice,
    Strategy, StrategyError,
};
use glam::{Quat, Vec3};
use skinsplat_core::scene::{Camera, PosedBody};

/// What all chunks of a frame share.
pub(super) struct Frame<'a> {
    pub(super) bound: &'a BoundAvatar,
    pub(super) body: &'a PosedBody<'a>,
    pub(super) strategy: &'a Strategy,
    joints: Joints,
    pub(super) source: Source<'a>,
    /// The only camera that will look, if what it does not see may be left out.
    sight: Option<Sight>,
    arch: pulp::Arch,
}

/// What a walk does with each block.
pub(super) trait Visitor {
    /// `turn` and `scales` (standard deviations) are those of the block at that position in its chunk. To be inlined, so
    /// that it is compiled for each instruction set.
    fn block(&mut self, position: usize, input: &BlockInput<'_>, turn: &Turn, scales: &[Lanes; 3]);

    /// In place of [`Visitor::block`] for one that the camera of [`Frame::seen_by`] does not see. Nothing is to be done by
    /// visitors of frames without a camera.
    fn unseen(&mut self, _: &BlockInput<'_>, _: &[Lanes; 3]) {}
}

impl<'a> Frame<'a> {
    /// Everything that is computed once per pose. `lift`: of the body, for [`RotationChoice::LiftedSum`]; `None` is that
    /// from rest.
    pub(super) fn new(
        arch: pulp::Arch,
        bound: &'a BoundAvatar,
        body: &'a PosedBody<'a>,
        strategy: &'a Strategy,
        lift: Option<&'a JointLift>,
    ) -> Result<Self, StrategyError> {
        bound.check_body(body)?;
        let needs_faces = strategy.rotation.needs_faces() || strategy.covariance == CovarianceChoice::Surfel;
        if needs_faces && bound.surface.is_none() && bound.moves != Moves::Not {
            return Err(StrategyError::NoFaces { strategy: strategy.to_string() });
        }
        let joints = Joints::new(body);
        let source = if reads_rotation(strategy) {
            Source::new(strategy.rotation, &joints, body, bound.surface.as_ref(), lift)
        } else {
            Source::Identity
        };
        Ok(Self { bound, body, strategy, joints, source, sight: None, arch })
    }

    /// Leaves out what a camera does not see, where that is known before Gaussians are turned: they move by their weights
    /// and keep their size.
    pub(super) fn seen_by(self, camera: &Camera) -> Self {
        let converted = self.strategy.rotation == RotationChoice::Lbs(LbsProjection::MatrixToQuaternionRaw);
        let other_means =
            self.strategy.rotation == RotationChoice::DualQuaternion || self.scales_with_faces();
        let keeps_size = self.strategy.covariance == CovarianceChoice::Rotate && !converted;
        let known = self.bound.moves == Moves::ByWeights && keeps_size && !other_means;
        Self { sight: known.then(|| Sight::new(camera)), ..self }
    }

    /// Visits the blocks of a chunk, whose first Gaussian has index `start`, with the instructions of this processor.
    pub(super) fn walk(&self, chunk: &Chunk, start: usize, visitor: &mut impl Visitor) {
        self.arch.dispatch(Walk { frame: self, chunk, start, visitor });
    }

    /// True if the drawn quaternion is read from B R_c, so that R depends on R_c.
    pub(super) fn converts(&self) -> bool {
        matches!(self.source, Source::Lbs(projection) if projection.converts())
    }

    /// How the mean of a Gaussian moves under HAHA's scaled frames; `None` under other strategies, for static Gaussians
    /// and on faces without area in either pose.
    pub(super) fn face_motion(&self, gaussian: usize) -> Option<FaceMotion> {
        if !self.scales_with_faces() {
            return None;
        }
        let (Some(surface), Source::Faces(turns)) = (&self.bound.surface, &self.source) else { return None };
        let [w, x, y, z] = turns.of_gaussian(gaussian)?;
        let seat = &surface.seats[gaussian];
        let corners = seat.corners.map(|v| self.body.mesh().vertices[v as usize]);
        Some(FaceMotion {
            from: surface.faces.centroids[seat.face as usize],
            to: face_frame::centroid(&corners),
            turn: Quat::from_xyzw(x, y, z, w),
            growth: face_frame::haha_size(&corners) / surface.faces.sizes[seat.face as usize],
        })
    }

    pub(super) fn scales_with_faces(&self) -> bool {
        self.strategy.rotation == RotationChoice::FaceFrame(FaceFrame::HahaScaled)
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
    turn: Quat,
    /// HAHA's k over its value at rest.
    growth: f32,
}

impl FaceMotion {
    pub(super) fn apply(&self, point: Vec3) -> Vec3 {
        self.to + self.turn * (point - self.from) * self.growth
    }

    /// The derivative with respect to the point.
    pub(super) fn adjoint(&self, gradient: Vec3) -> Vec3 {
        self.turn.conjugate() * gradient * self.growth
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
        for (position, block) in chunk.blocks.iter().enumerate() {
            let (indices, weights) = chunk.influences(block);
            let blend = Blend::new(&frame.joints, indices, weights);
            let input = BlockInput { joints: &frame.joints, chunk, block, start, blend: &blend };
            if let Some(means) = frame.sight.as_ref().and_then(|sight| sight.hides(block, &blend)) {
                visitor.unseen(&input, &means);
                continue;
            }
            let turn = turn(frame.arch, &frame.source, &input);
            let scales = if frame.scales_with_faces() { frame.grown(&input) } else { block.scales };
            visitor.block(position, &input, &turn, &scales);
        }
    }
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

impl LbsProjection {
    /// True if it projects B R_c, not B.
    pub(super) fn converts(self) -> bool {
        match self {
            Self::MatrixToQuaternionRaw | Self::MatrixToQuaternion => true,
            Self::GramSchmidtColumns | Self::GramSchmidtRows | Self::Polar => false,
        }
    }
}
