//! Rotations read from the mesh, walked backwards: from R of the Gaussians to faces, from faces to the corners of the posed mesh,
//! and from vertices to the joints that they average.
//!
//! What falls back on the average of the skinning weights (faces without area, sums that cancel) asks for nothing.

use super::super::face_frame::{self, FaceFrame};
use super::super::joints::Joints;
use super::super::surface::Surface;
use super::average;
use super::faces::{Combine, VertexRotations, around_vertices, for_each_signed};
use glam::{DVec3, Vec3};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::rotation::{SignPolicy, adjoint};
use skinsplat_core::math::{Quaternion, dot4};
use skinsplat_core::scene::{BodyGradient, PosedBody};

/// What a Gaussian asks of its face, or the Gaussians of a face together.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OfFace {
    /// With respect to a further rotation.
    pub(crate) torque: DVec3,
    /// With respect to HAHA's size, relative to that at rest.
    pub(crate) growth: f64,
}

/// What is asked of every face, summed in the order of the Gaussians.
pub(crate) struct FaceSums<'a> {
    kind: FaceFrame,
    faces: Vec<OfFace>,
    surface: &'a Surface,
}

impl<'a> FaceSums<'a> {
    pub(crate) fn new(kind: FaceFrame, surface: &'a Surface) -> Self {
        Self { kind, faces: vec![OfFace::default(); surface.faces.corners.len()], surface }
    }

    /// Adds what one Gaussian asks of its face.
    pub(crate) fn add(&mut self, gaussian: usize, own: OfFace) {
        let sum = &mut self.faces[self.surface.embeddings[gaussian].face as usize];
        sum.torque += own.torque;
        sum.growth += own.growth;
    }

    /// To the corners of the posed mesh.
    pub(crate) fn to_vertices(&self, body: &PosedBody<'_>, gradient: &mut BodyGradient) {
        let mesh = body.mesh();
        let (of_vertices, _) = gradient.mesh_mut(mesh.vertices.len());
        let rest = &self.surface.faces;
        for (face, own) in self.faces.iter().enumerate() {
            if own.torque == DVec3::ZERO && own.growth == 0.0 {
                continue;
            }
            let corners = rest.corners[face].map(|v| mesh.vertices[v as usize]);
            let mut of_corners = face_frame::frame_adjoint(self.kind, corners, own.torque);
            if own.growth != 0.0 {
                let factor = own.growth / f64::from(rest.sizes[face]);
                let of_size = face_frame::haha_size_adjoint(corners);
                of_corners.iter_mut().zip(of_size).for_each(|(sum, own)| *sum += own * factor);
            }
            for (&vertex, own) in rest.corners[face].iter().zip(of_corners) {
                of_vertices[vertex as usize] += own;
            }
        }
    }
}

impl VertexRotations<'_> {
    /// To the joints, or to the posed mesh, from the derivative with respect to a further rotation of each Gaussian.
    pub(crate) fn to_body(
        &self,
        torques: &[OfFace],
        joints: &Joints,
        body: &PosedBody<'_>,
        surface: &Surface,
        gradient: &mut BodyGradient,
    ) {
        let mut of_vertices = vec![[0.0; 4]; self.quats.len()];
        for (gaussian, own) in torques.iter().enumerate().filter(|(_, own)| own.torque != DVec3::ZERO) {
            self.to_vertices(gaussian, own.torque.to_array(), &mut of_vertices);
        }
        match self.combine {
            Combine::Average(solver) => self.averages_to_joints(solver, &of_vertices, joints, body, gradient),
            Combine::Sum(policy) => self.sums_to_faces(policy, &of_vertices, body, surface, gradient),
        }
    }

    /// Adds what one Gaussian asks of the quaternions of its corners.
    fn to_vertices(&self, gaussian: usize, torque: [f64; 3], of_vertices: &mut [Quaternion<f64>]) {
        let embedding = &self.embeddings[gaussian];
        let weights = embedding.weights().map(f64::from);
        let [Some(a), Some(b), Some(c)] = embedding.corners.map(|vertex| self.quats[vertex as usize]) else {
            return;
        };
        let quats = [a, b, c].map(|q| q.map(f64::from));
        let mut add = |corner: usize, own: Quaternion<f64>| {
            let sum = &mut of_vertices[embedding.corners[corner] as usize];
            (0..4).for_each(|k| sum[k] += own[k]);
        };
        match self.combine {
            Combine::Average(solver) => {
                average::adjoint(quats.into_iter().zip(weights), solver, torque, |corner, own| {
                    add(corner, adjoint::from_torque(quats[corner], own));
                });
            }
            Combine::Sum(policy) => {
                let aligned = policy == SignPolicy::AlignToFirst;
                let sign = |q: &Quaternion<f64>| if aligned && dot4(*q, quats[0]) < 0.0 { -1.0 } else { 1.0 };
                let shares: [f64; 3] = std::array::from_fn(|k| sign(&quats[k]) * weights[k]);
                let mut sum = [0.0; 4];
                for (q, share) in quats.iter().zip(shares) {
                    (0..4).for_each(|k| sum[k] += share * q[k]);
                }
                let length = dot4(sum, sum).sqrt();
                if length > 0.0 {
                    let of_unit = adjoint::from_torque(sum.map(|c| c / length), torque);
                    (0..3).for_each(|corner| add(corner, of_unit.map(|c| c * shares[corner] / length)));
                }
            }
        }
    }

    /// Each vertex averages its joints.
    fn averages_to_joints(
        &self,
        solver: Solver,
        of_vertices: &[Quaternion<f64>],
        joints: &Joints,
        body: &PosedBody<'_>,
        gradient: &mut BodyGradient,
    ) {
        for (vertex, own) in of_vertices.iter().enumerate().filter(|(_, own)| **own != [0.0; 4]) {
            let Some(quat) = self.quats[vertex] else { continue };
            let torque = adjoint::to_torque(quat.map(f64::from), *own);
            let (indices, weights) = body.rest.weights.row(vertex);
            let bone = |(&joint, &weight): (&u16, &f32)| {
                (joints.rotation_f64[usize::from(joint)], f64::from(weight))
            };
            average::adjoint(indices.iter().zip(weights).map(bone), solver, torque, |bone, own| {
                gradient.torques[usize::from(indices[bone])] += DVec3::from_array(own);
            });
        }
    }

    /// Each vertex sums the rotations of the faces around it.
    fn sums_to_faces(
        &self,
        policy: SignPolicy,
        of_vertices: &[Quaternion<f64>],
        body: &PosedBody<'_>,
        surface: &Surface,
        gradient: &mut BodyGradient,
    ) {
        let face_rotations = around_vertices(body, surface);
        let areas = &surface.faces.areas;
        let mut lengths = vec![0.0; of_vertices.len()];
        // The length of a sum is its part along what it was made.
        for_each_signed(policy, &face_rotations, surface, |vertex, face, signed| {
            if let Some(unit) = self.quats[vertex] {
                lengths[vertex] += f64::from(areas[face] * dot4(unit, signed));
            }
        });
        let mut sums = FaceSums::new(FaceFrame::SplattingAvatar, surface);
        for_each_signed(policy, &face_rotations, surface, |vertex, face, signed| {
            let (own, Some(unit)) = (of_vertices[vertex], self.quats[vertex]) else { return };
            if own != [0.0; 4] && lengths[vertex] > 0.0 {
                let of_sum = adjoint::normalize(unit.map(f64::from), 1.0 / lengths[vertex], own);
                let torque = adjoint::to_torque(signed.map(f64::from), of_sum);
                sums.faces[face].torque += DVec3::from_array(torque) * f64::from(areas[face]);
            }
        });
        sums.to_vertices(body, gradient);
    }
}

/// The mean of a Gaussian that follows the centroid of its face: a third to each corner.
pub(crate) fn to_centroid(surface: &Surface, gaussian: usize, of_mean: Vec3, of_vertices: &mut [DVec3]) {
    for &vertex in &surface.embeddings[gaussian].corners {
        of_vertices[vertex as usize] += of_mean.as_dvec3() / 3.0;
    }
}
