//! The shape of a Gaussian that covers its part of a surface: flat, as wide as the part's second moment in the tangent
//! plane.

use super::options::Cover;
use glam::{DMat3, DQuat, DVec3, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::scene::body::vertex_normals;

/// A flat Gaussian on a surface, in the rest pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) centre: DVec3,
    pub(super) normal: DVec3,
    /// Second moment of the part of the surface that it stands for, about the centre, square metres.
    pub(super) moment: DMat3,
}

impl Disc {
    /// Quaternion (w, x, y, z) and log standard deviations: in the tangent plane `scale` times those of the part, along
    /// the normal `thickness` times their geometric mean.
    pub(super) fn gaussian(&self, scale: f64, thickness: f64, cover: &Cover) -> ([f32; 4], Vec3) {
        let normal = self.normal.try_normalize().unwrap_or(DVec3::Z);
        let (u, v) = normal.any_orthonormal_pair();
        let moment = |a: DVec3, b: DVec3| a.dot(self.moment * b);
        let (uu, uv, vv) = (moment(u, u), moment(u, v), moment(v, v));
        let (mean, difference) = ((uu + vv) / 2.0, (uu - vv) / 2.0);
        let spread = portable::hypot(difference, uv);
        let angle = portable::atan2(uv, difference) / 2.0;
        let (sine, cosine) = portable::sin_cos(angle);
        let major = u * cosine + v * sine;
        let sigma = |variance: f64| (scale * variance.max(0.0).sqrt()).max(cover.least_sigma);
        let long = sigma(mean + spread);
        let short = sigma(mean - spread).max(long / cover.largest_aspect);
        let thin = (thickness * (long * short).sqrt()).max(cover.least_sigma);
        let q = DQuat::from_mat3(&DMat3::from_cols(major, normal.cross(major), normal)).normalize();
        ([q.w, q.x, q.y, q.z].map(|c| c as f32), DVec3::new(long, short, thin).map(portable::ln).as_vec3())
    }
}

/// One disc per vertex: its part is the surface weighted by the vertex's hat function (one at the vertex, linear, zero on
/// the far edges), so that the parts of all vertices together weigh every point of the surface by one.
pub(super) fn of_vertices(vertices: &[DVec3], faces: &[[u32; 3]]) -> Vec<Disc> {
    let normals = vertex_normals(vertices, faces);
    let mut moments = vec![(DMat3::ZERO, 0.0); vertices.len()];
    for face in faces {
        let corners = face.map(|i| vertices[i as usize]);
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0;
        for k in 0..3 {
            let (u, v) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
            // ∫ λ0 λ1² = A/30, ∫ λ0 λ1 λ2 = A/60, ∫ λ0 = A/3
            let (moment, weight) = &mut moments[face[k] as usize];
            *moment +=
                (outer(u, u) + outer(v, v)) * (area / 30.0) + (outer(u, v) + outer(v, u)) * (area / 60.0);
            *weight += area / 3.0;
        }
    }
    let disc = |(i, (moment, weight)): (usize, (DMat3, f64))| Disc {
        centre: vertices[i],
        normal: normals[i],
        moment: if weight > 0.0 { moment * weight.recip() } else { DMat3::ZERO },
    };
    moments.into_iter().enumerate().map(disc).collect()
}

/// One disc per face, at its centroid, with the second moment of the triangle.
pub(super) fn of_faces(vertices: &[DVec3], faces: &[[u32; 3]]) -> Vec<Disc> {
    let disc = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        let centre = (a + b + c) / 3.0;
        let moment =
            [a, b, c].iter().map(|p| outer(*p - centre, *p - centre)).fold(DMat3::ZERO, |s, m| s + m);
        Disc { centre, normal: (b - a).cross(c - a).normalize_or_zero(), moment: moment * (1.0 / 12.0) }
    };
    faces.iter().map(disc).collect()
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
