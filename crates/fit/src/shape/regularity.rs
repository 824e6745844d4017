//! What keeps a displaced mesh a body: edge lengths, normals of neighbouring faces, and the Laplacian of the displacement.

use crate::fill::Neighbours;
use crate::silhouette::Topology;
use glam::DVec3;

/// How much each term counts beside the intersection over union.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    pub(super) edge_length: f64,
    pub(super) normal_consistency: f64,
    pub(super) laplacian: f64,
}

/// The terms for one rest mesh. All are means over the mesh, without units, and zero without a displacement.
pub(super) struct Regularity<'a> {
    topology: &'a Topology,
    rest: &'a [DVec3],
    normals: &'a [DVec3],
    edge_lengths: Vec<f64>,
    mean_edge: f64,
    adjacent: Vec<[u32; 2]>,
    face_normals: Vec<DVec3>,
    neighbours: Neighbours,
}

impl<'a> Regularity<'a> {
    /// For vertices that move along `normals` from where they rest.
    pub(super) fn new(topology: &'a Topology, rest: &'a [DVec3], normals: &'a [DVec3]) -> Self {
        let edge_lengths: Vec<f64> =
            topology.edges().iter().map(|&[a, b]| rest[a as usize].distance(rest[b as usize])).collect();
        let mean_edge = edge_lengths.iter().sum::<f64>() / edge_lengths.len().max(1) as f64;
        Self {
            topology,
            rest,
            normals,
            edge_lengths,
            // a mesh without extent has nothing to be regular about
            mean_edge: if mean_edge > 0.0 { mean_edge } else { 1.0 },
            adjacent: topology.adjacent_faces(),
            face_normals: topology.faces().iter().map(|face| FaceNormal::of(rest, face).unit).collect(),
            neighbours: Neighbours::of_vertices(rest.len(), topology.faces()),
        }
    }

    /// The weighted sum of the terms, and its derivative by every offset.
    pub(super) fn evaluate(&self, offsets: &[f64], weights: Weights) -> (f64, Vec<f64>) {
        let moved = |((r, n), &o): ((&DVec3, &DVec3), &f64)| *r + *n * o;
        let vertices: Vec<DVec3> = self.rest.iter().zip(self.normals).zip(offsets).map(moved).collect();
        let ((edges, by_edges), (normals, by_normals)) =
            rayon::join(|| self.edge_length(&vertices), || self.normal_consistency(&vertices));
        let (laplacian, by_laplacian) = self.laplacian(offsets);
        let gradient = (0..offsets.len())
            .map(|i| {
                let by_position =
                    by_edges[i] * weights.edge_length + by_normals[i] * weights.normal_consistency;
                by_position.dot(self.normals[i]) + by_laplacian[i] * weights.laplacian
            })
            .collect();
        let loss = edges * weights.edge_length
            + normals * weights.normal_consistency
            + laplacian * weights.laplacian;
        (loss, gradient)
    }

    /// Variance over the edges of length over rest length: no pull towards a smaller or larger mesh. Edges without
    /// length do not count.
    fn edge_length(&self, vertices: &[DVec3]) -> (f64, Vec<DVec3>) {
        let mut gradient = vec![DVec3::ZERO; vertices.len()];
        let edges = || self.topology.edges().iter().zip(&self.edge_lengths).filter(|(_, l)| **l > 0.0);
        let along = |&[a, b]: &[u32; 2]| vertices[b as usize] - vertices[a as usize];
        let count = edges().count().max(1) as f64;
        let (mut sum, mut squares) = (0.0, 0.0);
        for (edge, rest) in edges() {
            let ratio = along(edge).length() / rest;
            // around one: a variance as the difference of two large numbers would lose digits
            sum += ratio - 1.0;
            squares += (ratio - 1.0) * (ratio - 1.0);
        }
        let mean = sum / count;
        for (edge, rest) in edges() {
            let direction = along(edge);
            let length = direction.length();
            if length > 0.0 {
                let pull = direction * (2.0 * (length / rest - 1.0 - mean) / (count * rest * length));
                gradient[edge[0] as usize] -= pull;
                gradient[edge[1] as usize] += pull;
            }
        }
        ((squares / count - mean * mean).max(0.0), gradient)
    }

    /// Mean over the pairs of adjacent faces of `|(n - n_rest) - (m - m_rest)|²`: how differently two neighbours turn.
    /// A crease of the rest mesh may stay.
    fn normal_consistency(&self, vertices: &[DVec3]) -> (f64, Vec<DVec3>) {
        let faces = self.topology.faces();
        let normals: Vec<FaceNormal> = faces.iter().map(|face| FaceNormal::of(vertices, face)).collect();
        let turned: Vec<DVec3> =
            normals.iter().zip(&self.face_normals).map(|(n, rest)| n.unit - *rest).collect();
        let count = self.adjacent.len().max(1) as f64;
        let mut by_normal = vec![DVec3::ZERO; faces.len()];
        let mut sum = 0.0;
        for &[a, b] in &self.adjacent {
            let difference = turned[a as usize] - turned[b as usize];
            sum += difference.length_squared();
            by_normal[a as usize] += difference;
            by_normal[b as usize] -= difference;
        }
        let mut gradient = vec![DVec3::ZERO; vertices.len()];
        for ((face, normal), by_normal) in faces.iter().zip(&normals).zip(&by_normal) {
            let corners = normal.pulled_back(*by_normal * (2.0 / count), vertices, face);
            for (&i, corner) in face.iter().zip(corners) {
                gradient[i as usize] += corner;
            }
        }
        (sum / count, gradient)
    }

    /// Mean over the vertices of the squared difference between an offset and the mean of its neighbours', in units of
    /// the mean edge length.
    fn laplacian(&self, offsets: &[f64]) -> (f64, Vec<f64>) {
        let difference = |i: usize| {
            let around = self.neighbours.of(i);
            if around.is_empty() {
                return 0.0;
            }
            let sum: f64 = around.iter().map(|&j| offsets[j as usize]).sum();
            offsets[i] - sum / around.len() as f64
        };
        let differences: Vec<f64> = (0..offsets.len()).map(difference).collect();
        let scale = 1.0 / (offsets.len().max(1) as f64 * self.mean_edge * self.mean_edge);
        let from = |&j: &u32| differences[j as usize] / self.neighbours.of(j as usize).len() as f64;
        let by = |i: usize| {
            let received: f64 = self.neighbours.of(i).iter().map(from).sum();
            2.0 * scale * (differences[i] - received)
        };
        (scale * differences.iter().map(|d| d * d).sum::<f64>(), (0..offsets.len()).map(by).collect())
    }
}

/// The unit normal of a face and twice its area; zero for a face without area.
struct FaceNormal {
    unit: DVec3,
    length: f64,
}

impl FaceNormal {
    fn of(vertices: &[DVec3], face: &[u32; 3]) -> Self {
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        let unit = if length > 0.0 { normal / length } else { DVec3::ZERO };
        Self { unit, length }
    }

    /// From a derivative by the unit normal to those by the corners.
    fn pulled_back(&self, by_unit: DVec3, vertices: &[DVec3], face: &[u32; 3]) -> [DVec3; 3] {
        if self.length <= 0.0 {
            return [DVec3::ZERO; 3];
        }
        let by_normal = (by_unit - self.unit * self.unit.dot(by_unit)) / self.length;
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        // normal = a x b + b x c + c x a
        [(b - c).cross(by_normal), (c - a).cross(by_normal), (a - b).cross(by_normal)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::scene::body::vertex_normals;

    /// An octahedron with uneven corners, an open flap on one of its edges, and a vertex without a face.
    fn mesh() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let vertices = [
            (1.0, 0.1, 0.0),
            (-1.2, 0.0, 0.1),
            (0.0, 0.9, 0.2),
            (0.1, -1.1, 0.0),
            (0.0, 0.1, 1.3),
            (0.2, 0.0, -0.8),
            (1.5, 1.4, 0.6),
            (9.0, 9.0, 9.0),
        ];
        let faces = vec![
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
            [0, 6, 2],
        ];
        (vertices.map(|(x, y, z)| DVec3::new(x, y, z)).to_vec(), faces)
    }

    const TERMS: [Weights; 3] = [
        Weights { edge_length: 1.0, normal_consistency: 0.0, laplacian: 0.0 },
        Weights { edge_length: 0.0, normal_consistency: 1.0, laplacian: 0.0 },
        Weights { edge_length: 0.0, normal_consistency: 0.0, laplacian: 1.0 },
    ];

    #[test]
    fn every_term_has_the_derivative_of_its_value() {
        let (vertices, faces) = mesh();
        let normals = vertex_normals(&vertices, &faces);
        let topology = Topology::new(&faces);
        let regularity = Regularity::new(&topology, &vertices, &normals);
        let offsets = [0.1, -0.05, 0.2, 0.0, 0.15, -0.1, 0.07, 0.3];
        for (term, weights) in TERMS.into_iter().enumerate() {
            let (value, gradient) = regularity.evaluate(&offsets, weights);
            assert!(value > 1e-4, "term {term} sees the displacement: {value}");
            for i in 0..offsets.len() {
                let at = |step: f64| {
                    let mut moved = offsets;
                    moved[i] += step;
                    regularity.evaluate(&moved, weights).0
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!((difference - gradient[i]).abs() < 1e-9, "{term}, {i}: {difference} {}", gradient[i]);
            }
        }
    }

    #[test]
    fn nothing_pulls_at_the_rest_mesh() {
        let (vertices, faces) = mesh();
        let normals = vertex_normals(&vertices, &faces);
        let topology = Topology::new(&faces);
        let regularity = Regularity::new(&topology, &vertices, &normals);
        for weights in TERMS {
            let (value, gradient) = regularity.evaluate(&[0.0; 8], weights);
            assert!(value == 0.0 && gradient.iter().all(|g| *g == 0.0));
        }
    }

    #[test]
    fn scaling_is_free_of_edge_and_normal_terms() {
        let (vertices, faces) = mesh();
        let topology = Topology::new(&faces);
        // every vertex moves away from the origin in proportion to its distance: the mesh is scaled
        let regularity = Regularity::new(&topology, &vertices, &vertices);
        for weights in &TERMS[..2] {
            let (value, gradient) = regularity.evaluate(&[0.25; 8], *weights);
            assert!(value < 1e-15 && gradient.iter().all(|g| g.abs() < 1e-15), "{value} {gradient:?}");
        }
    }
}
