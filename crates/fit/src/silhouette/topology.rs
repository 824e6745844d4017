//! Edges of a mesh and the faces beside them.

/// A face beside an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Side {
    pub(super) face: u32,
    /// The face runs along the edge from its first end to its second.
    pub(super) forward: bool,
}

/// The edges of a triangle mesh of any shape: open, closed, or with more than two faces around an edge.
#[derive(Clone, Debug)]
pub(crate) struct Topology {
    faces: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    offsets: Vec<u32>,
    sides: Vec<Side>,
    closed: bool,
}

impl Topology {
    pub(crate) fn new(faces: &[[u32; 3]]) -> Self {
        let of_face = |(face, &[a, b, c]): (usize, &[u32; 3])| {
            [(a, b), (b, c), (c, a)].map(|(p, q)| ([p.min(q), p.max(q)], face as u32, p < q))
        };
        let is_triangle = |face: &(usize, &[u32; 3])| {
            let [a, b, c] = *face.1;
            a != b && b != c && c != a
        };
        let mut all: Vec<_> = faces.iter().enumerate().filter(is_triangle).flat_map(of_face).collect();
        all.sort_unstable();
        let mut topology = Self {
            faces: faces.to_vec(),
            edges: Vec::new(),
            offsets: vec![0],
            sides: Vec::with_capacity(all.len()),
            closed: true,
        };
        for group in all.chunk_by(|a, b| a.0 == b.0) {
            topology.edges.push(group[0].0);
            topology.sides.extend(group.iter().map(|&(_, face, forward)| Side { face, forward }));
            topology.offsets.push(topology.sides.len() as u32);
            topology.closed &= 2 * group.iter().filter(|(.., forward)| *forward).count() == group.len();
        }
        topology
    }

    pub(crate) fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Every edge is run along as often in one direction as in the other.
    pub(super) fn is_closed(&self) -> bool {
        self.closed
    }

    /// Every edge once, the lower index first.
    pub(crate) fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    pub(super) fn sides(&self, edge: usize) -> &[Side] {
        &self.sides[self.offsets[edge] as usize..self.offsets[edge + 1] as usize]
    }

    /// Every two faces that meet at an edge of their own.
    pub(crate) fn adjacent_faces(&self) -> Vec<[u32; 2]> {
        let pair = |edge: usize| match self.sides(edge) {
            &[a, b] => Some([a.face, b.face]),
            _ => None,
        };
        (0..self.edges.len()).filter_map(pair).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_closed_and_fanned_edges() {
        // three faces around the edge 0-1, one of them the other way round
        let topology = Topology::new(&[[0, 1, 2], [1, 0, 3], [0, 1, 4], [5, 5, 6]]);
        assert_eq!(topology.edges()[0], [0, 1]);
        let sides: Vec<_> = topology.sides(0).iter().map(|s| (s.face, s.forward)).collect();
        assert_eq!(sides, [(0, true), (1, false), (2, true)]);
        assert!(topology.adjacent_faces().is_empty(), "three faces are no pair");
        let pair = Topology::new(&[[0, 1, 2], [2, 1, 3]]);
        assert_eq!(pair.adjacent_faces(), [[0, 1]]);
        assert_eq!(pair.edges().len(), 5);
    }
}
