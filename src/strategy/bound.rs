//! An avatar bound to a body: everything that does not depend on the pose, computed once.

use super::layout::{self, Canonical, Chunk};
use super::nearest::NearestFace;
use super::rest_faces::RestFaces;
use super::{CovarianceChoice, StrategyError, surfel};
use crate::scene::{Avatar, Binding, FaceBinding, RestBody, SkinWeights};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::OnceLock;

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
    pub(crate) fn point(&self, vertices: &[Vec3], normals: &[Vec3]) -> Vec3 {
        let [i, j, k] = [self.corners[0] as usize, self.corners[1] as usize, self.corners[2] as usize];
        let [a, b, c] = self.barycentric;
        let normal = normals[i] * a + normals[j] * b + normals[k] * c;
        vertices[i] * a + vertices[j] * b + vertices[k] * c + normal.normalize_or_zero() * self.offset
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

/// A canonical avatar and how it hangs on a body.
///
/// * Gaussians with weights of their own also know the point of the rest mesh nearest to their mean (the lowest face
///   index where several are equally near): face strategies turn them with that face.
/// * Face-bound Gaussians also have skinning weights, the barycentric mix of the rows of the corners (coordinates below
///   zero count as zero). Their canonical mean is not read: they sit where the binding says.
/// * Static Gaussians stay as they are under every strategy.
#[derive(Clone, Debug)]
pub struct BoundAvatar {
    chunks: Vec<Chunk>,
    discs: OnceLock<Vec<Chunk>>,
    pub(crate) means: Vec<Vec3>,
    pub(crate) surface: Option<Surface>,
    pub(crate) moves: Moves,
    pub(crate) opacities: Vec<f32>,
    pub(crate) sh_degree: usize,
    pub(crate) sh: Vec<[f32; 3]>,
    pub(crate) shape: BodyShape,
}

/// How means move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moves {
    /// Not at all.
    Not,
    /// By Eq. 6.
    ByWeights,
    /// With the posed mesh.
    WithFaces,
}

/// The counts of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BodyShape {
    joints: usize,
    vertices: usize,
    faces: usize,
}

impl BodyShape {
    pub(crate) fn of(body: &RestBody) -> Self {
        Self { joints: body.skeleton.num_joints(), vertices: body.vertices.len(), faces: body.faces.len() }
    }
}

impl std::fmt::Display for BodyShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} joints, {} vertices, {} faces", self.joints, self.vertices, self.faces)
    }
}

impl BoundAvatar {
    /// Binds an avatar to a body in its rest pose.
    ///
    /// # Errors
    /// [`StrategyError::Scene`] for whatever [`Avatar::validate`] or [`RestBody::validate`] finds wrong.
    pub fn new(avatar: &Avatar, body: &RestBody) -> Result<Self, StrategyError> {
        body.validate()?;
        avatar.validate(Some(body))?;
        let gaussians = &avatar.gaussians;
        let (seats, mixed, moves) = match &avatar.binding {
            Binding::Static => (None, None, Moves::Not),
            Binding::Vertex(_) => (nearest_seats(&gaussians.means, body), None, Moves::ByWeights),
            Binding::Face(binding) => {
                let seats = given_seats(binding, body);
                let mixed = mixed_weights(&seats, body)?;
                (Some(seats), Some(mixed), Moves::WithFaces)
            }
        };
        let surface = seats.map(|seats| Surface::new(seats, body));
        let means = match (moves, &surface) {
            (Moves::WithFaces, Some(surface)) => rest_means(surface, body),
            _ => gaussians.means.clone(),
        };
        let weights = match &avatar.binding {
            Binding::Vertex(weights) => Some(weights),
            Binding::Static | Binding::Face(_) => mixed.as_ref(),
        };
        let scales: Vec<Vec3> = gaussians.log_scales.iter().map(|s| s.map(f32::exp)).collect();
        let rotations = gaussians.unit_rotations();
        let canonical = Canonical { means: &means, rotations: &rotations, scales: &scales };
        Ok(Self {
            chunks: layout::chunks(&canonical, weights),
            discs: OnceLock::new(),
            means,
            surface,
            moves,
            opacities: gaussians.opacities(),
            sh_degree: gaussians.sh_degree,
            sh: gaussians.sh.clone(),
            shape: BodyShape::of(body),
        })
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// The Gaussians as a covariance choice reads them. Discs are made when first asked for.
    pub(crate) fn chunks(&self, choice: CovarianceChoice) -> &[Chunk] {
        match (choice, &self.surface) {
            (CovarianceChoice::Surfel, Some(surface)) => {
                self.discs.get_or_init(|| surfel::discs(&self.chunks, surface))
            }
            _ => &self.chunks,
        }
    }

    /// SH coefficients per Gaussian and channel.
    pub(crate) fn sh_count(&self) -> usize {
        (self.sh_degree + 1).pow(2)
    }

    /// The face and the barycentric coordinates of Gaussian `i`; `None` for static avatars and bodies without faces.
    pub fn face(&self, i: usize) -> Option<(u32, [f32; 3])> {
        let seat = self.surface.as_ref()?.seats.get(i)?;
        Some((seat.face, seat.barycentric))
    }
}

impl Surface {
    fn new(seats: Vec<Seat>, body: &RestBody) -> Self {
        let faces = RestFaces::new(body);
        let mut face_used = vec![false; body.faces.len()];
        let mut vertex_used = vec![false; body.vertices.len()];
        for seat in &seats {
            face_used[seat.face as usize] = true;
            seat.corners.iter().for_each(|&v| vertex_used[v as usize] = true);
        }
        Self { faces, seats, face_used, vertex_used }
    }
}

fn nearest_seats(means: &[Vec3], body: &RestBody) -> Option<Vec<Seat>> {
    let tree = NearestFace::new(body)?;
    let seat = |mean: &Vec3| {
        let point = tree.nearest(mean.as_dvec3());
        let barycentric = point.barycentric.map(|b| b as f32);
        Seat { face: point.face, corners: body.faces[point.face as usize], barycentric, offset: 0.0 }
    };
    Some(means.par_iter().map(seat).collect())
}

fn given_seats(binding: &FaceBinding, body: &RestBody) -> Vec<Seat> {
    let places = binding.faces.iter().zip(&binding.barycentric).zip(&binding.offsets);
    let seat = |((&face, &barycentric), &offset)| {
        let corners = body.faces[face as usize];
        Seat { face, corners, barycentric, offset }
    };
    places.map(seat).collect()
}

fn mixed_weights(seats: &[Seat], body: &RestBody) -> Result<SkinWeights, StrategyError> {
    let row = |seat: &Seat| {
        let weights = seat.weights();
        body.weights.mixed(&[0, 1, 2].map(|k: usize| (seat.corners[k] as usize, f64::from(weights[k]))))
    };
    let rows: Vec<_> = seats.par_iter().map(row).collect();
    Ok(SkinWeights::from_rows(rows, body.skeleton.num_joints())?)
}

fn rest_means(surface: &Surface, body: &RestBody) -> Vec<Vec3> {
    let vertices: Vec<Vec3> = body.vertices.iter().map(|v| v.as_vec3()).collect();
    let normals = crate::scene::body::vertex_normals(&body.vertices, &body.faces);
    let normals: Vec<Vec3> = normals.iter().map(|n| n.as_vec3()).collect();
    surface.seats.iter().map(|seat| seat.point(&vertices, &normals)).collect()
}
