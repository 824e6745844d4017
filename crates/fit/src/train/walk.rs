//! Face-bound Gaussians that slide: where a child sits that was split off, and how one that left its triangle comes to sit
//! on the next (SplattingAvatar's walking on triangles), as if the two were unfolded into one plane.

use glam::{DVec3, Vec3};
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{FaceBinding, RestBody};
use std::collections::BTreeMap;

/// For each side of each face (opposite its corner 0, 1, 2), the face beyond it.
pub(super) struct Neighbours(Vec<[Option<u32>; 3]>);

impl Neighbours {
    /// The neighbours over sides that exactly two faces share.
    pub(super) fn new(body: &RestBody) -> Self {
        let mut sides: BTreeMap<[u32; 2], Vec<(u32, usize)>> = BTreeMap::new();
        for (f, face) in body.faces.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (face[(k + 1) % 3], face[(k + 2) % 3]);
                sides.entry([a.min(b), a.max(b)]).or_default().push((f as u32, k));
            }
        }
        let mut neighbours = vec![[None; 3]; body.faces.len()];
        for side in sides.values() {
            if let [(f, i), (g, j)] = side[..] {
                neighbours[f as usize][i] = Some(g);
                neighbours[g as usize][j] = Some(f);
            }
        }
        Self(neighbours)
    }
}

/// The binding of Gaussians that stem from others: the parent's place, shifted in the rest pose.
pub(super) fn inherited(
    binding: &FaceBinding,
    parents: &[usize],
    shifts: &[Vec3],
    body: &RestBody,
) -> FaceBinding {
    let normals = vertex_normals(&body.vertices, &body.faces);
    let mut next = FaceBinding::default();
    for (&parent, shift) in parents.iter().zip(shifts) {
        let (face, mut place, mut offset) =
            (binding.faces[parent], binding.barycentric[parent], binding.offsets[parent]);
        if *shift != Vec3::ZERO {
            let corners = body.faces[face as usize].map(|v| v as usize);
            let normal: DVec3 =
                (0..3).map(|k| normals[corners[k]] * f64::from(place[k])).sum::<DVec3>().normalize_or_zero();
            let shift = shift.as_dvec3();
            let moved = in_plane(corners.map(|v| body.vertices[v]), shift);
            place = [0, 1, 2].map(|k: usize| place[k] + moved[k] as f32);
            offset += shift.dot(normal) as f32;
        }
        next.faces.push(face);
        next.barycentric.push(place);
        next.offsets.push(offset);
    }
    next
}

/// How barycentric coordinates change when a point moves by the part of `shift` that lies in the triangle's plane; zero
/// for a triangle without area.
fn in_plane([a, b, c]: [DVec3; 3], shift: DVec3) -> [f64; 3] {
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    let square = normal.length_squared();
    if square <= f64::MIN_POSITIVE {
        return [0.0; 3];
    }
    let (beta, gamma) = (shift.cross(v).dot(normal) / square, u.cross(shift).dot(normal) / square);
    [-beta - gamma, beta, gamma]
}

/// Moves every Gaussian with a negative coordinate onto the neighbour over that side, until none is negative or it has crossed
/// `most_crossings` edges. At an edge of the mesh a Gaussian stops.
pub(super) fn walk(binding: &mut FaceBinding, body: &RestBody, neighbours: &Neighbours, most_crossings: u32) {
    for i in 0..binding.faces.len() {
        let (mut face, mut place) = (binding.faces[i], binding.barycentric[i].map(f64::from));
        for _ in 0..most_crossings {
            let side = (0..3).min_by(|&a, &b| place[a].total_cmp(&place[b])).unwrap_or(0);
            if place[side] >= 0.0 {
                break;
            }
            match neighbours.0[face as usize][side]
                .and_then(|next| unfolded(body, face, side, next, place).map(|place| (next, place)))
            {
                Some((next, moved)) => (face, place) = (next, moved),
                None => break,
            }
        }
        if place.iter().any(|&b| b < 0.0) {
            let cut = place.map(|b| b.max(0.0));
            let sum: f64 = cut.iter().sum();
            place = cut.map(|b| b / sum);
        }
        binding.faces[i] = face;
        binding.barycentric[i] = place.map(|b| b as f32);
    }
}

/// The coordinates on `next` of a point that left `face` over its side `side`; `None` if one of them has no area.
fn unfolded(body: &RestBody, face: u32, side: usize, next: u32, place: [f64; 3]) -> Option<[f64; 3]> {
    let corners = body.faces[face as usize];
    let (a, b) = (corners[(side + 1) % 3], corners[(side + 2) % 3]);
    let beyond = body.faces[next as usize];
    let far = (0..3).find(|&k| beyond[k] != a && beyond[k] != b)?;
    let at = |v: u32| body.vertices[v as usize];
    let (start, edge) = (at(a), at(b) - at(a));
    let square = edge.length_squared();
    if square <= f64::MIN_POSITIVE {
        return None;
    }
    // Along the edge (0 at a, 1 at b) and away from it.
    let along = |p: DVec3| (p - start).dot(edge) / square;
    let height = |p: DVec3| (p - start - edge * along(p)).length();
    let (old, new) = (at(corners[side]), at(beyond[far]));
    let new_height = height(new);
    if new_height <= f64::MIN_POSITIVE {
        return None;
    }
    let share = -place[side] * height(old) / new_height;
    let foot = place[(side + 2) % 3] + place[side] * along(old);
    let of_b = foot - share * along(new);
    let mut moved = [0.0; 3];
    for (k, value) in moved.iter_mut().enumerate() {
        *value = match beyond[k] {
            v if v == b => of_b,
            v if v == a => 1.0 - of_b - share,
            _ => share,
        };
    }
    Some(moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::scene::{Skeleton, SkinWeights};

    /// A flat strip of triangles of different shapes.
    fn strip() -> RestBody {
        let vertices: Vec<DVec3> = [[0.0, 0.0], [1.0, 0.2], [0.3, 1.0], [1.5, 1.3], [1.9, 0.1], [2.6, 1.1]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .to_vec();
        let skeleton = Skeleton::from_joint_positions(vec!["root".into()], vec![None], &[DVec3::ZERO])
            .expect("one joint");
        let weights = SkinWeights::from_rows(vertices.iter().map(|_| vec![(0, 1.0)]), 1).expect("rows");
        RestBody {
            skeleton,
            faces: vec![[0, 1, 2], [1, 3, 2], [4, 3, 1], [4, 5, 3]],
            vertices,
            weights,
            uv: None,
            pose_directions: Vec::new(),
        }
    }

    fn point(body: &RestBody, binding: &FaceBinding, i: usize) -> DVec3 {
        let corners = body.faces[binding.faces[i] as usize];
        (0..3).map(|k| body.vertices[corners[k] as usize] * f64::from(binding.barycentric[i][k])).sum()
    }

    #[test]
    fn walking_in_a_plane_changes_the_face_and_not_the_place() {
        let body = strip();
        // One step away, three faces away, and off the strip.
        let places = [[-0.4f32, 0.9, 0.5], [-1.6, 2.0, 0.6], [0.9, 0.3, -0.2]];
        let mut binding =
            FaceBinding { faces: vec![0; 3], barycentric: places.to_vec(), offsets: vec![0.0; 3] };
        let before: Vec<DVec3> = (0..3).map(|i| point(&body, &binding, i)).collect();
        walk(&mut binding, &body, &Neighbours::new(&body), 16);
        for i in 0..2 {
            assert!(point(&body, &binding, i).distance(before[i]) < 1e-6, "{i}");
        }
        assert_eq!(binding.faces[0], 1);
        assert!(binding.faces[1] > 1);
        assert_eq!(binding.faces[2], 0, "there is nothing beyond the border");
        for place in &binding.barycentric {
            assert!(place.iter().all(|&b| b >= 0.0));
            assert!((place.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_child_sits_where_it_was_shifted_to() {
        let body = strip();
        let binding = FaceBinding { faces: vec![1], barycentric: vec![[0.2, 0.3, 0.5]], offsets: vec![0.01] };
        let shift = Vec3::new(0.11, -0.07, 0.02);
        let child = inherited(&binding, &[0], &[shift], &body);
        let moved = point(&body, &child, 0) - point(&body, &binding, 0);
        assert!(moved.distance(DVec3::new(0.11, -0.07, 0.0)) < 1e-6);
        assert!((child.offsets[0].abs() - 0.03).abs() < 1e-6 || (child.offsets[0] + 0.01).abs() < 1e-6);
    }
}
