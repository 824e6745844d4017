//! Which 4x4-pixel blocks of a strip each splat reaches: exact up to a hundredth of a pixel, and never too few.
//!
//! In a band four pixels high the ellipse of alpha = 1/255 spans one interval of x, which has a closed form; the splat
//! reaches the blocks whose pixel centres lie in it, within the original's tile rectangle.

use super::bin::STRIP_TILES;
use super::lanes::Lanes;
use super::preprocess::{Paint, Splat};
use super::project::{SAFETY, TILE};

/// Side of a block, pixels.
pub(super) const BLOCK: usize = 4;
/// Blocks across a strip.
pub(super) const COLUMNS: usize = STRIP_TILES * BLOCKS_PER_TILE;
const BLOCKS_PER_TILE: usize = TILE / BLOCK;
/// Splats that are taken at a time: bounds the lists' memory, and lets a strip that is done stop early.
pub(super) const SEGMENT: usize = 4096;
/// Places after the lists' end that filling may overwrite.
const SLACK: usize = 1;

/// A run of a strip's splats, in drawing order, and where they reach.
#[derive(Debug, Default)]
pub(super) struct Segment {
    pub(super) paints: Vec<Paint>,
    bounds: Vec<Bounds>,
    /// Per splat, in the current band: first block in the low byte, end of the blocks above it.
    spans: Vec<u32>,
    lists: Vec<u16>,
    ends: Vec<u32>,
}

/// Sixteen splats' ellipses, relative to the strip, one number of each per row.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
struct Bounds {
    x: [f32; 16],
    y: [f32; 16],
    slope: [f32; 16],
    bend: [f32; 16],
    half_width_squared: [f32; 16],
    rightmost: [f32; 16],
    first_block: [f32; 16],
    end_block: [f32; 16],
}

impl Segment {
    /// Takes splats in drawing order; the strip begins at tile column `first_tile` and pixel row `top`.
    pub(super) fn load<'a>(
        &mut self,
        splats: impl Iterator<Item = &'a Splat>,
        first_tile: usize,
        top: usize,
    ) {
        self.paints.clear();
        self.bounds.clear();
        let left = (first_tile * TILE) as f32;
        let top = top as f32;
        let block = |tile: u16| {
            let within = usize::from(tile).saturating_sub(first_tile).min(STRIP_TILES);
            (within * BLOCKS_PER_TILE) as f32
        };
        for (i, splat) in splats.enumerate() {
            let lane = i % 16;
            if lane == 0 {
                self.bounds.push(Bounds::default());
            }
            let last = self.bounds.len() - 1;
            let b = &mut self.bounds[last];
            b.x[lane] = splat.paint.mean[0] - left;
            b.y[lane] = splat.paint.mean[1] - top;
            b.slope[lane] = splat.ellipse.slope;
            b.bend[lane] = splat.ellipse.bend;
            b.half_width_squared[lane] = splat.ellipse.half_width_squared;
            b.rightmost[lane] = splat.ellipse.rightmost;
            b.first_block[lane] = block(splat.columns[0]);
            b.end_block[lane] = block(splat.columns[1]);
            self.paints.push(splat.paint);
        }
    }

    /// Finds the lists of a band of blocks, counted from the strip's top.
    #[inline(always)]
    pub(super) fn list_band<L: Lanes>(&mut self, l: L, band: usize) {
        self.spans.clear();
        let top = (band * BLOCK) as f32;
        for bounds in &self.bounds {
            self.spans.extend(spans(l, bounds, top).map(|span| span as u32));
        }
        self.spans.truncate(self.paints.len());
        self.fill_lists();
    }

    /// Splats that reach a block of the band, in drawing order, as indices into `paints`.
    #[inline(always)]
    pub(super) fn list(&self, column: usize) -> &[u16] {
        let start = if column == 0 { 0 } else { self.ends[column - 1] as usize + SLACK };
        &self.lists[start..self.ends[column] as usize]
    }

    #[inline(always)]
    fn fill_lists(&mut self) {
        // Differences of the counts, then starts; filling turns them into ends.
        let mut next = [0_u32; COLUMNS + 1];
        for &span in &self.spans {
            let (first, end) = blocks_of(span);
            next[first] = next[first].wrapping_add(1);
            next[end] = next[end].wrapping_sub(1);
        }
        let (mut count, mut start) = (0_u32, 0_u32);
        for slot in &mut next {
            count = count.wrapping_add(*slot);
            *slot = start;
            start += count + SLACK as u32;
        }
        let total = start as usize;
        if self.lists.len() < total {
            self.lists.resize(total, 0);
        }
        for (i, &span) in self.spans.iter().enumerate() {
            let (first, end) = blocks_of(span);
            for slot in &mut next[first..end] {
                self.lists[*slot as usize] = i as u16;
                *slot += 1;
            }
        }
        self.ends.clear();
        self.ends.extend_from_slice(&next[..COLUMNS]);
    }
}

#[inline(always)]
fn blocks_of(span: u32) -> (usize, usize) {
    ((span % 256) as usize, (span / 256) as usize)
}

/// First block and 256 times the end block of each splat in the band whose first pixel row is `top`; 0 where it does not
/// reach the band.
#[inline(always)]
fn spans<L: Lanes>(l: L, b: &Bounds, top: f32) -> [i32; 16] {
    let load = |row: &[f32; 16]| l.load(row);
    let zero = l.splat(0.0);
    let low = l.sub(l.splat(top - SAFETY), load(&b.y));
    let high = l.add(low, l.splat((BLOCK - 1) as f32 + 2.0 * SAFETY));
    let within = |dy: L::F| l.max(low, l.min(high, dy));
    let (bend, width2) = (load(&b.bend), load(&b.half_width_squared));
    // Half the row's width, squared: negative where the ellipse does not reach the row.
    let square = |dy: L::F| l.neg_mul_add(bend, l.mul(dy, dy), width2);
    let right_dy = within(load(&b.rightmost));
    let left_dy = within(l.sub(zero, load(&b.rightmost)));
    let half = |dy: L::F| l.sqrt(l.max(square(dy), zero));
    let (slope, x) = (load(&b.slope), load(&b.x));
    let right = l.add(l.mul_add(slope, right_dy, x), half(right_dy));
    let left = l.sub(l.mul_add(slope, left_dy, x), half(left_dy));
    let quarter = l.splat(1.0 / BLOCK as f32);
    let first = l.ceil(l.mul(l.sub(left, l.splat((BLOCK - 1) as f32 + SAFETY)), quarter));
    let end = l.add(l.floor(l.mul(l.add(right, l.splat(SAFETY)), quarter)), l.splat(1.0));
    let first = l.max(first, load(&b.first_block));
    let end = l.min(end, load(&b.end_block));
    let packed = l.mul_add(end, l.splat(256.0), first);
    let misses = l.less(square(within(zero)), zero);
    let reached = l.keep(l.less(first, end), packed);
    l.to_integers(l.select(misses, zero, reached))
}
