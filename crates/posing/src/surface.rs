//! Where Gaussians are embedded in the mesh.

use super::error::expect_count;
use super::nearest::NearestFace;
use super::rest_faces::RestFaces;
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::scene::{FaceBinding, PosedMesh, RestBody, SceneError};

/// Where a Gaussian is embedded in the mesh: a face, a point of its plane, and a distance from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Embedding {
    /// Face index.
    pub(crate) face: u32,
    /// Its vertices.
    pub(crate) corners: [u32; 3],
    /// As given for face-bound Gaussians, of the nearest point for others. May leave \[0, 1\].
    pub(crate) barycentric: [f32; 3],
    /// Metres along the interpolated vertex normal; 0 for Gaussians with weights of their own.
    pub(crate) offset: f32,
}

impl Embedding {
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

    /// The derivatives with respect to the corners and to their normals, from that with respect to the point.
    pub(crate) fn mesh_adjoint(&self, mesh: &PosedMesh, gradient: Vec3) -> [(Vec3, Vec3); 3] {
        let normals = self.corners.map(|v| mesh.normals[v as usize]);
        let [a, b, c] = self.barycentric;
        let sum = normals[0] * a + normals[1] * b + normals[2] * c;
        let unit = sum.normalize_or_zero();
        let of_sum = if unit == Vec3::ZERO || self.offset == 0.0 {
            Vec3::ZERO
        } else {
            (gradient - unit * unit.dot(gradient)) * (self.offset / unit.dot(sum))
        };
        self.barycentric.map(|share| (gradient * share, of_sum * share))
    }

    /// With an offset that has grown with the joints. A factor of 1 changes no bit.
    pub(crate) fn grown(&self, growth: f32) -> Self {
        Self { offset: self.offset * growth, ..*self }
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
    pub(crate) embeddings: Vec<Embedding>,
    /// Per face: a Gaussian is embedded in it.
    pub(crate) face_used: Vec<bool>,
    /// Per vertex: it is a corner of such a face.
    pub(crate) vertex_used: Vec<bool>,
}

impl Surface {
    pub(crate) fn new(embeddings: Vec<Embedding>, body: &RestBody) -> Self {
        let faces = RestFaces::new(body);
        let mut face_used = vec![false; body.faces.len()];
        let mut vertex_used = vec![false; body.vertices.len()];
        for embedding in &embeddings {
            face_used[embedding.face as usize] = true;
            embedding.corners.iter().for_each(|&v| vertex_used[v as usize] = true);
        }
        Self { faces, embeddings, face_used, vertex_used }
    }

    /// Takes over coordinates and offsets; the faces must be the same.
    pub(crate) fn update(&mut self, binding: &FaceBinding) -> Result<(), SceneError> {
        expect_count("face", binding.faces.len(), self.embeddings.len())?;
        expect_count("barycentric", binding.barycentric.len(), self.embeddings.len())?;
        expect_count("offset", binding.offsets.len(), self.embeddings.len())?;
        let mut faces = binding.faces.iter().zip(&self.embeddings);
        if let Some(i) = faces.position(|(&face, own)| face != own.face) {
            let expected = format!("face {} as at binding (bind anew)", self.embeddings[i].face);
            return Err(SceneError::new(
                format!("face[{i}]"),
                format!("face {}", binding.faces[i]),
                expected,
            ));
        }
        let places = binding.barycentric.iter().zip(&binding.offsets);
        for (own, (&barycentric, &offset)) in self.embeddings.iter_mut().zip(places) {
            (own.barycentric, own.offset) = (barycentric, offset);
        }
        Ok(())
    }

    /// The points of the rest mesh in which the Gaussians from index `start` on are embedded.
    pub(crate) fn rest_means(&self, start: usize, means: &mut [Vec3]) {
        for (mean, embedding) in means.iter_mut().zip(&self.embeddings[start..]) {
            *mean = embedding.point(&self.faces.mesh);
        }
    }
}

/// The points of the rest mesh nearest to the means. `before` are their embeddings before they moved, if anyone knows.
pub(crate) fn nearest(
    means: &[Vec3],
    body: &RestBody,
    faces: &NearestFace<'_>,
    before: Option<&[Embedding]>,
) -> Vec<Embedding> {
    let embedding = |(i, mean): (usize, &Vec3)| {
        let guess = before.and_then(|embeddings| embeddings.get(i)).map(|own| own.face);
        let point = faces.nearest(mean.as_dvec3(), guess);
        let barycentric = point.barycentric.map(|b| b as f32);
        Embedding { face: point.face, corners: body.faces[point.face as usize], barycentric, offset: 0.0 }
    };
    means.par_iter().enumerate().map(embedding).collect()
}

/// The embeddings of face-bound Gaussians.
pub(crate) fn given(binding: &FaceBinding, body: &RestBody) -> Vec<Embedding> {
    let places = binding.faces.iter().zip(&binding.barycentric).zip(&binding.offsets);
    let embedding = |((&face, &barycentric), &offset)| {
        let corners = body.faces[face as usize];
        Embedding { face, corners, barycentric, offset }
    };
    places.map(embedding).collect()
}
