//! Which 4x4-pixel blocks of a strip each splat reaches: exact up to a hundredth of a pixel, and never too few.
//!
//! In a band four pixels high the ellipse of alpha = 1/255 spans one interval of x, which has a closed form; the splat
//! reaches the blocks whose pixel centres lie in it, within the original's tile rectangle.

use super::grid::{BLOCK, BLOCKS_PER_TILE, COLUMNS, STRIP_TILES, Strip, TILE};
use super::lanes::Lanes;
use super::preprocess::Splat;
use super::project::{Ellipse, SAFETY};
use super::wide::Wide;

/// Splats that are taken at a time: bounds the lists' memory, and lets a strip that is done stop early.
pub(super) const SEGMENT: usize = 4096;
/// Blocks that a splat is entered into without a branch.
const AT_ONCE: usize = 4;
/// Places after each list's end that filling may overwrite.
const SLACK: usize = 1;
/// One place per value of a byte.
const NEXT: usize = 256;

/// A run of a strip's splats, in drawing order, and where they reach.
#[derive(Debug)]
pub(super) struct Segment {
    pub(super) splats: Vec<Splat>,
    bounds: Vec<Bounds>,
    spans: Vec<[i32; 16]>,
    /// The `kept` splats that reach the band: index in the high half, span in the low.
    reached: Vec<u32>,
    kept: usize,
    /// Of all blocks of the band, one after the other.
    lists: Vec<u16>,
    /// Where each block's list ends.
    next: [u32; NEXT],
}

impl Default for Segment {
    fn default() -> Self {
        Self {
            splats: Vec::new(),
            bounds: Vec::new(),
            spans: Vec::new(),
            reached: Vec::new(),
            kept: 0,
            lists: Vec::new(),
            next: [0; NEXT],
        }
    }
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
    /// Takes splats of a strip, in drawing order.
    #[inline(always)]
    pub(super) fn load(&mut self, splats: impl Iterator<Item = Splat>, strip: Strip) {
        // A loop that only copies keeps as many cache misses in flight as there can be.
        self.splats.clear();
        self.splats.extend(splats);
        let first_tile = strip.first_tile();
        let (left, top) = ((first_tile * TILE) as f32, strip.top() as f32);
        let block = |tile: u16| {
            let within = usize::from(tile).saturating_sub(first_tile).min(STRIP_TILES);
            (within * BLOCKS_PER_TILE) as f32
        };
        self.bounds.clear();
        for group in self.splats.chunks(16) {
            let mut b = Bounds::default();
            for (lane, splat) in group.iter().enumerate() {
                b.x[lane] = splat.screen.mean[0] - left;
                b.y[lane] = splat.screen.mean[1] - top;
                b.slope[lane] = splat.ellipse.slope;
                b.bend[lane] = splat.ellipse.bend;
                b.half_width_squared[lane] = splat.ellipse.half_width_squared;
                b.rightmost[lane] = splat.ellipse.rightmost;
                b.first_block[lane] = block(splat.columns[0]);
                b.end_block[lane] = block(splat.columns[1]);
            }
            self.bounds.push(b);
        }
    }

    /// Finds the lists of a band of blocks, counted from the strip's top.
    #[inline(always)]
    pub(super) fn list_band<L: Lanes>(&mut self, l: L, band: usize) {
        self.spans.clear();
        let top = (band * BLOCK) as f32;
        for bounds in &self.bounds {
            self.spans.push(spans(l, bounds, top));
        }
        self.keep_reached();
        self.fill_lists();
    }

    /// Splats that reach a block of the band, in drawing order, as indices into `splats`.
    #[inline(always)]
    pub(super) fn list(&self, column: usize) -> &[u16] {
        let start = if column == 0 { 0 } else { self.next[column - 1] as usize + SLACK };
        &self.lists[start..self.next[column] as usize]
    }

    /// Collects the splats that reach the band, without a branch to predict.
    #[inline(always)]
    fn keep_reached(&mut self) {
        let spans = self.spans.as_flattened();
        if self.reached.len() < spans.len() {
            self.reached.resize(spans.len(), 0);
        }
        let mut kept = 0;
        for (i, &span) in spans.iter().enumerate() {
            self.reached[kept] = (i as u32) << 16 | span as u32;
            kept += usize::from(span != 0);
        }
        self.kept = kept;
    }

    #[inline(always)]
    fn fill_lists(&mut self) {
        // Differences of the counts, then starts; filling turns them into ends. An index of 8 bits cannot miss the array.
        let next = &mut self.next;
        *next = [0; NEXT];
        let reached = &self.reached[..self.kept];
        for &splat in reached {
            let [first, end, ..] = splat.to_le_bytes();
            next[usize::from(first)] = next[usize::from(first)].wrapping_add(1);
            next[usize::from(end)] = next[usize::from(end)].wrapping_sub(1);
        }
        let (mut count, mut start) = (0_u32, 0_u32);
        for slot in &mut next[..COLUMNS + AT_ONCE] {
            count = count.wrapping_add(*slot);
            *slot = start;
            start += count + SLACK as u32;
        }
        let total = start as usize;
        if self.lists.len() < total {
            self.lists.resize(total, 0);
        }
        for &splat in reached {
            let [first, end, ..] = splat.to_le_bytes();
            let i = (splat >> 16) as u16;
            // Most splats reach few blocks. Writing a fixed number of places, and moving on only in the lists that are
            // reached, has no branch to predict; a place past a list's end is its slack.
            for column in first..first + AT_ONCE as u8 {
                let slot = &mut next[usize::from(column)];
                self.lists[*slot as usize] = i;
                *slot += u32::from(column < end);
            }
            for column in first + AT_ONCE as u8..end {
                let slot = &mut next[usize::from(column)];
                self.lists[*slot as usize] = i;
                *slot += 1;
            }
        }
    }
}

/// First block in the low byte and end of the blocks in the high byte, of each splat in the band whose first pixel row is
/// `top`; 0 where it does not reach the band.
#[inline(always)]
fn spans<L: Lanes>(l: L, b: &Bounds, top: f32) -> [i32; 16] {
    let load = |row: &[f32; 16]| Wide::load(l, row);
    let n = |value: f32| Wide::splat(l, value);
    let low = n(top - SAFETY) - load(&b.y);
    let high = low + n((BLOCK - 1) as f32 + 2.0 * SAFETY);
    let within = |dy: Wide<L>| dy.min(high).max(low);
    let ellipse = Ellipse {
        slope: load(&b.slope),
        bend: load(&b.bend),
        half_width_squared: load(&b.half_width_squared),
        rightmost: load(&b.rightmost),
    };
    let (right_dy, left_dy) = (within(ellipse.rightmost), within(-ellipse.rightmost));
    let x = load(&b.x);
    let right = ellipse.slope.mul_add(right_dy, x) + half_width(&ellipse, right_dy);
    let left = ellipse.slope.mul_add(left_dy, x) - half_width(&ellipse, left_dy);
    let per_block = n(1.0 / BLOCK as f32);
    let first = ((left - n((BLOCK - 1) as f32 + SAFETY)) * per_block).ceil();
    let end = ((right + n(SAFETY)) * per_block).floor() + n(1.0);
    let first = first.max(load(&b.first_block));
    let end = end.min(load(&b.end_block));
    let packed = end.mul_add(n(256.0), first);
    let misses = half_width_squared(&ellipse, within(n(0.0))).less(n(0.0));
    misses.select(n(0.0), first.less(end).keep(packed)).to_integers()
}

/// Half the width of row `dy`, squared: negative where the ellipse does not reach the row. (A closure that is used more than
/// once is not always inlined, and then has no vector instructions.)
#[inline(always)]
fn half_width_squared<L: Lanes>(ellipse: &Ellipse<Wide<L>>, dy: Wide<L>) -> Wide<L> {
    ellipse.bend.neg_mul_add(dy * dy, ellipse.half_width_squared)
}

#[inline(always)]
fn half_width<L: Lanes>(ellipse: &Ellipse<Wide<L>>, dy: Wide<L>) -> Wide<L> {
    half_width_squared(ellipse, dy).max(dy.constant(0.0)).sqrt()
}
