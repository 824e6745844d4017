//! Where Gaussians sit on the mesh.

use super::bound::expect_count;
use super::nearest::NearestFace;
use super::rest_faces::RestFaces;
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::scene::{FaceBinding, PosedMesh, RestBody, SceneError};

/// Where a Gaussian sits on the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seat {
    /// Face index.
    pub(crate) face: u32,
    /// Its vertices.
    pub(crate) corners: [u32; 3],
    /// As given for face-bound Gaussians, of the nearest point for others. May leave \[0, 1\].
    pub(crate) barycentric: [f32; 3],
    /// Metres along the interpolated vertex normal; 0 for Gaussians with weights of their own.
    pub(crate) offset: f32,
}

impl Seat {
    /// The point on a mesh: `Σ b v + unit(Σ b n) offset`.
    #[inline]
    pub(crate) fn point(&self, PosedMesh { vertices, normals }: &PosedMesh) -> Vec3 {
        let [i, j, k] = [self.corners[0] as usize, self.corners[1] as usize, self.corners[2] as usize];
        let [a, b, c] = self.barycentric;
        let normal = normals[i] * a + normals[j] * b + normals[k] * c;
        vertices[i] * a + vertices[j] * b + vertices[k] * c + normal.normalize_or_zero() * self.offset
    }

    /// The derivatives with respect to the barycentric coordinates, each by itself, and the offset, from that with respect
    /// to the point. Where the normals cancel the offset does nothing, and neither do they.
    #[inline]
    pub(crate) fn point_adjoint(&self, mesh: &PosedMesh, gradient: Vec3) -> ([f32; 3], f32) {
        let normals = self.corners.map(|v| mesh.normals[v as usize]);
        let [a, b, c] = self.barycentric;
        let sum = normals[0] * a + normals[1] * b + normals[2] * c;
        let unit = sum.normalize_or_zero();
        let along = unit.dot(gradient);
        let of_sum = (gradient - unit * along) * (self.offset * unit.dot(sum).recip());
        let of_sum = if unit == Vec3::ZERO { Vec3::ZERO } else { of_sum };
        let coordinate =
            |k: usize| mesh.vertices[self.corners[k] as usize].dot(gradient) + normals[k].dot(of_sum);
        ([coordinate(0), coordinate(1), coordinate(2)], along)
    }

    /// The barycentric coordinates as weights: cut at zero, summing to one.
    pub(crate) fn weights(&self) -> [f32; 3] {
        let cut = self.barycentric.map(|b| b.max(0.0));
        let sum: f32 = cut.iter().sum();
        cut.map(|b| b / sum)
    }
}

/// What Gaussians know of the mesh.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// All faces of the body.
    pub(crate) faces: RestFaces,
    /// One per Gaussian.
    pub(crate) seats: Vec<Seat>,
    /// Per face: a Gaussian sits on it.
    pub(crate) face_used: Vec<bool>,
    /// Per vertex: it is a corner of such a face.
    pub(crate) vertex_used: Vec<bool>,
}

impl Surface {
    pub(crate) fn new(seats: Vec<Seat>, body: &RestBody) -> Self {
        let faces = RestFaces::new(body);
        let mut face_used = vec![false; body.faces.len()];
        let mut vertex_used = vec![false; body.vertices.len()];
        for seat in &seats {
            face_used[seat.face as usize] = true;
            seat.corners.iter().for_each(|&v| vertex_used[v as usize] = true);
        }
        Self { faces, seats, face_used, vertex_used }
    }

    /// Takes over coordinates and offsets; the faces must be the same.
    pub(crate) fn reseat(&mut self, binding: &FaceBinding) -> Result<(), SceneError> {
        expect_count("face", binding.faces.len(), self.seats.len())?;
        expect_count("barycentric", binding.barycentric.len(), self.seats.len())?;
        expect_count("offset", binding.offsets.len(), self.seats.len())?;
        let mut faces = binding.faces.iter().zip(&self.seats);
        if let Some(i) = faces.position(|(&face, seat)| face != seat.face) {
            let expected = format!("face {} as at binding (bind anew)", self.seats[i].face);
            return Err(SceneError::new(
                format!("face[{i}]"),
                format!("face {}", binding.faces[i]),
                expected,
            ));
        }
        let places = binding.barycentric.iter().zip(&binding.offsets);
        for (seat, (&barycentric, &offset)) in self.seats.iter_mut().zip(places) {
            (seat.barycentric, seat.offset) = (barycentric, offset);
        }
        Ok(())
    }

    /// Where the Gaussians from index `start` on sit on the rest mesh.
    pub(crate) fn rest_means(&self, start: usize, means: &mut [Vec3]) {
        for (mean, seat) in means.iter_mut().zip(&self.seats[start..]) {
            *mean = seat.point(&self.faces.mesh);
        }
    }
}

/// The points of the rest mesh nearest to the means. `before` are their seats before they moved, if anyone knows.
pub(crate) fn nearest(
    means: &[Vec3],
    body: &RestBody,
    faces: &NearestFace<'_>,
    before: Option<&[Seat]>,
) -> Vec<Seat> {
    let seat = |(i, mean): (usize, &Vec3)| {
        let guess = before.and_then(|seats| seats.get(i)).map(|seat| seat.face);
        let point = faces.nearest(mean.as_dvec3(), guess);
        let barycentric = point.barycentric.map(|b| b as f32);
        Seat { face: point.face, corners: body.faces[point.face as usize], barycentric, offset: 0.0 }
    };
    means.par_iter().enumerate().map(seat).collect()
}

/// The seats of face-bound Gaussians.
pub(crate) fn given(binding: &FaceBinding, body: &RestBody) -> Vec<Seat> {
    let places = binding.faces.iter().zip(&binding.barycentric).zip(&binding.offsets);
    let seat = |((&face, &barycentric), &offset)| {
        let corners = body.faces[face as usize];
        Seat { face, corners, barycentric, offset }
    };
    places.map(seat).collect()
}
