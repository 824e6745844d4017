//! Posing walked backwards to the body: from derivatives with respect to [`Posed`] to those with respect to what posing read of the
//! posed body, a chunk of Gaussians at a time.
//!
//! Blocks sum what they ask of the blend that they share and hand it to their joints by weight; what a rotation reads otherwise
//! (joints one by one, faces) is followed lane by lane. Every chunk sums into a place of its own in `f64`, and chunks add up in
//! their order, so that no thread changes a bit.
//!
//! [`Posed`]: skinsplat_core::scene::Posed

use super::blend;
use super::bound::Moves;
use super::covariance::{self, CovarianceGradient};
use super::frame::Frame;
use super::lanes::{self, LANES, Lanes, take};
use super::push_forward::Derivative;
use super::rotate::{
    BlockInput, FaceSums, LbsProjection, OfFace, Rotated, Source, blend_adjoint, polar_adjoint,
    projection_adjoint, to_centroid, torques_to_joints,
};
use super::{Across, ColourChoice, CovarianceChoice, colour};
use glam::{DMat3, DVec3, Vec3};
use skinsplat_core::math::rotation::adjoint::{matrix_to_torque, to_torque};
use skinsplat_core::math::{Matrix3, matrix3, rotation};
use skinsplat_core::scene::{BodyGradient, PosedGradient};

/// What the Gaussians of a chunk ask of the body.
pub(super) struct OfBody {
    joints: Vec<OfJoint>,
    /// Of each Gaussian; empty unless R is read from the mesh.
    faces: Vec<OfFace>,
    /// By how much each Gaussian grows; empty unless joints scale and offsets follow.
    pub(super) growth: Vec<f32>,
}

/// What is asked of a joint.
#[derive(Clone, Copy, Default)]
struct OfJoint {
    /// With respect to the entries of its linear part, row-major, and to its translation.
    linear: [f64; 9],
    translation: [f64; 3],
    /// With respect to the entries of its rotation.
    rotation: [f64; 9],
    /// With respect to a further rotation of its rotation.
    torque: [f64; 3],
}

/// What a block asks of Σ w_j of its joints' linear parts, translations and rotations.
struct OfBlend {
    linear: [Lanes; 9],
    translation: [Lanes; 3],
    rotation: [Lanes; 9],
}

/// A block on its way back.
pub(super) struct Block<'b> {
    pub(super) frame: &'b Frame<'b>,
    pub(super) upstream: &'b PosedGradient,
    /// Of the chunk.
    pub(super) number: usize,
    /// In the chunk.
    pub(super) position: usize,
    pub(super) input: &'b BlockInput<'b>,
    pub(super) rotated: &'b Rotated,
    /// Standard deviations as they were drawn.
    pub(super) scales: &'b [Lanes; 3],
    /// With respect to the factors, row-major, and to what they were made of.
    pub(super) of_factors: &'b [Lanes; 9],
    pub(super) of_covariance: &'b CovarianceGradient,
}

impl OfBody {
    /// Zeros for a chunk of so many Gaussians.
    pub(super) fn new(frame: &Frame<'_>, gaussians: usize) -> Self {
        let reads_mesh = matches!(frame.source, Source::Faces(_) | Source::Vertices(_));
        Self {
            joints: vec![OfJoint::default(); frame.body.joints.len()],
            faces: if reads_mesh { vec![OfFace::default(); gaussians] } else { Vec::new() },
            growth: Vec::new(),
        }
    }

    /// Adds what a block asks for.
    #[inline(never)]
    pub(super) fn add(&mut self, block: &Block<'_>) {
        let (indices, weights) = block.input.chunk.influences(block.input.block);
        if indices.is_empty() {
            return;
        }
        let mut of_blend = OfBlend {
            linear: [[0.0; LANES]; 9],
            translation: [[0.0; LANES]; 3],
            rotation: [[0.0; LANES]; 9],
        };
        let mut asked = false;
        for lane in (0..block.input.block.count).filter(|&lane| block.is_touched(lane)) {
            asked = true;
            self.add_lane(block, lane, &mut of_blend);
        }
        if !asked {
            return;
        }
        for (&joint, weight) in indices.iter().zip(weights) {
            let sum = &mut self.joints[usize::from(joint)];
            add_weighted(&mut sum.linear, weight, &of_blend.linear);
            add_weighted(&mut sum.translation, weight, &of_blend.translation);
            add_weighted(&mut sum.rotation, weight, &of_blend.rotation);
        }
    }

    fn add_lane(&mut self, block: &Block<'_>, lane: usize, of_blend: &mut OfBlend) {
        if block.follows_blend(lane) {
            let own = block.upstream.means[block.input.gaussian(lane)].to_array();
            (0..3).for_each(|axis| of_blend.translation[axis][lane] += own[axis]);
            add_matrix(&mut of_blend.linear, lane, &outer(own, block.mean(lane)));
        }
        let choice = block.frame.strategy.covariance;
        if !matches!(
            choice,
            CovarianceChoice::Rotate | CovarianceChoice::RotateByAverage | CovarianceChoice::Surfel
        ) {
            let canonical = &block.input.block.rotations;
            let of_map = covariance::map_adjoint(choice, canonical, block.scales, block.of_factors, lane);
            match choice.across() {
                Some(across) => self.through_jacobian(block, across, lane, &of_map, of_blend),
                None => add_matrix(&mut of_blend.linear, lane, &of_map),
            }
        }
        if choice == CovarianceChoice::RotateByAverage {
            let of_posed = take(&block.of_covariance.rotation, lane);
            let torque = to_torque(take(&block.rotated.posed, lane), of_posed);
            self.through_average(block, take(&block.rotated.drawn_by, lane), lane, torque, of_blend);
        }
        if let Some(of_frame) = block.of_view_frame(lane) {
            let b = block.input.blend.matrix(lane);
            let of_b = colour::blend_adjoint(block.frame.strategy.colour, b, &of_frame);
            add_matrix(&mut of_blend.linear, lane, &of_b);
        }
        self.through_rotation(block, lane, of_blend);
    }

    /// Through R, to what it was read from.
    fn through_rotation(&mut self, block: &Block<'_>, lane: usize, of_blend: &mut OfBlend) {
        let (input, rotated) = (block.input, block.rotated);
        let (indices, _) = input.chunk.influences(input.block);
        let relative = take(&rotated.relative, lane);
        let (of_drawn, of_colour) = (block.drawn_torque(lane), block.colour_torque(lane));
        let torque = matrix3::add_scaled(of_drawn, 1.0, of_colour);
        let own_motion = block.frame.bound.moves == Moves::ByWeights && rotated.means.is_some();
        let of_mean =
            if own_motion { block.upstream.means[input.gaussian(lane)].to_array() } else { [0.0; 3] };
        let joints = &mut self.joints;
        let follows_joints = torques_to_joints(
            &block.frame.source,
            input,
            lane,
            (torque, of_mean),
            |influence, turn, shift| {
                let sum = &mut joints[usize::from(indices[influence])];
                (0..3).for_each(|axis| sum.torque[axis] += turn[axis]);
                (0..3).for_each(|axis| sum.translation[axis] += shift[axis]);
            },
        );
        if follows_joints {
            return;
        }
        let one_rigid = indices.len() == 1 && input.joints.rigid();
        match &block.frame.source {
            Source::Lbs(projection) if projection.converts() => {
                self.through_conversion(block, *projection, lane, of_colour, of_blend);
            }
            Source::Lbs(_) | Source::PushForward(_) if one_rigid => {
                (0..3).for_each(|axis| {
                    self.joints[usize::from(indices[0])].torque[axis] += f64::from(torque[axis]);
                });
            }
            Source::Lbs(projection) => {
                let of_b = projection_adjoint(*projection, input.blend.matrix(lane), relative, torque);
                add_matrix(&mut of_blend.linear, lane, &of_b);
            }
            Source::PushForward(across) => {
                let Some(jacobian) = input.jacobian else { return };
                let of_j = polar_adjoint(&lanes::matrix(jacobian.of(*across), lane), relative, torque);
                self.through_jacobian(block, *across, lane, &of_j, of_blend);
            }
            Source::Average(_) => self.through_average(block, relative, lane, torque, of_blend),
            Source::Faces(_) | Source::Vertices(_) => {
                let own = &mut self.faces[usize::from(input.block.index[lane])];
                own.torque += Vec3::from_array(torque).as_dvec3();
                // Scales are multiplied by the growth.
                let of_scales: f32 = block.of_covariance.log_scales.iter().map(|axis| axis[lane]).sum();
                own.growth += f64::from(of_scales);
            }
            Source::Identity | Source::Dual | Source::Lifted(_) | Source::PerBlock(_) => {}
        }
    }

    /// The exact average, by whichever solver: the rotation nearest to the blend of rotations.
    fn through_average(
        &mut self,
        block: &Block<'_>,
        average: [f32; 4],
        lane: usize,
        torque: [f32; 3],
        of_blend: &mut OfBlend,
    ) {
        let input = block.input;
        let (indices, weights) = input.chunk.influences(input.block);
        if let &[joint] = indices {
            let sum = &mut self.joints[usize::from(joint)].torque;
            return (0..3).for_each(|axis| sum[axis] += f64::from(torque[axis]));
        }
        let blended = match &input.joints.rotation_matrix {
            None => input.blend.matrix(lane),
            Some(matrices) => lanes::matrix(&blend::rotations(matrices, indices, weights), lane),
        };
        add_matrix(&mut of_blend.rotation, lane, &polar_adjoint(&blended, average, torque));
    }

    fn through_conversion(
        &mut self,
        block: &Block<'_>,
        projection: LbsProjection,
        lane: usize,
        of_colour: [f32; 3],
        of_blend: &mut OfBlend,
    ) {
        let input = block.input;
        let of_posed = if block.turns() { take(&block.of_covariance.rotation, lane) } else { [0.0; 4] };
        let canonical = take(&input.block.rotations, lane);
        match input.blended_rotations() {
            Some(rotations) => {
                let b = lanes::matrix(&rotations, lane);
                let of_b = blend_adjoint(projection, b, canonical, of_posed, of_colour);
                add_matrix(&mut of_blend.rotation, lane, &of_b);
            }
            None => {
                let b = input.blend.matrix(lane);
                let of_b = blend_adjoint(projection, b, canonical, of_posed, of_colour);
                add_matrix(&mut of_blend.linear, lane, &of_b);
            }
        }
    }

    fn through_jacobian(
        &mut self,
        block: &Block<'_>,
        across: Across,
        lane: usize,
        upstream: &Matrix3<f32>,
        of_blend: &mut OfBlend,
    ) {
        let (Some(tangents), Some(jacobian)) = (block.frame.tangents, block.input.jacobian) else { return };
        let BlockInput { joints, chunk, blend, .. } = *block.input;
        let tangents = &tangents[block.number];
        let of_block = Derivative { joints, chunk, position: block.position, tangents, blend };
        let (indices, _) = chunk.influences(block.input.block);
        let mean = block.mean(lane);
        let of_b = of_block.joint_adjoint(jacobian, across, lane, upstream, |influence, own| {
            let sum = &mut self.joints[usize::from(indices[influence])];
            for row in 0..3 {
                sum.translation[row] += f64::from(own[row]);
                (0..3).for_each(|column| sum.linear[3 * row + column] += f64::from(own[row] * mean[column]));
            }
        });
        add_matrix(&mut of_blend.linear, lane, &of_b);
    }
}

impl Block<'_> {
    /// False for lanes of which nothing is asked: those that the camera did not see.
    fn is_touched(&self, lane: usize) -> bool {
        let gaussian = self.input.gaussian(lane);
        let count = self.frame.bound.sh_count();
        let frames = &self.upstream.view_frames;
        self.upstream.means[gaussian] != Vec3::ZERO
            || self.of_factors.iter().any(|entry| entry[lane] != 0.0)
            || frames.get(gaussian).is_some_and(|own| *own != glam::Mat3::ZERO)
            || self.upstream.sh[gaussian * count..(gaussian + 1) * count] != [[0.0; 3]; 16][..count]
    }

    /// True if the mean follows Eq. 6.
    fn follows_blend(&self, lane: usize) -> bool {
        let by_weights = self.frame.bound.moves == Moves::ByWeights && self.rotated.means.is_none();
        by_weights && self.frame.face_motion(self.input.gaussian(lane)).is_none()
    }

    /// True if R turns the covariance.
    fn turns(&self) -> bool {
        matches!(self.frame.strategy.covariance, CovarianceChoice::Rotate | CovarianceChoice::Surfel)
    }

    /// The canonical mean.
    fn mean(&self, lane: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis: usize| self.input.block.means[axis][lane])
    }

    /// With respect to a further rotation of R, through what it draws.
    fn drawn_torque(&self, lane: usize) -> [f32; 3] {
        match self.turns() {
            true => to_torque(take(&self.rotated.posed, lane), take(&self.of_covariance.rotation, lane)),
            false => [0.0; 3],
        }
    }

    /// With respect to a further rotation of R, through the SH that it turns or the frame in which they are read.
    fn colour_torque(&self, lane: usize) -> [f32; 3] {
        let relative = take(&self.rotated.relative, lane);
        match self.frame.strategy.colour {
            ColourChoice::RotateSh if self.frame.bound.sh_degree > 0 => {
                let (degree, count) = (self.frame.bound.sh_degree, self.frame.bound.sh_count());
                let range = self.input.gaussian(lane) * count..(self.input.gaussian(lane) + 1) * count;
                let (own, upstream) = (&self.frame.bound.sh[range.clone()], &self.upstream.sh[range]);
                colour::sh_torque(relative, degree, own, upstream)
            }
            // F = Rᵀ.
            ColourChoice::ViewRotation => self.of_view_frame(lane).map_or([0.0; 3], |of_frame| {
                let r = rotation::quaternion_to_matrix_raw(relative);
                matrix_to_torque(&r, &matrix3::transpose(of_frame))
            }),
            ColourChoice::None
            | ColourChoice::RotateSh
            | ColourChoice::ViewBlend
            | ColourChoice::ViewBlendInverse => [0.0; 3],
        }
    }

    /// With respect to the frame in which the view direction is read, row-major, where there is one.
    fn of_view_frame(&self, lane: usize) -> Option<Matrix3<f32>> {
        let own = self.upstream.view_frames.get(self.input.gaussian(lane))?;
        Some(own.transpose().to_cols_array_2d())
    }
}

/// Adds what all chunks ask of the body, in their order, and what Gaussians on the mesh ask of it.
pub(super) fn gather(
    frame: &Frame<'_>,
    upstream: &PosedGradient,
    chunks: &[OfBody],
    gradient: &mut BodyGradient,
) {
    for chunk in chunks {
        for (joint, own) in chunk.joints.iter().enumerate() {
            let rows = |entries: &[f64; 9]| DMat3::from_cols_array(entries).transpose();
            gradient.linear[joint] += rows(&own.linear);
            gradient.translations[joint] += DVec3::from_array(own.translation);
            let rotation = frame.body.joints[joint].rotation;
            let r = DMat3::from_quat(rotation).transpose().to_cols_array_2d();
            let of_rotation = rows(&own.rotation).transpose().to_cols_array_2d();
            let turn = matrix_to_torque(&r, &of_rotation);
            gradient.torques[joint] += DVec3::from_array(own.torque) + DVec3::from_array(turn);
        }
    }
    let Some(surface) = &frame.bound.surface else { return };
    let mut faces: Vec<OfFace> = chunks.iter().flat_map(|chunk| chunk.faces.iter().copied()).collect();
    if frame.bound.moves == Moves::WithFaces || frame.source.scaled_faces().is_some() {
        let growth = chunks.iter().flat_map(|chunk| chunk.growth.iter().copied()).collect::<Vec<_>>();
        means_to_mesh(frame, upstream, &growth, &mut faces, gradient);
    }
    match &frame.source {
        Source::Faces(rotations) => {
            let mut sums = FaceSums::new(rotations.kind, surface);
            for (gaussian, own) in faces.iter().enumerate() {
                if rotations.of_gaussian(gaussian).is_some() {
                    let growth = if frame.source.scaled_faces().is_some() { own.growth } else { 0.0 };
                    sums.add(gaussian, OfFace { growth, ..*own });
                }
            }
            sums.to_vertices(frame.body, gradient);
        }
        Source::Vertices(rotations) => {
            rotations.to_body(&faces, &frame.joints, frame.body, surface, gradient);
        }
        Source::Identity
        | Source::Lbs(_)
        | Source::Average(_)
        | Source::Dual
        | Source::PushForward(_)
        | Source::Lifted(_)
        | Source::PerBlock(_) => {}
    }
}

/// Means that follow the posed mesh; under HAHA's scaled frames those of whichever binding, which also turn and grow with it.
fn means_to_mesh(
    frame: &Frame<'_>,
    upstream: &PosedGradient,
    growth: &[f32],
    faces: &mut [OfFace],
    gradient: &mut BodyGradient,
) {
    let Some(surface) = &frame.bound.surface else { return };
    let mesh = frame.body.mesh();
    let (of_vertices, of_normals) = gradient.mesh_mut(mesh.vertices.len());
    for (gaussian, &own) in upstream.means.iter().enumerate() {
        if let Some(motion) = frame.face_motion(gaussian) {
            let (torque, of_growth) = motion.motion_adjoint(frame.bound.means[gaussian], own);
            faces[gaussian].torque += torque.as_dvec3();
            // So far with respect to the logarithm.
            faces[gaussian].growth =
                faces[gaussian].growth / f64::from(motion.growth()) + f64::from(of_growth);
            to_centroid(surface, gaussian, own, of_vertices);
        } else if frame.bound.moves == Moves::WithFaces && own != Vec3::ZERO {
            let embedding = &surface.embeddings[gaussian];
            let grown = embedding.grown(growth.get(gaussian).copied().unwrap_or(1.0));
            let corners = embedding.corners.iter().zip(grown.mesh_adjoint(mesh, own));
            for (&vertex, (of_vertex, of_normal)) in corners {
                of_vertices[vertex as usize] += of_vertex.as_dvec3();
                of_normals[vertex as usize] += of_normal.as_dvec3();
            }
        }
    }
}

/// Adds Σ over lanes of w v.
#[inline(always)]
fn add_weighted<const N: usize>(sums: &mut [f64; N], weight: &Lanes, values: &[Lanes; N]) {
    for (sum, values) in sums.iter_mut().zip(values) {
        let mut products = [0.0; LANES];
        for lane in 0..LANES {
            products[lane] = weight[lane] * values[lane];
        }
        let [a, b, c, d, e, f, g, h] = products;
        *sum += f64::from(((a + b) + (c + d)) + ((e + f) + (g + h)));
    }
}

/// Adds to one lane of row-major matrices.
#[inline(always)]
fn add_matrix(sums: &mut [Lanes; 9], lane: usize, own: &Matrix3<f32>) {
    for (sum, entry) in sums.iter_mut().zip(own.as_flattened()) {
        sum[lane] += entry;
    }
}

/// a bᵀ.
#[inline(always)]
fn outer(a: [f32; 3], b: [f32; 3]) -> Matrix3<f32> {
    a.map(|a| b.map(|b| a * b))
}
