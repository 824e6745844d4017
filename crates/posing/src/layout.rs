//! How Gaussians are laid out for posing: blocks of [`LANES`] Gaussians that hang on the same joints, as structures of
//! arrays, so that one block is one straight run of vector instructions and what depends on joints only is read once.
//!
//! Blocks never leave their chunk of [`CHUNK`] consecutive Gaussians: a chunk writes to its own part of every output,
//! chunks are the unit of parallel work, and their borders depend on nothing but the index. The result is therefore the
//! same, bit for bit, for any number of threads.

use super::lanes::{LANES, Lanes};
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Gaussians, SkinWeights};

/// Gaussians per chunk.
pub(crate) const CHUNK: usize = 2048;

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

/// Lays `n` Gaussians out, their parameters still zero. `weights` has a row per Gaussian; `None` is for Gaussians that do
/// not move.
pub(crate) fn chunks(n: usize, weights: Option<&SkinWeights>) -> Vec<Chunk> {
    let range = |c: usize| c * CHUNK..((c + 1) * CHUNK).min(n);
    (0..n.div_ceil(CHUNK)).into_par_iter().map(|c| chunk(weights, range(c))).collect()
}

fn chunk(weights: Option<&SkinWeights>, range: std::ops::Range<usize>) -> Chunk {
    let start = range.start;
    let mut rows: Vec<(Vec<(u16, f32)>, usize)> = range.map(|i| (sorted_row(weights, i), i)).collect();
    let joints = |row: &[(u16, f32)]| row.iter().map(|&(joint, _)| joint).collect::<Vec<_>>();
    rows.sort_by_cached_key(|(row, i)| (row.len(), joints(row), *i));
    let mut chunk = Chunk { blocks: Vec::new(), joints: Vec::new(), weights: Vec::new() };
    for group in rows.chunk_by(|(a, _), (b, _)| joints(a) == joints(b)) {
        for members in group.chunks(LANES) {
            chunk.push(members, start);
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
    fn push(&mut self, members: &[(Vec<(u16, f32)>, usize)], start: usize) {
        let member = |lane: usize| &members[lane.min(members.len() - 1)];
        let first = self.joints.len();
        for (k, &(joint, _)) in member(0).0.iter().enumerate() {
            self.joints.push(joint);
            self.weights.push(std::array::from_fn(|lane| member(lane).0[k].1));
        }
        self.blocks.push(Block {
            index: std::array::from_fn(|lane| (member(lane).1 - start) as u16),
            count: members.len(),
            influences: first..self.joints.len(),
            means: [[0.0; LANES]; 3],
            rotations: [[0.0; LANES]; 4],
            scales: [[0.0; LANES]; 3],
        });
    }

    /// Sets the parameters of all blocks: means as given (those of this chunk), the rest as `gaussians` has it from index
    /// `start` on.
    pub(crate) fn fill(&mut self, means: &[glam::Vec3], gaussians: &Gaussians, start: usize) {
        for block in &mut self.blocks {
            for lane in 0..LANES {
                let i = usize::from(block.index[lane]);
                let rotation = gaussians.unit_rotation(start + i);
                for k in 0..4 {
                    block.rotations[k][lane] = rotation[k];
                }
                let log_scale = gaussians.log_scales[start + i];
                for axis in 0..3 {
                    block.means[axis][lane] = means[i][axis];
                    block.scales[axis][lane] = portable::exp(log_scale[axis]);
                }
            }
        }
    }
}
