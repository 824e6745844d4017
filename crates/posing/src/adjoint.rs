//! Posing walked backwards: from derivatives with respect to [`Posed`] to those with respect to the stored parameters of
//! the avatar and, where they are asked for, to the posed body ([`super::body_adjoint`]), a chunk of Gaussians at a time.
//!
//! [`Posed`]: skinsplat_core::scene::Posed

mod check;

use super::body_adjoint::{self, OfBody};
use super::bound::Moves;
use super::covariance::CovarianceGradient;
use super::frame::{Frame, Visitor};
use super::lanes::{self, LANES, Lanes, put, take};
use super::layout::{Block, CHUNK};
use super::options::Gradients;
use super::push_forward::Derivative;
use super::rotate::{BlockInput, Rotated, drawn_adjoint, means_adjoint, polar_adjoint, rotation_adjoint};
use super::surfel::Disc;
use super::{Across, ColourChoice, CovarianceChoice, PosingError, colour, covariance};
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::math::{Matrix3, Quaternion, dot4, matrix3, rotation};
use skinsplat_core::scene::{AvatarGradient, Gaussians, PosedGradient};

/// Adds to `into` what the pose of a frame contributes. See [`Poser::backward`](super::Poser::backward).
pub(super) fn add(
    frame: &Frame<'_>,
    gaussians: &Gaussians,
    upstream: &PosedGradient,
    into: Gradients<'_>,
) -> Result<(), PosingError> {
    let Gradients { avatar, body } = into;
    check::upstream(frame.bound, upstream)?;
    if let Some(gradient) = &avatar {
        check::avatar(frame.bound, gaussians, gradient)?;
    }
    if let Some(gradient) = &body {
        check::body(frame, gradient)?;
    }
    let count = frame.bound.len().div_ceil(CHUNK);
    let parts: Vec<Option<Part<'_>>> = match avatar {
        Some(gradient) => Part::split(gradient, frame.bound.sh_count()).into_iter().map(Some).collect(),
        None => (0..count).map(|_| None).collect(),
    };
    let run = |(number, gradient)| {
        let start = number * CHUNK;
        let length = CHUNK.min(frame.bound.len() - start);
        let of_body = body.is_some().then(|| OfBody::new(frame, length));
        let (relative, growth, rest_means) = Default::default();
        let chunk = AdjointChunk {
            frame,
            gaussians,
            upstream,
            number,
            start,
            length,
            gradient,
            of_body,
            relative,
            growth,
            rest_means,
        };
        chunk.run()
    };
    let of_body: Vec<Option<OfBody>> = parts.into_par_iter().enumerate().map(run).collect();
    if let Some(gradient) = body {
        let of_body: Vec<OfBody> = of_body.into_iter().flatten().collect();
        body_adjoint::gather(frame, upstream, &of_body, gradient);
    }
    Ok(())
}

/// One chunk's part of an [`AvatarGradient`].
struct Part<'o> {
    means: &'o mut [Vec3],
    rotations: &'o mut [Quaternion<f32>],
    log_scales: &'o mut [Vec3],
    opacity_logits: &'o mut [f32],
    sh: &'o mut [[f32; 3]],
    /// Empty unless face-bound, as `offsets`.
    barycentric: &'o mut [[f32; 3]],
    offsets: &'o mut [f32],
}

impl<'o> Part<'o> {
    /// The parts of consecutive chunks.
    fn split(gradient: &'o mut AvatarGradient, sh_count: usize) -> Vec<Self> {
        let mut rotations = gradient.rotations.chunks_mut(CHUNK);
        let mut log_scales = gradient.log_scales.chunks_mut(CHUNK);
        let mut opacity_logits = gradient.opacity_logits.chunks_mut(CHUNK);
        let mut sh = gradient.sh.chunks_mut(CHUNK * sh_count);
        let mut barycentric = gradient.barycentric.chunks_mut(CHUNK);
        let mut offsets = gradient.offsets.chunks_mut(CHUNK);
        let means = gradient.means.chunks_mut(CHUNK);
        means
            .map(|means| Self {
                means,
                rotations: rotations.next().unwrap_or_default(),
                log_scales: log_scales.next().unwrap_or_default(),
                opacity_logits: opacity_logits.next().unwrap_or_default(),
                sh: sh.next().unwrap_or_default(),
                barycentric: barycentric.next().unwrap_or_default(),
                offsets: offsets.next().unwrap_or_default(),
            })
            .collect()
    }
}

/// The work on one chunk.
struct AdjointChunk<'f, 'a, 'o> {
    frame: &'f Frame<'a>,
    gaussians: &'f Gaussians,
    upstream: &'f PosedGradient,
    /// Position of the chunk.
    number: usize,
    /// Index of its first Gaussian.
    start: usize,
    /// Number of its Gaussians.
    length: usize,
    /// Where the avatar's part goes, if it is asked for.
    gradient: Option<Part<'o>>,
    /// What is asked of the body, if anyone wants to know.
    of_body: Option<OfBody>,
    /// R of each Gaussian, for the SH; empty if they stay.
    relative: Vec<Quaternion<f32>>,
    /// By how much each Gaussian grows; empty unless joints scale and offsets follow.
    growth: Vec<f32>,
    /// With respect to the rest means, of face-bound Gaussians whose covariance or R depends on them; else empty.
    rest_means: Vec<Vec3>,
}

impl AdjointChunk<'_, '_, '_> {
    /// As forwards: blocks by joints, then what streams through memory.
    fn run(mut self) -> Option<OfBody> {
        let frame = self.frame;
        if self.rotates_sh() && self.gradient.is_some() {
            self.relative.resize(self.length, [0.0; 4]);
        }
        if frame.offsets_grow() {
            self.growth.resize(self.length, 1.0);
        }
        if frame.tangents.is_some() && frame.bound.moves == Moves::WithFaces {
            self.rest_means.resize(self.length, Vec3::ZERO);
        }
        let chunk = &frame.bound.chunks(frame.strategy.covariance)[self.number];
        frame.walk(chunk, self.start, &mut self);
        if let Some(mut gradient) = self.gradient.take() {
            self.embeddings(&mut gradient);
            self.opacities(&mut gradient);
            self.sh(&mut gradient);
        }
        if let Some(of_body) = &mut self.of_body {
            of_body.growth = self.growth;
        }
        self.of_body
    }

    fn rotates_sh(&self) -> bool {
        self.frame.strategy.colour == ColourChoice::RotateSh && self.frame.bound.sh_degree > 0
    }

    /// Barycentric coordinates and offsets, through the point on the posed mesh, or on the rest mesh where the face
    /// carries that along.
    fn embeddings(&self, gradient: &mut Part<'_>) {
        let Frame { bound, body, .. } = self.frame;
        let (Moves::WithFaces, Some(surface)) = (bound.moves, &bound.surface) else { return };
        let mesh = body.mesh();
        let places = gradient.barycentric.iter_mut().zip(gradient.offsets.iter_mut());
        for (i, (barycentric, offset)) in places.enumerate() {
            let gaussian = self.start + i;
            let (embedding, of_mean) = (&surface.embeddings[gaussian], self.upstream.means[gaussian]);
            let (of_barycentric, mut of_offset) = match self.frame.face_motion(gaussian) {
                Some(motion) => embedding.point_adjoint(&surface.faces.mesh, motion.adjoint(of_mean)),
                None => {
                    let growth = self.growth.get(i).copied().unwrap_or(1.0);
                    let (of_barycentric, of_offset) = embedding.grown(growth).point_adjoint(mesh, of_mean);
                    (of_barycentric, of_offset * growth)
                }
            };
            if let Some(&of_rest) = self.rest_means.get(i) {
                // Coordinates are followed into positions only: weights would move along with them.
                of_offset += embedding.point_adjoint(&surface.faces.mesh, of_rest).1;
            }
            barycentric.iter_mut().zip(of_barycentric).for_each(|(sum, own)| *sum += own);
            *offset += of_offset;
        }
    }

    /// The sigmoid: o (1 − o).
    fn opacities(&self, gradient: &mut Part<'_>) {
        let range = self.start..self.start + self.length;
        let opacities = self.frame.bound.opacities[range.clone()].iter().zip(&self.upstream.opacities[range]);
        for (sum, (&opacity, &own)) in gradient.opacity_logits.iter_mut().zip(opacities) {
            *sum += own * (opacity * (1.0 - opacity));
        }
    }

    fn sh(&self, gradient: &mut Part<'_>) {
        let (degree, count) = (self.frame.bound.sh_degree, self.frame.bound.sh_count());
        let upstream = &self.upstream.sh[self.start * count..][..gradient.sh.len()];
        if self.relative.is_empty() {
            return colour::add_sh(upstream, gradient.sh);
        }
        let values = upstream.chunks_exact(count).zip(gradient.sh.chunks_exact_mut(count));
        for (quat, (upstream, gradient)) in self.relative.iter().zip(values) {
            // Most of the far side of a body is asked for nothing.
            if upstream.as_flattened().iter().all(|&own| own == 0.0) {
                continue;
            }
            colour::rotate_sh_adjoint(*quat, degree, upstream, gradient);
        }
    }

    /// What a block asks of its Gaussians.
    #[inline(always)]
    fn back_to_avatar(
        &mut self,
        position: usize,
        input: &BlockInput<'_>,
        rotated: &Rotated,
        scales: &[Lanes; 3],
        of_factors: &[Lanes; 9],
        of_covariance: &CovarianceGradient,
    ) {
        let (block, choice) = (input.block, self.frame.strategy.covariance);
        let mut log_scales = of_covariance.log_scales;
        let mut rotations = self.of_rotations(input, rotated, &of_covariance.rotation);
        let mut units = &block.rotations;
        if choice == CovarianceChoice::Surfel {
            self.through_discs(position, input, &mut rotations, &mut log_scales);
            let own = &self.frame.bound.chunks(CovarianceChoice::Rotate)[self.number];
            units = &own.blocks[position].rotations;
        }
        let stored = self.of_stored(input, units, &rotations);
        let mut means = self.of_means(input, rotated);
        if input.jacobian.is_some() {
            let of_drawn = (of_factors, &of_covariance.rotation);
            self.through_jacobian(position, input, rotated, scales, of_drawn, &mut means);
        }
        self.add(block, &means, &stored, &log_scales);
    }

    /// The derivatives with respect to the factors of a block, row-major.
    #[inline(always)]
    fn of_factors(&self, block: &Block) -> [Lanes; 9] {
        let mut gathered = [[0.0; LANES]; 9];
        for lane in 0..LANES {
            let columns = self.upstream.factors[self.start + usize::from(block.index[lane])].to_cols_array();
            for row in 0..3 {
                for column in 0..3 {
                    gathered[3 * row + column][lane] = columns[3 * column + row];
                }
            }
        }
        gathered
    }

    /// The derivatives with respect to canonical means.
    #[inline(always)]
    fn of_means(&self, input: &BlockInput<'_>, rotated: &Rotated) -> [Lanes; 3] {
        let mut gathered = [[0.0; LANES]; 3];
        if self.frame.bound.moves == Moves::WithFaces {
            return gathered;
        }
        for lane in 0..LANES {
            let own = self.upstream.means[input.gaussian(lane)];
            for axis in 0..3 {
                gathered[axis][lane] = own[axis];
            }
        }
        match (self.frame.bound.moves, &rotated.means) {
            (Moves::Not | Moves::WithFaces, _) => gathered,
            (Moves::ByWeights, Some(_)) => means_adjoint(input, rotated, &gathered),
            (Moves::ByWeights, None) => {
                let mut means = input.blend.transform_adjoint(&gathered);
                if self.frame.source.scaled_faces().is_some() {
                    self.of_carried_means(input, &mut means);
                }
                means
            }
        }
    }

    /// Those that a face carries along.
    #[inline(never)]
    fn of_carried_means(&self, input: &BlockInput<'_>, means: &mut [Lanes; 3]) {
        for lane in 0..LANES {
            let gaussian = input.gaussian(lane);
            if let Some(motion) = self.frame.face_motion(gaussian) {
                let own = motion.adjoint(self.upstream.means[gaussian]);
                (0..3).for_each(|axis| means[axis][lane] = own[axis]);
            }
        }
    }

    /// The derivatives with respect to canonical unit quaternions, from those of the covariance: with respect to the
    /// posed ones where it is rotated, to the canonical ones where it is deformed.
    #[inline(always)]
    fn of_rotations(
        &self,
        input: &BlockInput<'_>,
        rotated: &Rotated,
        of_covariance: &[Lanes; 4],
    ) -> [Lanes; 4] {
        let source = &self.frame.source;
        let torque = (source.converts() && self.rotates_sh()).then(|| self.torque(input, rotated));
        match (self.frame.strategy.covariance, torque) {
            (CovarianceChoice::Rotate | CovarianceChoice::Surfel, torque) => {
                rotation_adjoint(self.frame.arch, source, input, rotated, of_covariance, torque.as_ref())
            }
            (CovarianceChoice::RotateByAverage, torque) => {
                let of_canonical = drawn_adjoint(rotated, of_covariance);
                if torque.is_none() {
                    return of_canonical;
                }
                let none = [[0.0; LANES]; 4];
                let of_colour =
                    rotation_adjoint(self.frame.arch, source, input, rotated, &none, torque.as_ref());
                lanes::sum(&of_canonical, &of_colour)
            }
            (_, None) => *of_covariance,
            (_, torque) => {
                let none = [[0.0; LANES]; 4];
                let of_colour =
                    rotation_adjoint(self.frame.arch, source, input, rotated, &none, torque.as_ref());
                lanes::sum(of_covariance, &of_colour)
            }
        }
    }

    /// How the loss changes if R rotates on, where R depends on R_c and SH rotate with R.
    #[inline(never)]
    fn torque(&self, input: &BlockInput<'_>, rotated: &Rotated) -> [Lanes; 3] {
        let mut torque = [[0.0; LANES]; 3];
        let (degree, count) = (self.frame.bound.sh_degree, self.frame.bound.sh_count());
        for lane in 0..LANES {
            let range = input.gaussian(lane) * count..(input.gaussian(lane) + 1) * count;
            let (own, upstream) = (&self.frame.bound.sh[range.clone()], &self.upstream.sh[range]);
            let of_lane = colour::sh_torque(take(&rotated.relative, lane), degree, own, upstream);
            (0..3).for_each(|axis| torque[axis][lane] = of_lane[axis]);
        }
        torque
    }

    /// Adds to the derivatives with respect to canonical means what comes through the derivative J of LBS: by the covariance that
    /// J deforms, by the SH and the covariance that its nearest rotation turns.
    #[inline(never)]
    fn through_jacobian(
        &mut self,
        position: usize,
        input: &BlockInput<'_>,
        rotated: &Rotated,
        scales: &[Lanes; 3],
        (of_factors, of_posed): (&[Lanes; 9], &[Lanes; 4]),
        means: &mut [Lanes; 3],
    ) {
        let (Some(tangents), Some(jacobian)) = (self.frame.tangents, input.jacobian) else { return };
        let (covariance, source) = (self.frame.strategy.covariance, self.frame.source.across());
        let of_block = Derivative {
            joints: input.joints,
            chunk: input.chunk,
            position,
            tangents: &tangents[self.number],
            blend: input.blend,
        };
        let torque = (source.is_some() && self.rotates_sh()).then(|| self.torque(input, rotated));
        let turns = matches!(covariance, CovarianceChoice::Rotate | CovarianceChoice::Surfel);
        for lane in 0..input.block.count {
            let mut of_mean = [0.0; 3];
            let mut add = |across: Across, upstream: &Matrix3<f32>| {
                of_mean =
                    matrix3::add_scaled(of_mean, 1.0, of_block.adjoint(jacobian, across, lane, upstream));
            };
            if let Some(across) = covariance.across() {
                add(
                    across,
                    &covariance::map_adjoint(covariance, &input.block.rotations, scales, of_factors, lane),
                );
            }
            if let Some(across) = source {
                let own = torque.as_ref().map_or([0.0; 3], |t| [0, 1, 2].map(|axis: usize| t[axis][lane]));
                let posed = if turns {
                    rotation::adjoint::to_torque(take(&rotated.posed, lane), take(of_posed, lane))
                } else {
                    [0.0; 3]
                };
                let torque = matrix3::add_scaled(own, 1.0, posed);
                let j = lanes::matrix(jacobian.of(across), lane);
                add(across, &polar_adjoint(&j, take(&rotated.relative, lane), torque));
            }
            match self.rest_means.get_mut(usize::from(input.block.index[lane])) {
                Some(sum) => *sum += Vec3::from_array(of_mean),
                None => (0..3).for_each(|axis| means[axis][lane] += of_mean[axis]),
            }
        }
    }

    /// From the discs of a block to its Gaussians.
    #[inline(never)]
    fn through_discs(
        &self,
        position: usize,
        input: &BlockInput<'_>,
        rotations: &mut [Lanes; 4],
        log_scales: &mut [Lanes; 3],
    ) {
        let bound = self.frame.bound;
        let Some(surface) = &bound.surface else { return };
        let own = &bound.chunks(CovarianceChoice::Rotate)[self.number].blocks[position];
        for lane in 0..LANES {
            let canonical = take(&own.rotations, lane);
            let Some(disc) = Disc::nearest(canonical, surface, input.gaussian(lane)) else { continue };
            let of_scales = [0, 1, 2].map(|axis: usize| log_scales[axis][lane]);
            let (snapped, of_snapped) = (take(&input.block.rotations, lane), take(rotations, lane));
            let (of_rotation, of_scales) = disc.adjoint(canonical, snapped, of_snapped, of_scales);
            put(rotations, lane, of_rotation);
            (0..3).for_each(|axis| log_scales[axis][lane] = of_scales[axis]);
        }
    }

    #[inline(always)]
    fn add(&mut self, block: &Block, means: &[Lanes; 3], rotations: &[Lanes; 4], log_scales: &[Lanes; 3]) {
        let Some(gradient) = &mut self.gradient else { return };
        for lane in 0..block.count {
            let i = usize::from(block.index[lane]);
            gradient.means[i] += Vec3::new(means[0][lane], means[1][lane], means[2][lane]);
            let own = take(rotations, lane);
            gradient.rotations[i].iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            gradient.log_scales[i] +=
                Vec3::new(log_scales[0][lane], log_scales[1][lane], log_scales[2][lane]);
        }
    }

    /// From unit quaternions to stored ones.
    #[inline(always)]
    fn of_stored(&self, input: &BlockInput<'_>, units: &[Lanes; 4], of_units: &[Lanes; 4]) -> [Lanes; 4] {
        let mut stored = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            put(&mut stored, lane, self.gaussians.rotations[input.gaussian(lane)]);
        }
        for lane in 0..LANES {
            let unit = take(units, lane);
            // |q| = unit · q.
            let inverse = 1.0 / dot4(unit, take(&stored, lane));
            put(&mut stored, lane, rotation::adjoint::normalize(unit, inverse, take(of_units, lane)));
        }
        stored
    }
}

impl Visitor for AdjointChunk<'_, '_, '_> {
    #[inline(always)]
    fn block(&mut self, position: usize, input: &BlockInput<'_>, rotated: &Rotated, scales: &[Lanes; 3]) {
        let (block, choice) = (input.block, self.frame.strategy.covariance);
        let of_factors = self.of_factors(block);
        let map = covariance::deforming(choice, input);
        let of_covariance =
            covariance::adjoint(choice, &rotated.posed, map, &block.rotations, scales, &of_factors);
        if let Some(of_body) = &mut self.of_body {
            let (frame, upstream, number) = (self.frame, self.upstream, self.number);
            let (of_factors, of_covariance) = (&of_factors, &of_covariance);
            of_body.add(&body_adjoint::Block {
                frame,
                upstream,
                number,
                position,
                input,
                rotated,
                scales,
                of_factors,
                of_covariance,
            });
        }
        if self.gradient.is_some() {
            self.back_to_avatar(position, input, rotated, scales, &of_factors, &of_covariance);
        }
        if let (false, Some(growth)) = (self.growth.is_empty(), input.growth()) {
            for lane in 0..block.count {
                self.growth[usize::from(block.index[lane])] = growth[lane];
            }
        }
        if !self.relative.is_empty() {
            for lane in 0..block.count {
                self.relative[usize::from(block.index[lane])] = take(&rotated.relative, lane);
            }
        }
    }
}
