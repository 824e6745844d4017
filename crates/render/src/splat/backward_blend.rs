//! The adjoint of blending one 4x4-pixel block: from derivatives by pixel to derivatives by splat.
//!
//! A walk front to back finds again what every splat gave to every pixel, by the forward pass's own operations. A walk
//! back to front then knows the colour behind each splat, so nothing is divided by what little light is left:
//! with g·c the upstream derivative along a colour, `dL/dα = T (g·c − g·c_behind)`.
//!
//! Sums over the pixels are taken for sixteen splats at once, after turning sixteen vectors of pixels into vectors of
//! splats. A splat's mean and conic need nothing but the moments of `dL/d ln α` over the pixels, and within a block
//! pixel coordinates are the constants 0 to 3.

use super::accumulator::{LEAST_TRANSMITTANCE, MAX_ALPHA};
use super::blend::{BETWEEN_CHECKS, COLUMN, ROW, uncapped_alpha};
use super::grid::pixels_of_block;
use super::lanes::Lanes;
use super::layer::LayerBlock;
use super::preprocess::Splat;
use super::wide::{Wide, each};
use skinsplat_core::scene::RenderedGradient;

/// What a splat collects from pixels: Σ g, Σ g dx, Σ g dy, Σ g dx², Σ g dx dy, Σ g dy², then Σ α T dL/dC of red, green
/// and blue, then nothing; g is `dL/d ln α` of a pixel and d the mean less the pixel.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct SplatSums(pub(super) [f32; 16]);

/// The first of the three colours' sums in [`SplatSums`].
pub(super) const COLOUR_SUMS: usize = 6;

/// Upstream derivatives of a block, zero outside the image.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct BlockUpstream {
    colour: [[f32; 16]; 3],
    /// Along the colour behind the splats that were not visited yet; at first along the background's, less that of
    /// alpha.
    behind: [f32; 16],
}

impl BlockUpstream {
    /// The block whose first pixel is `corner`.
    #[inline(always)]
    pub(super) fn load(upstream: &RenderedGradient, background: [f32; 3], corner: [usize; 2]) -> Self {
        let mut block = Self { colour: [[0.0; 16]; 3], behind: [0.0; 16] };
        pixels_of_block(corner, [upstream.image.width(), upstream.image.height()], |pixel, lane| {
            let [r, g, b] = upstream.image.pixels()[pixel];
            let alpha = upstream.alpha.as_ref().map_or(0.0, |alpha| alpha.values()[pixel]);
            for (row, value) in block.colour.iter_mut().zip([r, g, b]) {
                row[lane] = value;
            }
            block.behind[lane] = r * background[0] + g * background[1] + b * background[2] - alpha;
        });
        block
    }

    /// Whether no pixel asks for anything.
    pub(super) fn is_zero(&self) -> bool {
        self.colour.as_flattened().iter().chain(&self.behind).all(|&v| v == 0.0)
    }
}

/// What one splat gave to the pixels of a block.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Share {
    /// Alpha before its cap, 0 where the splat was not blended.
    uncapped: [f32; 16],
    /// Transmittance in front of the splat.
    transmittance: [f32; 16],
}

/// The splats that a block blended, in drawing order.
#[derive(Debug, Default)]
pub(super) struct Shares {
    shares: Vec<Share>,
    /// Index of each within its segment.
    splats: Vec<u16>,
    count: usize,
    pending: Pending,
}

impl Shares {
    /// Walks a list as the forward pass does, from pixels that are `open` (transmittance, 0 where done).
    #[inline(always)]
    pub(super) fn collect<L: Lanes>(
        &mut self,
        l: L,
        [left, top]: [usize; 2],
        list: &[u16],
        splats: &[Splat],
        layer: &mut impl LayerBlock,
        open: &mut [f32; 16],
    ) {
        if self.shares.len() < list.len() {
            self.shares.resize(list.len(), Share { uncapped: [0.0; 16], transmittance: [0.0; 16] });
            self.splats.resize(list.len(), 0);
        }
        let n = |value: f32| Wide::splat(l, value);
        let x = Wide::load(l, &COLUMN) + n(left as f32);
        let y = Wide::load(l, &ROW) + n(top as f32);
        let mut transmittance = Wide::load(l, open);
        let (shares, indices) = (&mut self.shares[..list.len()], &mut self.splats[..list.len()]);
        let mut count = 0;
        for run in list.chunks(BETWEEN_CHECKS) {
            if !n(0.0).less(transmittance).any() {
                break;
            }
            for &i in run {
                let screen = &splats[usize::from(i)].screen;
                layer.dim(l, screen.depth, &mut transmittance);
                let uncapped = uncapped_alpha(screen, x, y);
                let after = uncapped.min(n(MAX_ALPHA)).neg_mul_add(transmittance, transmittance);
                let enough = after.at_least(n(LEAST_TRANSMITTANCE));
                let uncapped = enough.keep(uncapped);
                shares[count] = Share { uncapped: uncapped.store(), transmittance: transmittance.store() };
                indices[count] = i;
                // Without a branch: the next splat overwrites one that gave nothing.
                count += usize::from(n(0.0).less(uncapped).any());
                transmittance = enough.keep(after);
            }
        }
        self.count = count;
        *open = transmittance.store();
    }
}

/// One block on the way back.
pub(super) struct BlockAdjoint<'a, P> {
    pub(super) corner: [usize; 2],
    pub(super) shares: &'a mut Shares,
    /// Of the segment.
    pub(super) splats: &'a [Splat],
    /// Place in `sums` of each splat of the segment.
    pub(super) places: &'a [u32],
    /// Uncapped alphas above this pass no derivative on.
    pub(super) greatest_alpha: f32,
    /// What lies among the splats and was not crossed yet.
    pub(super) layer: &'a mut P,
}

/// Vectors of pixels of up to sixteen splats, before they are summed.
#[derive(Debug, Default)]
#[repr(C, align(64))]
struct Pending {
    power: [[f32; 16]; 16],
    weight: [[f32; 16]; 16],
    mean: [[f32; 16]; 2],
    places: [u32; 16],
}

impl<P: LayerBlock> BlockAdjoint<'_, P> {
    /// Adds to `sums` what the block's pixels ask of its splats.
    #[inline(always)]
    pub(super) fn run<L: Lanes>(self, l: L, upstream: &mut BlockUpstream, sums: &mut [SplatSums]) {
        let n = |value: f32| Wide::splat(l, value);
        let colour = each(upstream.colour, |c| Wide::load(l, &c));
        let mut after = Wide::load(l, &upstream.behind);
        let Shares { shares, splats, count, pending } = &mut *self.shares;
        for (shares, indices) in shares[..*count].rchunks(16).zip(splats[..*count].rchunks(16)) {
            for (k, (share, &i)) in shares.iter().zip(indices).enumerate().rev() {
                let i = usize::from(i);
                let screen = &self.splats[i].screen;
                self.layer.cross_back(l, screen.depth, &colour, &mut after);
                let uncapped = Wide::load(l, &share.uncapped);
                let transmittance = Wide::load(l, &share.transmittance);
                let alpha = uncapped.min(n(MAX_ALPHA));
                let [r, g, b] = each(screen.colour, n);
                let along = colour[2].mul_add(b, colour[1].mul_add(g, colour[0] * r));
                let difference = along - after;
                let free = n(self.greatest_alpha).at_least(uncapped).keep(uncapped);
                pending.power[k] = (free * transmittance * difference).store();
                pending.weight[k] = (alpha * transmittance).store();
                pending.mean[0][k] = screen.mean[0];
                pending.mean[1][k] = screen.mean[1];
                pending.places[k] = self.places[i];
                after = alpha.mul_add(difference, after);
            }
            pending.flush(l, self.corner, upstream, shares.len(), sums);
        }
        upstream.behind = after.store();
    }
}

impl Pending {
    /// Sums over pixels of the first `count` pending splats.
    #[inline(always)]
    fn flush<L: Lanes>(
        &self,
        l: L,
        corner: [usize; 2],
        upstream: &BlockUpstream,
        count: usize,
        sums: &mut [SplatSums],
    ) {
        let n = |value: f32| Wide::splat(l, value);
        let mut out = [n(0.0); 16];
        let centre = each([0, 1], |axis| Wide::load(l, &self.mean[axis]) - n(corner[axis] as f32));
        out[..COLOUR_SUMS].copy_from_slice(&moments(&Wide::load_transposed(l, &self.power), centre));
        let weight = Wide::load_transposed(l, &self.weight);
        for (out, upstream) in out[COLOUR_SUMS..].iter_mut().zip(&upstream.colour) {
            // Two sums, since one would wait for itself.
            let mut parts = [weight[0] * n(upstream[0]), weight[1] * n(upstream[1])];
            for pixel in 2..16 {
                parts[pixel % 2] = weight[pixel].mul_add(n(upstream[pixel]), parts[pixel % 2]);
            }
            *out = parts[0] + parts[1];
        }
        let rows = Wide::transpose(&out);
        for (row, &place) in rows.iter().zip(&self.places[..count]) {
            let sum = &mut sums[place as usize].0;
            *sum = (Wide::load(l, sum) + *row).store();
        }
    }
}

/// Σ g, Σ g dx, Σ g dy, Σ g dx², Σ g dx dy, Σ g dy² over a block's pixels, with d measured from the pixel to `centre`;
/// `g` by pixel, row by row.
#[inline(always)]
fn moments<L: Lanes>(g: &[Wide<L>; 16], [cx, cy]: [Wide<L>; 2]) -> [Wide<L>; 6] {
    let [a, ax, axx] = line_moments([g[0], g[1], g[2], g[3]]);
    let [b, bx, bxx] = line_moments([g[4], g[5], g[6], g[7]]);
    let [c, cx1, cxx] = line_moments([g[8], g[9], g[10], g[11]]);
    let [d, dx1, dxx] = line_moments([g[12], g[13], g[14], g[15]]);
    let [all, y, yy] = line_moments([a, b, c, d]);
    let [x, xy, _] = line_moments([ax, bx, cx1, dx1]);
    let xx = (axx + bxx) + (cxx + dxx);
    // From the block's corner to the splat's centre.
    let (dx, dy) = (cx.mul_add(all, -x), cy.mul_add(all, -y));
    [all, dx, dy, cx.mul_add(dx - x, xx), cx.mul_add(dy, cy.neg_mul_add(x, xy)), cy.mul_add(dy - y, yy)]
}

/// Σ v, Σ i v, Σ i² v.
#[inline(always)]
fn line_moments<L: Lanes>([v0, v1, v2, v3]: [Wide<L>; 4]) -> [Wide<L>; 3] {
    let n = |value: f32| v0.constant(value);
    [
        (v0 + v1) + (v2 + v3),
        v3.mul_add(n(3.0), v2.mul_add(n(2.0), v1)),
        v3.mul_add(n(9.0), v2.mul_add(n(4.0), v1)),
    ]
}
