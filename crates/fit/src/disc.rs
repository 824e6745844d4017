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
    /// Of the part of the surface that it stands for, square metres.
    pub(super) area: f64,
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

/// Every one of `n` draws from the discs, evenly by area: their indices and the discs they become, each as large as its share of
/// the whole. Discs follow a curve through space that leaves no region early, so that neighbours share their areas.
pub(super) fn sampled(discs: &[Disc], n: usize) -> Vec<(usize, Disc)> {
    let mut order: Vec<usize> = (0..discs.len()).collect();
    let (low, high) = discs.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), disc| {
        (low.min(disc.centre), high.max(disc.centre))
    });
    let cells = (high - low).max_element().max(f64::MIN_POSITIVE);
    order.sort_by_key(|&i| (interleaved((discs[i].centre - low) / cells), i));
    let share = discs.iter().map(|disc| disc.area).sum::<f64>() / n as f64;
    let (mut drawn, mut below) = (Vec::with_capacity(n), 0.0);
    for i in order {
        below += discs[i].area;
        if drawn.len() < n && below > share * (drawn.len() as f64 + 0.5) {
            let Disc { centre, normal, .. } = discs[i];
            let across = DMat3::IDENTITY - outer(normal, normal);
            let moment = across * (share / (4.0 * std::f64::consts::PI));
            drawn.push((i, Disc { centre, normal, area: share, moment }));
        }
    }
    drawn
}

/// The bits of three coordinates in \[0, 1\] in turns (Morton's order).
fn interleaved(at: DVec3) -> u64 {
    let cells = (at * 1023.0).clamp(DVec3::ZERO, DVec3::splat(1023.0)).to_array().map(|c| c as u64);
    (0..10).fold(0, |code, bit| {
        cells.iter().enumerate().fold(code, |code, (axis, cell)| code | (cell >> bit & 1) << (3 * bit + axis))
    })
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
        area: weight,
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
        let normal = (b - a).cross(c - a);
        let (area, moment) = (normal.length() / 2.0, moment * (1.0 / 12.0));
        Disc { centre, normal: normal.normalize_or_zero(), area, moment }
    };
    faces.iter().map(disc).collect()
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
