//! Rotations read from the mesh: one per face, or one per vertex combined over a face.
//!
//! What is degenerate falls back, deterministically, on the quaternion average of the skinning weights: a Gaussian on a
//! face without area in either pose, a vertex all of whose faces are, a sum of quaternions that cancels.

use super::super::face_frame::{self, FaceFrame};
use super::super::joints::Joints;
use super::super::lanes::{LANES, Lanes, identity, put};
use super::super::surface::{Embedding, Surface};
use super::BlockInput;
use super::average::with_bones;
use rayon::prelude::*;
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::math::{Quaternion, rotation};
use skinsplat_core::scene::PosedBody;

/// Sums of quaternions shorter than this have no direction.
const CANCELLED: f32 = 1e-6;

/// The rotation of every used face between the rest pose and a posed one.
pub(crate) struct FaceRotations<'a> {
    pub(crate) kind: FaceFrame,
    /// Per face; `None` for unused and degenerate ones.
    quats: Vec<Option<Quaternion<f32>>>,
    embeddings: &'a [Embedding],
}

impl<'a> FaceRotations<'a> {
    /// Compares posed and rest frames.
    pub(super) fn new(kind: FaceFrame, body: &PosedBody<'_>, surface: &'a Surface) -> Self {
        let quats = face_rotations(kind, body, surface, |face| surface.face_used[face]);
        Self { kind, quats, embeddings: &surface.embeddings }
    }

    /// R of each lane.
    #[inline(never)]
    pub(super) fn of_block(&self, input: &BlockInput<'_>) -> [Lanes; 4] {
        let mut relative = identity();
        for lane in 0..LANES {
            let quat = self.of_gaussian(input.gaussian(lane));
            put(&mut relative, lane, quat.unwrap_or_else(|| input.average_of(lane)));
        }
        relative
    }

    /// The rotation of a Gaussian's face.
    pub(crate) fn of_gaussian(&self, gaussian: usize) -> Option<Quaternion<f32>> {
        self.quats[self.embeddings[gaussian].face as usize]
    }
}

fn face_rotations(
    kind: FaceFrame,
    body: &PosedBody<'_>,
    surface: &Surface,
    needed: impl Fn(usize) -> bool + Sync,
) -> Vec<Option<Quaternion<f32>>> {
    let vertices = &body.mesh().vertices;
    let (kind, rest) = surface.faces.frames(kind);
    let rotation = |face: usize| {
        if !needed(face) {
            return None;
        }
        let corners = surface.faces.corners[face].map(|v| vertices[v as usize]);
        Some(face_frame::rotation_between(&face_frame::frame(kind, corners)?, rest[face].as_ref()?))
    };
    (0..surface.faces.corners.len()).into_par_iter().with_min_len(1024).map(rotation).collect()
}

/// A rotation per used vertex, and how three of them become one.
pub(crate) struct VertexRotations<'a> {
    /// Per vertex; `None` for unused and degenerate ones.
    pub(super) quats: Vec<Option<Quaternion<f32>>>,
    pub(super) combine: Combine,
    pub(super) embeddings: &'a [Embedding],
}

#[derive(Clone, Copy)]
pub(super) enum Combine {
    /// Eq. 7 with barycentric weights.
    Average(Solver),
    /// The normalised weighted sum, signs as they come or aligned to the first corner.
    Sum(SignPolicy),
}

impl<'a> VertexRotations<'a> {
    /// Eq. 7 at every used vertex with its own skinning weights.
    pub(super) fn averaged(
        solver: Solver,
        joints: &Joints,
        body: &PosedBody<'_>,
        surface: &'a Surface,
    ) -> Self {
        let rotation = |vertex: usize| {
            let (indices, weights) = body.rest.weights.row(vertex);
            if !surface.vertex_used[vertex] {
                return None;
            }
            let bone = |(&joint, &weight): (&u16, &f32)| {
                (joints.rotation_f64[usize::from(joint)], f64::from(weight))
            };
            let bones = indices.iter().zip(weights).map(bone);
            let average = with_bones(bones, |quats, weights| average_rotation(quats, weights, solver));
            average.map(|q| q.map(|c| c as f32))
        };
        let quats = (0..surface.vertex_used.len()).into_par_iter().with_min_len(512).map(rotation).collect();
        Self { quats, combine: Combine::Average(solver), embeddings: &surface.embeddings }
    }

    /// SplattingAvatar: the sum of the rotations of all faces around a vertex, weighted by their area at rest, under a
    /// sign policy.
    pub(super) fn summed(policy: SignPolicy, body: &PosedBody<'_>, surface: &'a Surface) -> Self {
        let faces = &surface.faces;
        let face_rotations = around_vertices(body, surface);
        let mut sums = vec![[0.0f32; 4]; surface.vertex_used.len()];
        for_each_signed(policy, &face_rotations, surface, |vertex, face, signed| {
            for k in 0..4 {
                sums[vertex][k] += faces.areas[face] * signed[k];
            }
        });
        let areas = &faces.areas;
        let largest = areas.iter().copied().fold(0.0f32, f32::max);
        let quats = sums.into_iter().map(|sum| unit(sum, CANCELLED * largest)).collect();
        Self { quats, combine: Combine::Sum(policy), embeddings: &surface.embeddings }
    }

    /// R of each lane.
    #[inline(never)]
    pub(super) fn of_block(&self, input: &BlockInput<'_>) -> [Lanes; 4] {
        let mut relative = identity();
        for lane in 0..LANES {
            let quat = self.combined(input.gaussian(lane));
            put(&mut relative, lane, quat.unwrap_or_else(|| input.average_of(lane)));
        }
        relative
    }

    fn combined(&self, gaussian: usize) -> Option<Quaternion<f32>> {
        let embedding = &self.embeddings[gaussian];
        let weights = embedding.weights();
        let [a, b, c] = embedding.corners.map(|vertex| self.quats[vertex as usize]);
        let quats = [a?, b?, c?];
        match self.combine {
            Combine::Average(solver) => {
                let average =
                    average_rotation(&quats.map(|q| q.map(f64::from)), &weights.map(f64::from), solver)?;
                Some(average.map(|c| c as f32))
            }
            Combine::Sum(policy) => {
                let mut sum = [0.0; 4];
                for (quat, weight) in quats.iter().zip(weights) {
                    let aligned = policy == SignPolicy::AlignToFirst;
                    let signed = if aligned { policy.apply(*quat, quats[0]) } else { *quat };
                    for k in 0..4 {
                        sum[k] += weight * signed[k];
                    }
                }
                unit(sum, CANCELLED)
            }
        }
    }
}

/// The rotations of all faces around used vertices.
pub(super) fn around_vertices(body: &PosedBody<'_>, surface: &Surface) -> Vec<Option<Quaternion<f32>>> {
    let used = |face: usize| surface.faces.corners[face].iter().any(|&v| surface.vertex_used[v as usize]);
    face_rotations(FaceFrame::SplattingAvatar, body, surface, used)
}

/// Calls `f` with each vertex, each face around it and the rotation of that, signed as the policy has it.
pub(super) fn for_each_signed(
    policy: SignPolicy,
    face_rotations: &[Option<Quaternion<f32>>],
    surface: &Surface,
    mut f: impl FnMut(usize, usize, Quaternion<f32>),
) {
    let mut first = vec![None; surface.vertex_used.len()];
    for (face, quat) in face_rotations.iter().enumerate() {
        let Some(quat) = *quat else { continue };
        for &vertex in &surface.faces.corners[face] {
            let reference = *first[vertex as usize].get_or_insert(quat);
            f(vertex as usize, face, policy.apply(quat, reference));
        }
    }
}

/// The quaternion of unit length, unless it is not longer than `floor`.
fn unit(q: Quaternion<f32>, floor: f32) -> Option<Quaternion<f32>> {
    let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
    if length > floor { rotation::normalize(q) } else { None }
}
