//! Second phase on the way back: the pixels of one strip ask something of its splats.

use super::backward_blend::{BlockAdjoint, BlockUpstream, Shares, SplatSums};
use super::bin::{Bins, Entry, sort_by_depth, splat_of};
use super::grid::{BLOCKS, COLUMNS, Strip};
use super::lanes::{Kernel, Lanes};
use super::layer::{Layer, LayerBlock};
use super::preprocess::Splat;
use super::reach::{SEGMENT, Segment};
use super::wide::Wide;
use skinsplat_core::scene::RenderedGradient;

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
pub(super) struct BackwardStrip<'a, Y> {
    pub(super) strip: Strip,
    pub(super) bins: &'a [Bins],
    pub(super) splats: &'a [Splat],
    pub(super) upstream: &'a RenderedGradient,
    pub(super) background: [f32; 3],
    pub(super) layer: Y,
    /// Uncapped alphas above this pass no derivative on.
    pub(super) greatest_alpha: f32,
    /// One per splat of the strip, in the order in which the chunks list them.
    pub(super) sums: &'a mut [SplatSums],
    pub(super) scratch: &'a mut Scratch,
}

impl<Y: Layer> Kernel for BackwardStrip<'_, Y> {
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
        let mut behind: Vec<Option<Y::Block>> = vec![None; BLOCKS];
        for segment in (0..segments).rev() {
            self.load(segment);
            self.backpropagate(l, segment, &mut behind);
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

impl<Y: Layer> BackwardStrip<'_, Y> {
    fn gather(&mut self) {
        let Scratch { entries, splats, .. } = &mut *self.scratch;
        entries.clear();
        splats.clear();
        for bins in self.bins {
            for &entry in bins.strip(self.strip.number) {
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
        loaded.load(splats, self.strip);
    }

    /// Depth of a segment's first splat.
    fn first_depth(&self, segment: usize) -> f32 {
        f32::from_bits((self.scratch.entries[segment * SEGMENT] >> 32) as u32)
    }

    /// What lies among the splats of a block from a segment on. What lies in front of the segment was crossed before:
    /// [`BackwardStrip::advance`] sees to that.
    #[inline(always)]
    fn layer_from<L: Lanes>(&self, l: L, segment: usize, corner: [usize; 2]) -> Y::Block {
        let mut layer = self.layer.block(corner);
        if Y::Block::PRESENT && segment > 0 {
            layer.dim(l, self.first_depth(segment), &mut Wide::splat(l, 0.0));
        }
        layer
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
                let corner = self.strip.corner(block);
                let mut layer = self.layer_from(l, next - 1, corner);
                let depth = self.first_depth(next);
                let Scratch { segment, shares, open, .. } = &mut *self.scratch;
                let open = &mut open[start + block];
                shares.collect(l, corner, segment.list(column), &segment.splats, &mut layer, open);
                if Y::Block::PRESENT {
                    let mut left = Wide::load(l, open);
                    layer.dim(l, depth, &mut left);
                    *open = left.store();
                }
            }
        }
    }

    #[inline(always)]
    fn backpropagate<L: Lanes>(&mut self, l: L, number: usize, behind: &mut [Option<Y::Block>]) {
        let start = number * BLOCKS;
        for band in 0..BLOCKS / COLUMNS {
            self.scratch.segment.list_band(l, band);
            for column in 0..COLUMNS {
                let block = band * COLUMNS + column;
                let corner = self.strip.corner(block);
                let mut layer = self.layer_from(l, number, corner);
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
                shares.collect(l, corner, list, &segment.splats, &mut layer, &mut open[start + block]);
                let layer = behind[block].get_or_insert_with(|| self.layer.block(corner));
                let adjoint = BlockAdjoint {
                    corner,
                    shares,
                    splats: &segment.splats,
                    places,
                    greatest_alpha: self.greatest_alpha,
                    layer,
                };
                adjoint.run(l, upstream, self.sums);
            }
        }
    }
}
