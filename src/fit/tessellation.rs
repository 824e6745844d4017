//! A finer mesh on the same surface: a body's large faces divided until no edge is too long.

use super::sighting::SurfacePoint;
use crate::scene::RestBody;
use glam::DVec3;
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

/// No face is divided more often: 4^8 parts.
const MOST_ROUNDS: usize = 8;
/// Division stops here, whatever the edges.
const MOST_FACES: usize = 4_000_000;

impl Tessellation {
    /// Halves every edge longer than `longest_edge` metres, again and again. Edges are shared: neighbouring faces divide
    /// them alike, so the result is as closed as the body.
    pub(super) fn new(body: &RestBody, longest_edge: f64) -> Self {
        let whole = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut used = vec![None; body.vertices.len()];
        body.faces.iter().flatten().for_each(|&i| used[i as usize] = Some(0));
        for (next, slot) in used.iter_mut().flatten().enumerate() {
            *slot = next as u32;
        }
        let kept = body.vertices.iter().zip(&used).filter(|(_, used)| used.is_some());
        let mut mesh = Self {
            vertices: kept.map(|(&v, _)| v).collect(),
            faces: body.faces.iter().map(|f| f.map(|i| used[i as usize].unwrap_or_default())).collect(),
            corners: (0..body.faces.len() as u32).map(|face| Corners { face, barycentric: whole }).collect(),
        };
        for _ in 0..MOST_ROUNDS {
            if !mesh.halve_edges(longest_edge) || mesh.faces.len() > MOST_FACES {
                break;
            }
        }
        mesh
    }

    /// One round; false if no edge was too long.
    fn halve_edges(&mut self, longest_edge: f64) -> bool {
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for face in &self.faces {
            for k in 0..3 {
                let (a, b) = (face[k].min(face[(k + 1) % 3]), face[k].max(face[(k + 1) % 3]));
                let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
                if p.distance_squared(q) > longest_edge * longest_edge {
                    let next = self.vertices.len() as u32;
                    if *middles.entry((a, b)).or_insert(next) == next {
                        self.vertices.push((p + q) / 2.0);
                    }
                }
            }
        }
        if middles.is_empty() {
            return false;
        }
        let (old_faces, old_corners) = (std::mem::take(&mut self.faces), std::mem::take(&mut self.corners));
        for (face, corners) in old_faces.into_iter().zip(old_corners) {
            let middle = |k: usize| {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                middles.get(&(a.min(b), a.max(b))).copied()
            };
            self.divide(face, corners, [middle(0), middle(1), middle(2)]);
        }
        true
    }

    /// Adds the parts of a face, given the new vertices in the middle of its edges 01, 12 and 20.
    fn divide(&mut self, face: [u32; 3], corners: Corners, middles: [Option<u32>; 3]) {
        let halfway = |k: usize| {
            let (p, q) = (corners.barycentric[k], corners.barycentric[(k + 1) % 3]);
            std::array::from_fn(|c| (p[c] + q[c]) / 2.0)
        };
        // a ring of six: corner, middle, corner, ...
        let id = |k: usize| if k % 2 == 0 { Some(face[k / 2]) } else { middles[k / 2] };
        let ring: Vec<(u32, [f32; 3])> = (0..6)
            .filter_map(|k| {
                let barycentric = if k % 2 == 0 { corners.barycentric[k / 2] } else { halfway(k / 2) };
                id(k).map(|vertex| (vertex, barycentric))
            })
            .collect();
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
