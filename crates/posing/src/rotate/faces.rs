//! Rotations read from the mesh: one per face, or one per vertex combined over a face.
//!
//! What is degenerate falls back, deterministically, on the quaternion average of the skinning weights: a Gaussian on a
//! face without area in either pose, a vertex all of whose faces are, a sum of quaternions that cancels.

use super::super::FaceFrame;
use super::super::face_frame;
use super::super::joints::Joints;
use super::super::layout::{LANES, Lanes};
use super::super::seat::{Seat, Surface};
use super::average::{splat, with_bones};
use super::{BlockInput, put};
use rayon::prelude::*;
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::math::{Quaternion, rotation};
use skinsplat_core::scene::PosedBody;

/// Sums of quaternions shorter than this have no direction.
const CANCELLED: f32 = 1e-6;

/// The rotation of every used face between the rest pose and a posed one.
pub(in super::super) struct FaceTurns<'a> {
    /// Per face; `None` for unused and degenerate ones.
    turns: Vec<Option<Quaternion<f32>>>,
    seats: &'a [Seat],
}

impl<'a> FaceTurns<'a> {
    /// Compares posed and rest frames.
    pub(super) fn new(kind: FaceFrame, body: &PosedBody<'_>, surface: &'a Surface) -> Self {
        let turns = face_turns(kind, body, surface, |face| surface.face_used[face]);
        Self { turns, seats: &surface.seats }
    }

    /// The turns of a block.
    #[inline(never)]
    pub(super) fn of_block(&self, input: &BlockInput<'_>) -> [Lanes; 4] {
        let mut turns = splat(rotation::identity());
        for lane in 0..LANES {
            let turn = self.of_gaussian(input.gaussian(lane));
            put(&mut turns, lane, turn.unwrap_or_else(|| input.average_of(lane)));
        }
        turns
    }

    /// The turn of a Gaussian's face.
    pub(in super::super) fn of_gaussian(&self, gaussian: usize) -> Option<Quaternion<f32>> {
        self.turns[self.seats[gaussian].face as usize]
    }
}

fn face_turns(
    kind: FaceFrame,
    body: &PosedBody<'_>,
    surface: &Surface,
    needed: impl Fn(usize) -> bool + Sync,
) -> Vec<Option<Quaternion<f32>>> {
    let vertices = &body.mesh().vertices;
    let (kind, rest) = surface.faces.frames(kind);
    let turn = |face: usize| {
        if !needed(face) {
            return None;
        }
        let corners = surface.faces.corners[face].map(|v| vertices[v as usize]);
        Some(face_frame::turn(&face_frame::frame(kind, corners)?, rest[face].as_ref()?))
    };
    (0..surface.faces.corners.len()).into_par_iter().with_min_len(1024).map(turn).collect()
}

/// A rotation per used vertex, and how three of them become one.
pub(in super::super) struct VertexTurns<'a> {
    /// Per vertex; `None` for unused and degenerate ones.
    turns: Vec<Option<Quaternion<f32>>>,
    combine: Combine,
    seats: &'a [Seat],
}

enum Combine {
    /// Eq. 7 with barycentric weights.
    Average(Solver),
    /// The normalised weighted sum, signs as they come or aligned to the first corner.
    Sum(SignPolicy),
}

impl<'a> VertexTurns<'a> {
    /// Eq. 7 at every used vertex with its own skinning weights.
    pub(super) fn averaged(
        solver: Solver,
        joints: &Joints,
        body: &PosedBody<'_>,
        surface: &'a Surface,
    ) -> Self {
        let turn = |vertex: usize| {
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
        let turns = (0..surface.vertex_used.len()).into_par_iter().with_min_len(512).map(turn).collect();
        Self { turns, combine: Combine::Average(solver), seats: &surface.seats }
    }

    /// SplattingAvatar: the sum of the rotations of all faces around a vertex, weighted by their area at rest, under a
    /// sign policy.
    pub(super) fn summed(policy: SignPolicy, body: &PosedBody<'_>, surface: &'a Surface) -> Self {
        let faces = &surface.faces;
        let used = |face: usize| faces.corners[face].iter().any(|&v| surface.vertex_used[v as usize]);
        let face_turns = face_turns(FaceFrame::SplattingAvatar, body, surface, used);
        let mut sums = vec![([0.0f32; 4], None); surface.vertex_used.len()];
        for (face, turn) in face_turns.iter().enumerate() {
            let Some(turn) = *turn else { continue };
            for &vertex in &faces.corners[face] {
                let (sum, first) = &mut sums[vertex as usize];
                let signed = policy.apply(turn, *first.get_or_insert(turn));
                for k in 0..4 {
                    sum[k] += faces.areas[face] * signed[k];
                }
            }
        }
        let areas = &faces.areas;
        let largest = areas.iter().copied().fold(0.0f32, f32::max);
        let turns = sums.into_iter().map(|(sum, _)| unit(sum, CANCELLED * largest)).collect();
        Self { turns, combine: Combine::Sum(policy), seats: &surface.seats }
    }

    /// The turns of a block.
    #[inline(never)]
    pub(super) fn of_block(&self, input: &BlockInput<'_>) -> [Lanes; 4] {
        let mut turns = splat(rotation::identity());
        for lane in 0..LANES {
            let turn = self.combined(input.gaussian(lane));
            put(&mut turns, lane, turn.unwrap_or_else(|| input.average_of(lane)));
        }
        turns
    }

    fn combined(&self, gaussian: usize) -> Option<Quaternion<f32>> {
        let seat = &self.seats[gaussian];
        let weights = seat.weights();
        let [a, b, c] = seat.corners.map(|vertex| self.turns[vertex as usize]);
        let turns = [a?, b?, c?];
        match self.combine {
            Combine::Average(solver) => {
                let average =
                    average_rotation(&turns.map(|q| q.map(f64::from)), &weights.map(f64::from), solver)?;
                Some(average.map(|c| c as f32))
            }
            Combine::Sum(policy) => {
                let mut sum = [0.0; 4];
                for (turn, weight) in turns.iter().zip(weights) {
                    let aligned = policy == SignPolicy::AlignToFirst;
                    let signed = if aligned { policy.apply(*turn, turns[0]) } else { *turn };
                    for k in 0..4 {
                        sum[k] += weight * signed[k];
                    }
                }
                unit(sum, CANCELLED)
            }
        }
    }
}

/// The quaternion of unit length, unless it is not longer than `floor`.
fn unit(q: Quaternion<f32>, floor: f32) -> Option<Quaternion<f32>> {
    let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
    if length > floor { rotation::normalize(q) } else { None }
}
