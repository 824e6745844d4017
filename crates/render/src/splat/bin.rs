//! Which splats reach which strip of the image, and in which order they are drawn.
//!
//! A strip is one tile high and up to sixteen wide: the unit of parallel work. Every chunk of Gaussians sorts its own
//! splats by strip; a strip then gathers its splats from all chunks, in index order, and sorts them by depth. No step
//! depends on the number of threads, and none is serial.

use super::grid::{Grid, STRIP_TILES};
use std::ops::Range;

/// A splat in a strip's list: depth bits above its index, so that numeric order is drawing order. (View depths are
/// positive, whose bits order as they do.)
pub(super) type Entry = u64;

/// The splat of an entry.
#[inline(always)]
pub(super) fn splat_of(entry: Entry) -> usize {
    entry as u32 as usize
}

/// The splats of one chunk, by strip.
#[derive(Debug, Default)]
pub(super) struct Bins {
    /// Strip and splat, in index order.
    pairs: Vec<(u32, Entry)>,
    entries: Vec<Entry>,
    /// `entries[ends[s - 1]..ends[s]]` belong to strip s.
    ends: Vec<u32>,
    splats: usize,
    /// One bit per Gaussian of the chunk, sixteen in a row: which of them were entered.
    visible: Vec<u16>,
}

impl Bins {
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.pairs.clear();
        self.visible.clear();
        self.splats = 0;
    }

    /// Notes which of the next sixteen Gaussians were entered.
    #[inline(always)]
    pub(super) fn push_visible(&mut self, sixteen: u16) {
        self.visible.push(sixteen);
    }

    /// Which Gaussians of the chunk were entered: one bit each, sixteen in a row.
    pub(super) fn visible(&self) -> &[u16] {
        &self.visible
    }

    /// Number of strips that splats were sorted into.
    pub(super) fn strips(&self) -> usize {
        self.ends.len().saturating_sub(1)
    }

    /// Number of splats that were entered.
    pub(super) fn splats(&self) -> usize {
        self.splats
    }

    /// Enters a splat into the strips that hold a non-empty rectangle of tiles (x from, x to, y from, y to; half open).
    /// Indices must rise.
    #[inline(always)]
    pub(super) fn push(&mut self, grid: Grid, index: u32, depth: f32, [x0, x1, y0, y1]: [u16; 4]) {
        let entry = u64::from(depth.to_bits()) << 32 | u64::from(index);
        self.splats += 1;
        for y in usize::from(y0)..usize::from(y1) {
            for x in usize::from(x0) / STRIP_TILES..=usize::from(x1 - 1) / STRIP_TILES {
                self.pairs.push(((y * grid.across + x) as u32, entry));
            }
        }
    }

    /// Sorts what was entered by strip, by counting.
    #[inline(always)]
    pub(super) fn finish(&mut self, grid: Grid) {
        // Shifted by one, so that filling turns starts into ends.
        self.ends.clear();
        self.ends.resize(grid.count() + 1, 0);
        for &(strip, _) in &self.pairs {
            self.ends[strip as usize + 1] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            total += *end;
            *end = total;
        }
        self.entries.clear();
        self.entries.resize(total as usize, 0);
        for &(strip, entry) in &self.pairs {
            let slot = &mut self.ends[strip as usize];
            self.entries[*slot as usize] = entry;
            *slot += 1;
        }
    }

    /// The splats of a strip, in index order.
    #[inline(always)]
    pub(super) fn strip(&self, strip: usize) -> &[Entry] {
        &self.entries[self.range(strip)]
    }

    #[inline(always)]
    fn range(&self, strip: usize) -> Range<usize> {
        let start = if strip == 0 { 0 } else { self.ends[strip - 1] };
        start as usize..self.ends[strip] as usize
    }
}

/// Below this length a comparison sort is faster than counting digits.
const SHORT: usize = 192;
const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Sorts a strip's list by depth, equal depths by index. The list must be in index order; `spare` is scratch.
pub(super) fn sort_by_depth(entries: &mut Vec<Entry>, spare: &mut Vec<Entry>) {
    if entries.len() < SHORT {
        entries.sort_unstable();
        return;
    }
    let depth = |entry: &Entry| (entry >> 32) as u32;
    let least = entries.iter().map(depth).min().unwrap_or(0);
    let most = entries.iter().map(depth).max().unwrap_or(0);
    let bits = u32::BITS - (most - least).leading_zeros();
    spare.clear();
    spare.resize(entries.len(), 0);
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        let digit = |entry: &Entry| ((depth(entry) - least) >> shift) as usize % DIGITS;
        let mut slots = [0_u32; DIGITS];
        for entry in entries.iter() {
            slots[digit(entry)] += 1;
        }
        let mut start = 0;
        for slot in &mut slots {
            start += std::mem::replace(slot, start);
        }
        for entry in entries.iter() {
            let slot = &mut slots[digit(entry)];
            spare[*slot as usize] = *entry;
            *slot += 1;
        }
        std::mem::swap(entries, spare);
    }
}
