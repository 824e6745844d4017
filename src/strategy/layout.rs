//! How Gaussians are laid out for posing: blocks of [`LANES`] Gaussians that hang on the same joints, as structures of
//! arrays, so that one block is one straight run of vector instructions and what depends on joints only is read once.
//!
//! Blocks never leave their chunk of [`CHUNK`] consecutive Gaussians: a chunk writes to its own part of every output,
//! chunks are the unit of parallel work, and their borders depend on nothing but the index. The result is therefore the
//! same, bit for bit, for any number of threads.

use crate::scene::SkinWeights;
use rayon::prelude::*;

/// Gaussians per block.
pub(crate) const LANES: usize = 8;

/// Gaussians per chunk.
pub(crate) const CHUNK: usize = 2048;

/// One number per Gaussian of a block.
pub(crate) type Lanes = [f32; LANES];

/// Up to [`LANES`] Gaussians on the same joints. Lanes beyond `count` repeat the last Gaussian.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Position of each lane's Gaussian in the chunk.
    pub(crate) index: [u16; LANES],
    /// Lanes in use.
    pub(crate) count: usize,
    /// The joints, ascending: this range of [`Chunk::joints`] and of [`Chunk::weights`].
    pub(crate) influences: std::ops::Range<usize>,
    /// Canonical means x, y, z.
    pub(crate) means: [Lanes; 3],
    /// Canonical unit quaternions w, x, y, z.
    pub(crate) rotations: [Lanes; 4],
    /// Standard deviations.
    pub(crate) scales: [Lanes; 3],
}

/// The blocks of [`CHUNK`] consecutive Gaussians (fewer in the last one).
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    /// Blocks, by joints.
    pub(crate) blocks: Vec<Block>,
    /// Joints of all blocks.
    pub(crate) joints: Vec<u16>,
    /// A weight per joint and lane.
    pub(crate) weights: Vec<Lanes>,
}

impl Chunk {
    /// The joints of a block and their weights. Both are empty for Gaussians that do not move.
    pub(crate) fn influences(&self, block: &Block) -> (&[u16], &[Lanes]) {
        (&self.joints[block.influences.clone()], &self.weights[block.influences.clone()])
    }
}

/// Per-Gaussian parameters that go into blocks.
pub(crate) struct Canonical<'a> {
    /// Means, metres.
    pub(crate) means: &'a [glam::Vec3],
    /// Unit quaternions.
    pub(crate) rotations: &'a [[f32; 4]],
    /// Standard deviations, metres.
    pub(crate) scales: &'a [glam::Vec3],
}

/// Lays Gaussians out. `weights` has a row per Gaussian; `None` is for Gaussians that do not move.
pub(crate) fn chunks(canonical: &Canonical<'_>, weights: Option<&SkinWeights>) -> Vec<Chunk> {
    let n = canonical.means.len();
    (0..n.div_ceil(CHUNK))
        .into_par_iter()
        .map(|c| chunk(canonical, weights, c * CHUNK..((c + 1) * CHUNK).min(n)))
        .collect()
}

fn chunk(canonical: &Canonical<'_>, weights: Option<&SkinWeights>, range: std::ops::Range<usize>) -> Chunk {
    let start = range.start;
    let mut rows: Vec<(Vec<(u16, f32)>, usize)> = range.map(|i| (sorted_row(weights, i), i)).collect();
    let joints = |row: &[(u16, f32)]| row.iter().map(|&(joint, _)| joint).collect::<Vec<_>>();
    rows.sort_by_cached_key(|(row, i)| (row.len(), joints(row), *i));
    let mut chunk = Chunk { blocks: Vec::new(), joints: Vec::new(), weights: Vec::new() };
    for group in rows.chunk_by(|(a, _), (b, _)| joints(a) == joints(b)) {
        for members in group.chunks(LANES) {
            chunk.push(canonical, members, start);
        }
    }
    chunk
}

/// The row of a Gaussian by ascending joint, a joint named twice counted once.
fn sorted_row(weights: Option<&SkinWeights>, i: usize) -> Vec<(u16, f32)> {
    let Some(weights) = weights else { return Vec::new() };
    let (joints, weights) = weights.row(i);
    let mut row: Vec<(u16, f32)> = joints.iter().copied().zip(weights.iter().copied()).collect();
    row.sort_by_key(|&(joint, _)| joint);
    row.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        kept.1 += if same { next.1 } else { 0.0 };
        same
    });
    row
}

impl Chunk {
    fn push(&mut self, canonical: &Canonical<'_>, members: &[(Vec<(u16, f32)>, usize)], start: usize) {
        let member = |lane: usize| &members[lane.min(members.len() - 1)];
        let gaussian = |lane: usize| member(lane).1;
        let first = self.joints.len();
        for (k, &(joint, _)) in member(0).0.iter().enumerate() {
            self.joints.push(joint);
            self.weights.push(std::array::from_fn(|lane| member(lane).0[k].1));
        }
        let axes = |values: &[glam::Vec3]| {
            std::array::from_fn(|axis| std::array::from_fn(|lane| values[gaussian(lane)][axis]))
        };
        self.blocks.push(Block {
            index: std::array::from_fn(|lane| (gaussian(lane) - start) as u16),
            count: members.len(),
            influences: first..self.joints.len(),
            means: axes(canonical.means),
            rotations: std::array::from_fn(|k| {
                std::array::from_fn(|lane| canonical.rotations[gaussian(lane)][k])
            }),
            scales: axes(canonical.scales),
        });
    }
}
