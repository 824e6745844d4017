//! Values for the parts of a surface that no frame shows: spread from their neighbours over the mesh.

use glam::DVec3;

/// Who is next to whom, in compressed rows.
pub(super) struct Neighbours {
    offsets: Vec<usize>,
    indices: Vec<u32>,
}

impl Neighbours {
    /// Vertices that share an edge.
    pub(super) fn of_vertices(count: usize, faces: &[[u32; 3]]) -> Self {
        let edges = faces.iter().flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]);
        Self::from_pairs(count, edges.collect())
    }

    /// Faces that share an edge, through the vertices at its ends.
    pub(super) fn of_faces(faces: &[[u32; 3]]) -> Self {
        let side = |(face, &[a, b, c]): (usize, &[u32; 3])| {
            [(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q), face as u32))
        };
        let mut sides: Vec<(u32, u32, u32)> = faces.iter().enumerate().flat_map(side).collect();
        sides.sort_unstable();
        let mut pairs = Vec::with_capacity(sides.len());
        for group in sides.chunk_by(|s, t| (s.0, s.1) == (t.0, t.1)) {
            // two neighbours in the sorted list: enough to connect the faces around an edge of any number of them
            for pair in group.windows(2) {
                pairs.extend([(pair[0].2, pair[1].2), (pair[1].2, pair[0].2)]);
            }
        }
        Self::from_pairs(faces.len(), pairs)
    }

    /// Of pairs in both directions; those with themselves and repetitions do not count.
    pub(super) fn from_pairs(count: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.retain(|(a, b)| a != b);
        pairs.sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; count + 1];
        for &(a, _) in &pairs {
            offsets[a as usize + 1] += 1;
        }
        for i in 0..count {
            offsets[i + 1] += offsets[i];
        }
        Self { offsets, indices: pairs.into_iter().map(|(_, b)| b).collect() }
    }

    #[inline]
    pub(super) fn of(&self, i: usize) -> &[u32] {
        &self.indices[self.offsets[i]..self.offsets[i + 1]]
    }
}

/// Replaces the values that are not `known` (`stride` of them per part): first from the nearest known part over the
/// mesh, or through space for a piece of the mesh of which nothing is known; then diffused in so many
/// `steps`, the known values held fixed. Leaves everything as it is if nothing is known.
pub(super) fn fill_unknown(
    values: &mut [[f32; 3]],
    stride: usize,
    known: &[bool],
    neighbours: &Neighbours,
    positions: &[DVec3],
    steps: usize,
) {
    let mut source: Vec<Option<u32>> =
        known.iter().enumerate().map(|(i, &k)| k.then_some(i as u32)).collect();
    let mut front: Vec<u32> = source.iter().flatten().copied().collect();
    let seeds = front.clone();
    if seeds.is_empty() {
        return;
    }
    while !front.is_empty() {
        let mut next = Vec::new();
        for &part in &front {
            for &neighbour in neighbours.of(part as usize) {
                if source[neighbour as usize].is_none() {
                    source[neighbour as usize] = source[part as usize];
                    next.push(neighbour);
                }
            }
        }
        front = next;
    }
    let unknown: Vec<usize> = (0..known.len()).filter(|&i| !known[i]).collect();
    for &part in &unknown {
        let from = source[part].unwrap_or_else(|| nearest(&seeds, positions, positions[part])) as usize;
        for k in 0..stride {
            values[part * stride + k] = values[from * stride + k];
        }
    }
    diffuse(values, stride, &unknown, neighbours, steps);
}

fn nearest(seeds: &[u32], positions: &[DVec3], position: DVec3) -> u32 {
    let distance = |&i: &u32| positions[i as usize].distance_squared(position);
    let first = |best: u32, i: u32| if distance(&i) < distance(&best) { i } else { best };
    seeds.iter().copied().fold(seeds[0], first)
}

/// Gauss-Seidel steps of Laplace's equation at the unknown parts, in index order.
fn diffuse(values: &mut [[f32; 3]], stride: usize, unknown: &[usize], neighbours: &Neighbours, steps: usize) {
    for _ in 0..steps {
        for &part in unknown {
            let around = neighbours.of(part);
            if around.is_empty() {
                continue;
            }
            for k in 0..stride {
                let mut sum = [0.0f32; 3];
                for &i in around {
                    let value = values[i as usize * stride + k];
                    sum = std::array::from_fn(|c| sum[c] + value[c]);
                }
                values[part * stride + k] = sum.map(|s| s / around.len() as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_values_on_a_strip_become_linear_between_known_ends() {
        // a strip of triangles 0-1-2, 1-2-3, ... and a lonely triangle near its far end
        let mut faces: Vec<[u32; 3]> = (0..8).map(|i| [i, i + 1, i + 2]).collect();
        faces.push([10, 11, 12]);
        let neighbours = Neighbours::of_vertices(13, &faces);
        assert_eq!(neighbours.of(4), &[2, 3, 5, 6]);
        let mut known = [false; 13];
        let mut values = [[9.0f32; 3]; 13];
        for (i, v) in [(0usize, 0.0f32), (1, 1.0), (8, 8.0), (9, 9.0)] {
            known[i] = true;
            values[i] = [v, -v, 1.0];
        }
        let positions: Vec<DVec3> = (0..13).map(|i| DVec3::X * f64::from(i)).collect();
        fill_unknown(&mut values, 1, &known, &neighbours, &positions, 200);
        for (i, value) in values[..10].iter().enumerate() {
            // the linear function is the harmonic one on this strip
            assert!(
                (value[0] - i as f32).abs() < 1e-4 && (value[1] + i as f32).abs() < 1e-4,
                "{i}: {value:?}"
            );
            assert_eq!(value[2], 1.0);
        }
        assert_eq!(values[11], values[9], "a piece without any known part takes the nearest in space");
    }

    #[test]
    fn faces_are_neighbours_across_an_edge() {
        let neighbours = Neighbours::of_faces(&[[0, 1, 2], [2, 1, 3], [3, 4, 5]]);
        assert_eq!((neighbours.of(0), neighbours.of(1)), (&[1u32][..], &[0u32][..]));
        assert!(neighbours.of(2).is_empty());
    }
}
