//! Second phase: one strip of the image, from the chunks' lists to finished pixels.

use super::bin::{Bins, Entry, sort_by_depth, splat_of};
use super::blend::{Block, Pixels};
use super::grid::{BLOCK, BLOCKS, COLUMNS, STRIP_WIDTH, Strip, TILE};
use super::lanes::{Kernel, Lanes};
use super::layer::{Layer, LayerBlock};
use super::preprocess::Splat;
use super::profile::{Clock, Phase};
use super::reach::{SEGMENT, Segment};

/// The part of the output that a strip writes: up to sixteen rows of it, each of the strip's width.
#[derive(Default)]
pub(super) struct Rows<'a> {
    pub(super) colour: [&'a mut [[f32; 3]]; TILE],
    pub(super) alpha: [&'a mut [f32]; TILE],
    pub(super) depth: [&'a mut [f32]; TILE],
    /// What is shown of the layer; empty without one.
    pub(super) shown: [&'a mut [f32]; TILE],
}

/// Memory that strips reuse, one after the other.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    entries: Vec<Entry>,
    spare: Vec<Entry>,
    segment: Segment,
    /// Of the strip, band by band; `None` where no splat reached yet.
    blocks: Vec<Option<Block>>,
    background: Vec<[f32; 3]>,
    pub(super) clock: Clock,
}

/// Draws a strip.
pub(super) struct DrawStrip<'a, 'b, Y> {
    pub(super) strip: Strip,
    pub(super) bins: &'a [Bins],
    pub(super) splats: &'a [Splat],
    pub(super) background: [f32; 3],
    pub(super) layer: Y,
    pub(super) rows: Rows<'b>,
    pub(super) scratch: &'a mut Scratch,
}

impl<Y: Layer> Kernel for DrawStrip<'_, '_, Y> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, l: L) {
        self.scratch.clock.start();
        self.fill_background();
        self.scratch.clock.lap(Phase::Write);
        self.gather();
        if self.scratch.entries.is_empty() && !Y::Block::PRESENT {
            return;
        }
        sort_by_depth(&mut self.scratch.entries, &mut self.scratch.spare);
        self.scratch.clock.lap(Phase::Sort);
        let mut layers = self.layers();
        self.blend(l, &mut layers);
        self.write(l, &mut layers);
        self.scratch.clock.lap(Phase::Write);
    }
}

impl<Y: Layer> DrawStrip<'_, '_, Y> {
    fn gather(&mut self) {
        self.scratch.entries.clear();
        for bins in self.bins {
            self.scratch.entries.extend_from_slice(bins.strip(self.strip.number));
        }
    }

    /// The layer by block.
    #[inline(always)]
    fn layers(&self) -> Vec<Y::Block> {
        (0..BLOCKS).map(|block| self.layer.block(self.strip.corner(block))).collect()
    }

    #[inline(always)]
    fn blend<L: Lanes>(&mut self, l: L, layers: &mut [Y::Block]) {
        let Scratch { entries, segment, blocks, clock, .. } = &mut *self.scratch;
        blocks.clear();
        blocks.resize(BLOCKS, None);
        for run in entries.chunks(SEGMENT) {
            segment.load(run.iter().map(|&e| self.splats[splat_of(e)]), self.strip);
            clock.lap(Phase::Bin);
            let bands = blocks.chunks_mut(COLUMNS).zip(layers.chunks_mut(COLUMNS));
            for (band, (blocks, layers)) in bands.enumerate() {
                segment.list_band(l, band);
                clock.lap(Phase::Bin);
                for (column, (block, layer)) in blocks.iter_mut().zip(layers).enumerate() {
                    let list = segment.list(column);
                    if !list.is_empty() {
                        let corner = self.strip.corner(band * COLUMNS + column);
                        let block = block.get_or_insert_with(Block::new);
                        block.blend(l, corner, list, &segment.splats, layer);
                    }
                }
                clock.lap(Phase::Blend);
            }
        }
    }

    fn fill_background(&mut self) {
        let row = &mut self.scratch.background;
        row.clear();
        row.resize(STRIP_WIDTH, self.background);
        self.rows.colour.iter_mut().for_each(|colour| colour.copy_from_slice(&row[..colour.len()]));
        self.rows.alpha.iter_mut().for_each(|row| row.fill(0.0));
        self.rows.depth.iter_mut().for_each(|row| row.fill(0.0));
    }

    #[inline(always)]
    fn write<L: Lanes>(&mut self, l: L, layers: &mut [Y::Block]) {
        let bands = self.scratch.blocks.chunks_mut(COLUMNS).zip(layers.chunks_mut(COLUMNS));
        for (band, (blocks, layers)) in bands.enumerate() {
            for (column, (block, layer)) in blocks.iter_mut().zip(layers).enumerate() {
                let (left, top) = (column * BLOCK, band * BLOCK);
                if Y::Block::PRESENT {
                    block.get_or_insert_with(Block::new).finish(l, layer);
                    write_shown(layer.shown(), &mut self.rows, left, top);
                }
                if let Some(block) = block {
                    block.pixels(l, self.background).write(&mut self.rows, left, top);
                }
            }
        }
    }
}

/// Writes the part of a block's shares that lies within the image.
fn write_shown(shown: &[f32; 16], rows: &mut Rows, left: usize, top: usize) {
    for (row, values) in shown.chunks(BLOCK).enumerate() {
        if let Some(out) = rows.shown[top + row].get_mut(left..) {
            out.iter_mut().zip(values).for_each(|(out, value)| *out = *value);
        }
    }
}

impl Pixels {
    /// Writes the part of a block that lies within the image.
    #[inline(always)]
    fn write(&self, rows: &mut Rows, left: usize, top: usize) {
        for row in 0..BLOCK {
            let at = |i: usize| row * BLOCK + i;
            let colour = |i: usize| [self.red[at(i)], self.green[at(i)], self.blue[at(i)]];
            let (Some(colours), Some(alphas), Some(depths)) = (
                rows.colour[top + row].get_mut(left..),
                rows.alpha[top + row].get_mut(left..),
                rows.depth[top + row].get_mut(left..),
            ) else {
                return; // below the image
            };
            if let (Some(colours), Some(alphas), Some(depths)) = (
                colours.first_chunk_mut::<BLOCK>(),
                alphas.first_chunk_mut::<BLOCK>(),
                depths.first_chunk_mut::<BLOCK>(),
            ) {
                *colours = [colour(0), colour(1), colour(2), colour(3)];
                alphas.copy_from_slice(&self.alpha[at(0)..at(BLOCK)]);
                depths.copy_from_slice(&self.depth[at(0)..at(BLOCK)]);
            } else {
                for i in 0..colours.len() {
                    (colours[i], alphas[i], depths[i]) = (colour(i), self.alpha[at(i)], self.depth[at(i)]);
                }
            }
        }
    }
}
