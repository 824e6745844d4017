//! How the image is cut: strips of 16x16-pixel tiles, the unit of parallel work, and 4x4-pixel blocks, which registers hold.

pub(super) use skinsplat_core::scene::rasterizer::TILE;

/// Width of a strip, tiles.
pub(super) const STRIP_TILES: usize = 16;
/// Width of a strip, pixels.
pub(super) const STRIP_WIDTH: usize = STRIP_TILES * TILE;
/// Side of a block, pixels.
pub(super) const BLOCK: usize = 4;
/// Blocks across a tile.
pub(super) const BLOCKS_PER_TILE: usize = TILE / BLOCK;
/// Blocks across a strip.
pub(super) const COLUMNS: usize = STRIP_TILES * BLOCKS_PER_TILE;
/// Blocks of a strip, band by band.
pub(super) const BLOCKS: usize = COLUMNS * BLOCKS_PER_TILE;

/// The strips of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Strips across and down.
    pub(super) across: usize,
    down: usize,
}

impl Grid {
    /// Of an image of so many tiles across and down.
    pub(super) fn new(tiles: [usize; 2]) -> Self {
        Self { across: tiles[0].div_ceil(STRIP_TILES), down: tiles[1] }
    }

    pub(super) fn count(self) -> usize {
        self.across * self.down
    }

    /// The strip of a number, row by row.
    pub(super) fn strip(self, number: usize) -> Strip {
        Strip { number, column: number % self.across, row: number / self.across }
    }
}

/// One strip: its number, and its column and row in the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strip {
    pub(super) number: usize,
    column: usize,
    row: usize,
}

impl Strip {
    /// Column of its first tile.
    pub(super) fn first_tile(self) -> usize {
        self.column * STRIP_TILES
    }

    /// Row of its first pixels.
    pub(super) fn top(self) -> usize {
        self.row * TILE
    }

    /// The first pixel (x, y) of one of its blocks.
    pub(super) fn corner(self, block: usize) -> [usize; 2] {
        let (band, column) = (block / COLUMNS, block % COLUMNS);
        [self.column * STRIP_WIDTH + column * BLOCK, self.top() + band * BLOCK]
    }
}

/// Calls `visit` with the index of every pixel of a block that lies within the image, and with its lane: pixels of a block
/// are numbered row by row.
#[inline(always)]
pub(super) fn pixels_of_block(
    [left, top]: [usize; 2],
    [width, height]: [usize; 2],
    mut visit: impl FnMut(usize, usize),
) {
    for y in top..height.min(top + BLOCK) {
        for x in left..width.min(left + BLOCK) {
            visit(y * width + x, (y - top) * BLOCK + x - left);
        }
    }
}
