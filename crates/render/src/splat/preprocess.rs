//! First phase: a chunk of Gaussians becomes splats, entered into the strips that they reach.

use super::bin::Bins;
use super::colour;
use super::grid::Grid;
use super::lanes::{Kernel, Lanes};
use super::project::{Ellipse, HALF_LOG2_E, Projected, Projection, project};
use super::wide::{Wide, each};
use skinsplat_core::scene::Posed;

pub(super) const LANES: usize = 16;

/// Everything that the later phases read of a visible Gaussian: one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Splat {
    pub(super) screen: ScreenGaussian,
    pub(super) ellipse: Ellipse<f32>,
    /// Tile columns that it may touch, half open.
    pub(super) columns: [u16; 2],
}

/// What blending reads of a splat.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScreenGaussian {
    /// Pixel position; pixel i has its centre at i.
    pub(super) mean: [f32; 2],
    /// `alpha = opacity 2^-(a dx² + b dx dy + c dy²)`.
    pub(super) conic: [f32; 3],
    pub(super) opacity: f32,
    /// The exponent up to which alpha is at least 1/255.
    pub(super) reach: f32,
    pub(super) colour: [f32; 3],
    pub(super) depth: f32,
}

impl ScreenGaussian {
    #[inline(always)]
    pub(super) fn new(p: &Projected<f32>, colour: [f32; 3]) -> Self {
        let [a, b, c] = p.conic;
        Self {
            mean: p.mean,
            conic: [HALF_LOG2_E * a, 2.0 * HALF_LOG2_E * b, HALF_LOG2_E * c],
            opacity: p.opacity,
            reach: p.reach,
            colour,
            depth: p.depth,
        }
    }
}

/// Projects the Gaussians `first..first + splats.len()`; the visible ones come out at the front of `splats`.
pub(super) struct Preprocess<'a> {
    pub(super) posed: &'a Posed<'a>,
    pub(super) projection: &'a Projection,
    pub(super) grid: Grid,
    pub(super) first: usize,
    pub(super) splats: &'a mut [Splat],
    pub(super) bins: &'a mut Bins,
}

impl Kernel for Preprocess<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self { posed, projection, grid, first, splats, bins } = self;
        let coefficients = colour::sh_count(posed);
        let mut written = 0;
        bins.clear();
        for start in (0..splats.len()).step_by(LANES) {
            let count = LANES.min(splats.len() - start);
            let base = first + start;
            let group = Group::load(posed, base, count);
            let projected = group.project(l, projection).map(|row| row.store());
            let basis = each(group.basis(l, projection), Wide::store);
            let mut visible = 0_u16;
            for lane in 0..count {
                if projected.visible[lane] == 0.0 {
                    continue;
                }
                let sh = &posed.sh[(base + lane) * coefficients..][..coefficients];
                let colour = colour::evaluate(l, sh, |k| basis[k][lane]);
                if !colour.iter().all(|c| c.is_finite()) {
                    continue;
                }
                let p = projected.map(|row| row[lane]);
                let tiles = each(p.tiles, |t| t as u16);
                let colour = colour::clamped(colour, posed.colour_clamp);
                splats[written] = Splat {
                    screen: ScreenGaussian::new(&p, colour),
                    ellipse: p.ellipse,
                    columns: [tiles[0], tiles[1]],
                };
                bins.push(grid, (first + written) as u32, p.depth, tiles);
                written += 1;
                visible |= 1 << lane;
            }
            bins.push_visible(visible);
        }
        bins.finish(grid);
    }
}

/// Sixteen Gaussians, one number of each per row.
pub(super) struct Group {
    pub(super) means: [[f32; LANES]; 3],
    /// By columns.
    pub(super) factors: [[[f32; LANES]; 3]; 3],
    /// By columns.
    pub(super) frames: Option<[[[f32; LANES]; 3]; 3]>,
    pub(super) opacities: [f32; LANES],
}

impl Group {
    /// `count` Gaussians from `base` on; the other lanes have opacity 0 and so are culled.
    #[inline(always)]
    pub(super) fn load(posed: &Posed, base: usize, count: usize) -> Self {
        let range = base..base + count;
        let mut means = [[0.0; LANES]; 3];
        for (lane, mean) in posed.means[range.clone()].iter().enumerate() {
            scatter(&mut means, lane, mean.to_array());
        }
        let mut opacities = [0.0; LANES];
        opacities[..count].copy_from_slice(&posed.opacities[range.clone()]);
        let factors = transposed(&posed.factors[range.clone()]);
        let frames = posed.view_frames.as_ref().map(|frames| transposed(&frames[range]));
        Self { means, factors, frames, opacities }
    }

    #[inline(always)]
    fn project<L: Lanes>(&self, l: L, projection: &Projection) -> Projected<Wide<L>> {
        let load = |row: [f32; LANES]| Wide::load(l, &row);
        let factors = each(self.factors, |column| each(column, load));
        project(projection, each(self.means, load), factors, load(self.opacities))
    }

    #[inline(always)]
    fn basis<L: Lanes>(&self, l: L, projection: &Projection) -> [Wide<L>; 16] {
        let load = |row: [f32; LANES]| Wide::load(l, &row);
        let frames = self.frames.map(|frames| each(frames, |column| each(column, load)));
        colour::basis(colour::direction(each(self.means, load), projection.position, frames).unit)
    }
}

#[inline(always)]
fn scatter(rows: &mut [[f32; LANES]; 3], lane: usize, values: [f32; 3]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row[lane] = value;
    }
}

#[inline(always)]
fn transposed(matrices: &[glam::Mat3]) -> [[[f32; LANES]; 3]; 3] {
    let mut rows = [[[0.0; LANES]; 3]; 3];
    for (lane, matrix) in matrices.iter().enumerate() {
        for (rows, column) in rows.iter_mut().zip(matrix.to_cols_array_2d()) {
            scatter(rows, lane, column);
        }
    }
    rows
}
