//! Second phase on the way back: the pixels of one strip ask something of its splats.

use super::backward_blend::{BlockAdjoint, BlockUpstream, Shares, SplatSums};
use super::bin::{Bins, Entry, STRIP_TILES, STRIP_WIDTH, sort_by_depth, splat_of};
use super::lanes::{Kernel, Lanes};
use super::preprocess::Splat;
use super::project::TILE;
use super::reach::{BLOCK, COLUMNS, SEGMENT, Segment};
use crate::scene::RenderedGradient;

const BLOCKS: usize = COLUMNS * TILE / BLOCK;

/// Memory that strips reuse, one after the other.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Depth above place, where a strip's splats are numbered in the order in which the chunks list them.
    entries: Vec<Entry>,
    spare: Vec<Entry>,
    /// Splats by place.
    splats: Vec<u32>,
    /// Places by index within the segment.
    places: Vec<u32>,
    segment: Segment,
    shares: Shares,
    /// Transmittance of pixels that are not done, by segment and block.
    open: Vec<[f32; 16]>,
    /// By block; `None` where no splat reached yet.
    upstream: Vec<Option<BlockUpstream>>,
}

/// Sums the derivatives of a strip's pixels by splat.
pub(super) struct BackwardStrip<'a> {
    /// Strip number in the grid, and its column and row there.
    pub(super) strip: usize,
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) bins: &'a [Bins],
    pub(super) splats: &'a [Splat],
    pub(super) upstream: &'a RenderedGradient,
    pub(super) background: [f32; 3],
    /// Uncapped alphas above this pass no derivative on.
    pub(super) greatest_alpha: f32,
    /// One per splat of the strip, in the order in which the chunks list them.
    pub(super) sums: &'a mut [SplatSums],
    pub(super) scratch: &'a mut Scratch,
}

impl Kernel for BackwardStrip<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, l: L) {
        self.sums.fill(SplatSums::default());
        self.gather();
        sort_by_depth(&mut self.scratch.entries, &mut self.scratch.spare);
        let segments = self.scratch.entries.len().div_ceil(SEGMENT);
        self.scratch.prepare(segments);
        for segment in 1..segments {
            self.load(segment - 1);
            self.advance(l, segment);
        }
        for segment in (0..segments).rev() {
            self.load(segment);
            self.backpropagate(l, segment);
        }
    }
}

impl Scratch {
    fn prepare(&mut self, segments: usize) {
        self.open.clear();
        self.open.resize(segments * BLOCKS, [1.0; 16]);
        self.upstream.resize(BLOCKS, None);
        self.upstream.iter_mut().for_each(|block| *block = None);
    }
}

impl BackwardStrip<'_> {
    fn gather(&mut self) {
        let Scratch { entries, splats, .. } = &mut *self.scratch;
        entries.clear();
        splats.clear();
        for bins in self.bins {
            for &entry in bins.strip(self.strip) {
                entries.push(entry >> 32 << 32 | splats.len() as u64);
                splats.push(splat_of(entry) as u32);
            }
        }
    }

    #[inline(always)]
    fn load(&mut self, segment: usize) {
        let Scratch { entries, splats, places, segment: loaded, .. } = &mut *self.scratch;
        let start = segment * SEGMENT;
        let entries = &entries[start..entries.len().min(start + SEGMENT)];
        places.clear();
        places.extend(entries.iter().map(|&entry| splat_of(entry) as u32));
        let splats = places.iter().map(|&place| self.splats[splats[place as usize] as usize]);
        loaded.load(splats, self.column * STRIP_TILES, self.row * TILE);
    }

    fn corner(&self, block: usize) -> [usize; 2] {
        let (band, column) = (block / COLUMNS, block % COLUMNS);
        [self.column * STRIP_WIDTH + column * BLOCK, self.row * TILE + band * BLOCK]
    }

    /// Finds what the loaded segment leaves open for the one that comes `next`.
    #[inline(always)]
    fn advance<L: Lanes>(&mut self, l: L, next: usize) {
        let start = next * BLOCKS;
        self.scratch.open.copy_within(start - BLOCKS..start, start);
        for band in 0..BLOCKS / COLUMNS {
            self.scratch.segment.list_band(l, band);
            for column in 0..COLUMNS {
                let block = band * COLUMNS + column;
                let corner = self.corner(block);
                let Scratch { segment, shares, open, .. } = &mut *self.scratch;
                shares.collect(l, corner, segment.list(column), &segment.splats, &mut open[start + block]);
            }
        }
    }

    #[inline(always)]
    fn backpropagate<L: Lanes>(&mut self, l: L, segment: usize) {
        let start = segment * BLOCKS;
        for band in 0..BLOCKS / COLUMNS {
            self.scratch.segment.list_band(l, band);
            for column in 0..COLUMNS {
                let block = band * COLUMNS + column;
                let corner = self.corner(block);
                let Scratch { places, segment, shares, open, upstream, .. } = &mut *self.scratch;
                let list = segment.list(column);
                if list.is_empty() {
                    continue;
                }
                let upstream = upstream[block]
                    .get_or_insert_with(|| BlockUpstream::load(self.upstream, self.background, corner));
                if upstream.is_zero() {
                    continue;
                }
                shares.collect(l, corner, list, &segment.splats, &mut open[start + block]);
                let adjoint = BlockAdjoint {
                    corner,
                    shares,
                    splats: &segment.splats,
                    places,
                    greatest_alpha: self.greatest_alpha,
                };
                adjoint.run(l, upstream, self.sums);
            }
        }
    }
}
