//! Second phase: one strip of the image, from the chunks' lists to finished pixels.

use super::bin::{Bins, Entry, STRIP_TILES, STRIP_WIDTH, sort_by_depth, splat_of};
use super::blend::Block;
use super::lanes::{Kernel, Lanes};
use super::preprocess::Splat;
use super::profile::{Clock, Phase};
use super::project::TILE;
use super::reach::{BLOCK, COLUMNS, SEGMENT, Segment};

/// The part of the output that a strip writes: up to sixteen rows of it, each of the strip's width.
#[derive(Default)]
pub(super) struct Rows<'a> {
    pub(super) colour: [&'a mut [[f32; 3]]; TILE],
    pub(super) alpha: [&'a mut [f32]; TILE],
    pub(super) depth: [&'a mut [f32]; TILE],
}

/// Memory that strips reuse, one after the other.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    entries: Vec<Entry>,
    spare: Vec<Entry>,
    segment: Segment,
    blocks: Vec<Block>,
    pub(super) clock: Clock,
}

/// Draws a strip.
pub(super) struct DrawStrip<'a, 'b> {
    /// Strip number in the grid, and its column and row there.
    pub(super) strip: usize,
    pub(super) column: usize,
    pub(super) row: usize,
    pub(super) bins: &'a [Bins],
    pub(super) splats: &'a [Splat],
    pub(super) background: [f32; 3],
    pub(super) rows: Rows<'b>,
    pub(super) scratch: &'a mut Scratch,
}

impl Kernel for DrawStrip<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, l: L) {
        self.scratch.clock.start();
        self.gather();
        if self.scratch.entries.is_empty() {
            self.fill_background();
            self.scratch.clock.lap(Phase::Write);
            return;
        }
        sort_by_depth(&mut self.scratch.entries, &mut self.scratch.spare);
        self.scratch.clock.lap(Phase::Sort);
        self.blend(l);
        self.write();
        self.scratch.clock.lap(Phase::Write);
    }
}

impl DrawStrip<'_, '_> {
    fn gather(&mut self) {
        self.scratch.entries.clear();
        for bins in self.bins {
            self.scratch.entries.extend_from_slice(bins.strip(self.strip));
        }
    }

    #[inline(always)]
    fn blend<L: Lanes>(&mut self, l: L) {
        let Scratch { entries, segment, blocks, clock, .. } = &mut *self.scratch;
        let left = self.column * STRIP_WIDTH;
        let top = self.row * TILE;
        let columns = self.rows.colour[0].len().div_ceil(BLOCK);
        blocks.clear();
        for _ in 0..TILE / BLOCK {
            blocks.extend((0..COLUMNS).map(|column| Block::new(left + column * BLOCK)));
        }
        for run in entries.chunks(SEGMENT) {
            segment.load(run.iter().map(|&e| self.splats[splat_of(e)]), self.column * STRIP_TILES, top);
            clock.lap(Phase::Bin);
            for (band, blocks) in blocks.chunks_mut(COLUMNS).enumerate() {
                segment.list_band(l, band);
                clock.lap(Phase::Bin);
                for (column, block) in blocks[..columns].iter_mut().enumerate() {
                    let list = segment.list(column);
                    if !list.is_empty() && !block.is_done() {
                        block.blend(l, top + band * BLOCK, list, &segment.splats);
                    }
                }
                clock.lap(Phase::Blend);
            }
        }
    }

    fn fill_background(&mut self) {
        self.rows.colour.iter_mut().for_each(|row| row.fill(self.background));
        self.rows.alpha.iter_mut().for_each(|row| row.fill(0.0));
        self.rows.depth.iter_mut().for_each(|row| row.fill(0.0));
    }

    #[inline(always)]
    fn write(&mut self) {
        let blocks = &self.scratch.blocks;
        for y in 0..TILE {
            let (band, within) = (y / BLOCK, y % BLOCK);
            let outputs =
                self.rows.colour[y].iter_mut().zip(&mut *self.rows.alpha[y]).zip(&mut *self.rows.depth[y]);
            for (x, ((colour, alpha), depth)) in outputs.enumerate() {
                let block = &blocks[band * COLUMNS + x / BLOCK];
                let pixel = block.pixel(within * BLOCK + x % BLOCK, self.background);
                (*colour, *alpha, *depth) = (pixel.colour, pixel.alpha, pixel.depth);
            }
        }
    }
}
