//! A finer mesh on the same surface: a body's large faces divided until no edge is too long.

use super::sighting::SurfacePoint;
use glam::DVec3;
use skinsplat_core::scene::{RestBody, SceneError};
use std::collections::BTreeMap;

/// A triangulation of a body's surface, at least as fine as the body's own, that knows where on the body it lies.
pub(super) struct Tessellation {
    /// Rest positions, metres: those of the body's vertices that have a face, in order, then new ones.
    pub(super) vertices: Vec<DVec3>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Per face, its corners on the face of the body in which it lies.
    pub(super) corners: Vec<Corners>,
}

/// Three points on one face of the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corners {
    pub(super) face: u32,
    pub(super) barycentric: [[f32; 3]; 3],
}

impl Corners {
    /// The point with barycentric coordinates `weights` in the triangle of the corners.
    pub(super) fn at(&self, weights: [f32; 3]) -> SurfacePoint {
        let mixed = |k: usize| (0..3).map(|c| weights[c] * self.barycentric[c][k]).sum();
        SurfacePoint { face: self.face, barycentric: std::array::from_fn(mixed) }
    }
}

/// The vertices of a body that have a face, in order.
pub(super) fn vertices_with_faces(body: &RestBody) -> Vec<usize> {
    let mut used = vec![false; body.vertices.len()];
    body.faces.iter().flatten().for_each(|&i| used[i as usize] = true);
    (0..used.len()).filter(|&i| used[i]).collect()
}

/// The directed sides 01, 12 and 20 of a face.
fn sides([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}

/// New vertices in the middles of edges, numbered in the order in which they are first asked for.
pub(super) struct Middles {
    first: usize,
    of_edge: BTreeMap<[u32; 2], u32>,
    /// The ends of each divided edge, the lower index first.
    pub(super) edges: Vec<[u32; 2]>,
}

impl Middles {
    /// None yet; the first will be vertex `first`.
    pub(super) fn after(first: usize) -> Self {
        Self { first, of_edge: BTreeMap::new(), edges: Vec::new() }
    }

    /// The vertex in the middle of the edge between two others, made if need be.
    pub(super) fn of(&mut self, a: u32, b: u32) -> u32 {
        let edge = [a.min(b), a.max(b)];
        let next = (self.first + self.edges.len()) as u32;
        let middle = *self.of_edge.entry(edge).or_insert(next);
        if middle == next {
            self.edges.push(edge);
        }
        middle
    }

    /// The vertex in the middle of an edge, if it was made.
    fn known(&self, a: u32, b: u32) -> Option<u32> {
        self.of_edge.get(&[a.min(b), a.max(b)]).copied()
    }
}

/// No surface is divided into more faces: about 2 GB with what is gathered for them.
const MOST_FACES: usize = 4_000_000;

impl Tessellation {
    /// The body's own mesh, undivided.
    pub(super) fn of(body: &RestBody) -> Self {
        let whole = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let used = vertices_with_faces(body);
        let mut index = vec![0; body.vertices.len()];
        for (new, &old) in used.iter().enumerate() {
            index[old] = new as u32;
        }
        Self {
            vertices: used.iter().map(|&i| body.vertices[i]).collect(),
            faces: body.faces.iter().map(|face| face.map(|i| index[i as usize])).collect(),
            corners: (0..body.faces.len() as u32).map(|face| Corners { face, barycentric: whole }).collect(),
        }
    }

    /// Halves every edge longer than `longest_edge` metres, again and again, at most `most_divisions` times. Edges are
    /// shared: neighbouring faces divide them alike, so the result is as closed as the body.
    ///
    /// # Errors
    /// More than four million faces, found before they are made.
    pub(super) fn new(body: &RestBody, longest_edge: f64, most_divisions: u32) -> Result<Self, SceneError> {
        let mut mesh = Self::of(body);
        for _ in 0..most_divisions {
            if !mesh.halve_edges(longest_edge)? {
                break;
            }
        }
        Ok(mesh)
    }

    /// One round; false if no edge was too long.
    fn halve_edges(&mut self, longest_edge: f64) -> Result<bool, SceneError> {
        let mut middles = Middles::after(self.vertices.len());
        for &face in &self.faces {
            for (a, b) in sides(face) {
                let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
                if p.distance_squared(q) > longest_edge * longest_edge {
                    middles.of(a, b);
                }
            }
        }
        if middles.edges.is_empty() {
            return Ok(false);
        }
        let cuts =
            |face: &[u32; 3]| sides(*face).iter().filter(|&&(a, b)| middles.known(a, b).is_some()).count();
        let count = self.faces.len() + self.faces.iter().map(cuts).sum::<usize>();
        if count > MOST_FACES {
            let problem = format!("{count} faces or more, for edges of at most {longest_edge} m");
            let expected = format!("at most {MOST_FACES}: a body in metres, or longer edges");
            return Err(SceneError::new("body.faces", problem, expected));
        }
        let middle = |&[a, b]: &[u32; 2]| (self.vertices[a as usize] + self.vertices[b as usize]) / 2.0;
        let new: Vec<DVec3> = middles.edges.iter().map(middle).collect();
        self.vertices.extend(new);
        let (old_faces, old_corners) = (std::mem::take(&mut self.faces), std::mem::take(&mut self.corners));
        for (face, corners) in old_faces.into_iter().zip(old_corners) {
            self.divide(face, corners, sides(face).map(|(a, b)| middles.known(a, b)));
        }
        Ok(true)
    }

    /// Adds the parts of a face, given the new vertices in the middle of its edges 01, 12 and 20.
    fn divide(&mut self, face: [u32; 3], corners: Corners, middles: [Option<u32>; 3]) {
        let halfway = |k: usize| {
            let (p, q) = (corners.barycentric[k], corners.barycentric[(k + 1) % 3]);
            std::array::from_fn(|c| (p[c] + q[c]) / 2.0)
        };
        // round the face: corner, middle of the edge if it has one, corner, ...
        let mut ring = Vec::with_capacity(6);
        for k in 0..3 {
            ring.push((face[k], corners.barycentric[k]));
            ring.extend(middles[k].map(|vertex| (vertex, halfway(k))));
        }
        let mut add = |parts: [usize; 3]| {
            self.faces.push(parts.map(|k| ring[k].0));
            let barycentric = parts.map(|k| ring[k].1);
            self.corners.push(Corners { face: corners.face, barycentric });
        };
        let divided = middles.map(|m| m.is_some());
        match ring.len() {
            3 => add([0, 1, 2]),
            4 => {
                // from the one new vertex to the opposite corner
                let new = divided.iter().position(|&d| d).unwrap_or(0) + 1;
                add([new, (new + 1) % 4, (new + 2) % 4]);
                add([new, (new + 2) % 4, (new + 3) % 4]);
            }
            5 => {
                // the corner between the two new vertices is cut off; the rest is a quadrilateral
                let whole = divided.iter().position(|&d| !d).unwrap_or(0);
                let first = |k: usize| (0..k).map(|e| 1 + usize::from(divided[e])).sum::<usize>() % 5;
                // going round from the far end of the undivided edge: corner, new, corner, new, corner
                let start = first(whole + 1);
                let at = |k: usize| (start + k) % 5;
                add([at(1), at(2), at(3)]);
                add([at(0), at(1), at(3)]);
                add([at(0), at(3), at(4)]);
            }
            _ => {
                add([0, 1, 5]);
                add([1, 2, 3]);
                add([3, 4, 5]);
                add([1, 3, 5]);
            }
        }
    }

    /// For every vertex, its place on the body, in the first of the faces around it.
    pub(super) fn vertex_sites(&self) -> Vec<SurfacePoint> {
        let mut sites = vec![SurfacePoint { face: 0, barycentric: [1.0, 0.0, 0.0] }; self.vertices.len()];
        for (face, corners) in self.faces.iter().zip(&self.corners).rev() {
            for k in 0..3 {
                sites[face[k] as usize] =
                    SurfacePoint { face: corners.face, barycentric: corners.barycentric[k] };
            }
        }
        sites
    }

    /// For every face, its centroid's place on the body.
    pub(super) fn face_sites(&self) -> Vec<SurfacePoint> {
        self.corners.iter().map(|corners| corners.at([1.0 / 3.0; 3])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::scene::{Skeleton, SkinWeights};

    /// A tetrahedron with one long side, and a vertex without a face.
    fn tetrahedron() -> RestBody {
        let vertices = vec![DVec3::ZERO, DVec3::splat(9.0), DVec3::X * 3.0, DVec3::Y, DVec3::Z];
        let names = vec!["root".to_owned()];
        RestBody {
            skeleton: Skeleton::from_joint_positions(names, vec![None], &[DVec3::ZERO]).unwrap(),
            weights: SkinWeights::from_rows(vertices.iter().map(|_| [(0, 1.0)]), 1).unwrap(),
            vertices,
            faces: vec![[0, 3, 2], [0, 2, 4], [0, 4, 3], [2, 3, 4]],
            uv: None,
            pose_directions: Vec::new(),
        }
    }

    fn area(vertices: &[DVec3], face: &[u32; 3]) -> DVec3 {
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        (b - a).cross(c - a) / 2.0
    }

    #[test]
    fn it_stays_closed_keeps_every_area_and_has_no_long_edge() {
        let body = tetrahedron();
        for longest in [f64::INFINITY, 2.0, 1.1, 0.7, 0.2] {
            let mesh = Tessellation::new(&body, longest, 8).unwrap();
            let mut areas = vec![DVec3::ZERO; body.faces.len()];
            let mut sides = BTreeMap::new();
            for (face, corners) in mesh.faces.iter().zip(&mesh.corners) {
                let part = area(&mesh.vertices, face);
                let whole = area(&body.vertices, &body.faces[corners.face as usize]);
                assert!(part.dot(whole) > 0.0, "orientation is kept");
                areas[corners.face as usize] += part;
                for k in 0..3 {
                    let (a, b) = (face[k], face[(k + 1) % 3]);
                    assert!(mesh.vertices[a as usize].distance(mesh.vertices[b as usize]) <= longest);
                    *sides.entry((a, b)).or_insert(0) += 1;
                }
            }
            assert!(sides.iter().all(|(&(a, b), &n)| n == 1 && sides.contains_key(&(b, a))), "closed");
            for (sum, face) in areas.iter().zip(&body.faces) {
                assert!((*sum - area(&body.vertices, face)).length() < 1e-12);
            }
        }
    }

    #[test]
    fn too_many_faces_are_refused_before_they_are_made() {
        let error = Tessellation::new(&tetrahedron(), 1e-6, 16).err().expect("refused");
        assert_eq!(error.field, "body.faces");
        assert!(error.problem.contains("for edges of at most 0.000001 m"), "{error}");
    }

    #[test]
    fn sites_lie_where_the_vertices_and_centroids_are() {
        let body = tetrahedron();
        let mesh = Tessellation::new(&body, 0.4, 8).unwrap();
        let place = |site: &SurfacePoint| -> DVec3 {
            let corners = body.faces[site.face as usize].map(|i| body.vertices[i as usize]);
            corners.iter().zip(site.barycentric).map(|(&v, b)| v * f64::from(b)).sum()
        };
        for (site, vertex) in mesh.vertex_sites().iter().zip(&mesh.vertices) {
            assert!(place(site).distance(*vertex) < 1e-6);
        }
        for (site, face) in mesh.face_sites().iter().zip(&mesh.faces) {
            let centre = face.iter().map(|&i| mesh.vertices[i as usize]).sum::<DVec3>() / 3.0;
            assert!(place(site).distance(centre) < 1e-6);
        }
    }
}
