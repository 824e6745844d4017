//! Triangles for a cloud of vertices with normals.
//!
//! A mesh whose triangles were not written down is still needed as a surface: to see which vertices a camera sees, and for
//! silhouettes. Each vertex is the middle of a fan of triangles to its nearest neighbours on the same side of the body, in the
//! order in which they lie around its normal. The triangles overlap, and cover what the vertices sample.

use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Neighbours of a vertex.
const NEIGHBOURS: usize = 6;

/// Neighbours' normals are turned by less than this (cosine): the other side of a hand is none.
const SAME_SIDE: f64 = -0.3;

/// No triangle spans more than this around its vertex, radians: there is a border.
const WIDEST: f64 = 2.7;

/// Every pair of vertices is looked at; larger clouds get no triangles.
const MAX_VERTICES: usize = 50_000;

/// Triangles, counter-clockwise seen from where the normals point; none for more than [`MAX_VERTICES`] vertices.
pub(super) fn of_points(points: &[DVec3], normals: &[DVec3]) -> Vec<[u32; 3]> {
    if points.len() > MAX_VERTICES {
        return Vec::new();
    }
    let fans: Vec<Vec<[u32; 3]>> =
        (0..points.len()).into_par_iter().map(|v| fan(v, points, normals)).collect();
    let mut seen = BTreeSet::new();
    let mut new = |face: &[u32; 3]| {
        let mut corners = *face;
        corners.sort_unstable();
        seen.insert(corners)
    };
    fans.into_iter().flatten().filter(|face| new(face)).collect()
}

fn fan(v: usize, points: &[DVec3], normals: &[DVec3]) -> Vec<[u32; 3]> {
    let (centre, normal) = (points[v], normals[v].normalize_or_zero());
    let side = if normal.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
    let right = (side - normal * normal.dot(side)).normalize_or_zero();
    let up = normal.cross(right);
    let around = neighbours(v, points, normals).into_iter().map(|n| {
        let to = points[n] - centre;
        (skinsplat_core::math::portable::atan2(to.dot(up), to.dot(right)), n)
    });
    let mut around: Vec<(f64, usize)> = around.collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let face = |i: usize| {
        let ((from, a), (to, b)) = (around[i], around[(i + 1) % around.len()]);
        let turn = (to - from).rem_euclid(2.0 * std::f64::consts::PI);
        let area = (points[a] - centre).cross(points[b] - centre);
        (turn < WIDEST && area.dot(normal) > 0.0).then_some([v as u32, a as u32, b as u32])
    };
    (0..around.len()).filter_map(face).collect()
}

/// The nearest vertices elsewhere (a seam of the texture repeats a vertex in place), the first of each place.
fn neighbours(v: usize, points: &[DVec3], normals: &[DVec3]) -> Vec<usize> {
    let (centre, normal) = (points[v], normals[v].normalize_or_zero());
    let mut nearest: Vec<(f64, usize)> = Vec::with_capacity(NEIGHBOURS + 1);
    for (i, point) in points.iter().enumerate() {
        let distance = (*point - centre).length_squared();
        let too_far = nearest.len() == NEIGHBOURS && nearest.last().is_some_and(|(d, _)| distance >= *d);
        if too_far || distance < 1e-12 || normals[i].normalize_or_zero().dot(normal) < SAME_SIDE {
            continue;
        }
        if nearest.iter().any(|(_, other)| points[*other].distance_squared(*point) < 1e-12) {
            continue;
        }
        let place = nearest.partition_point(|(d, _)| *d <= distance);
        nearest.insert(place, (distance, i));
        nearest.truncate(NEIGHBOURS);
    }
    nearest.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::portable;

    #[test]
    fn a_sphere_of_points_is_covered_and_faces_outwards() {
        let count = 400;
        let points: Vec<DVec3> = (0..count)
            .map(|i| {
                let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
                let (sin, cos) = portable::sin_cos(2.399963 * i as f64);
                DVec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin)
            })
            .collect();
        let faces = of_points(&points, &points);
        assert!(faces.len() >= 2 * (count - 2) && faces.len() < 6 * count, "{} faces", faces.len());
        let mut area = 0.0;
        for face in &faces {
            let [a, b, c] = face.map(|i| points[i as usize]);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a + b + c) > 0.0, "{face:?} faces inwards");
            area += normal.length() / 2.0;
        }
        assert!(area > 12.0, "an area of {area}; the sphere's is 12.57");
        // Whatever looks at the sphere from outside meets a face.
        let hit = |ray: DVec3| {
            faces.iter().any(|face| {
                let [a, b, c] = face.map(|i| points[i as usize]);
                [(a, b), (b, c), (c, a)].iter().all(|(p, q)| p.cross(*q).dot(ray) >= 0.0)
            })
        };
        assert!(points.iter().zip(&points[1..]).all(|(p, q)| hit(*p * 0.7 + *q * 0.3 + DVec3::splat(0.01))));
    }

    #[test]
    fn points_in_one_place_make_no_face() {
        assert!(of_points(&[DVec3::ONE; 9], &[DVec3::Y; 9]).is_empty());
        assert!(of_points(&[], &[]).is_empty());
        assert!(of_points(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[DVec3::ZERO; 3]).is_empty());
    }
}
