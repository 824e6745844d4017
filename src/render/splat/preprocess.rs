//! First phase: a chunk of Gaussians becomes splats, entered into the strips that they reach.

use super::bin::{Bins, Grid};
use super::colour;
use super::lanes::{Kernel, Lanes};
use super::project::{Ellipse, FIELDS, HALF_LOG2_E, Projected, VISIBLE, View, project};
use crate::scene::Posed;

const LANES: usize = 16;

/// Everything that the later phases read of a visible Gaussian: one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Splat {
    pub(super) paint: Paint,
    pub(super) ellipse: Ellipse,
    /// Tile columns that it may touch, half open.
    pub(super) columns: [u16; 2],
}

/// What blending reads of a splat.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Paint {
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

impl Paint {
    #[inline(always)]
    pub(super) fn new(p: &Projected, colour: [f32; 3]) -> Self {
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
    pub(super) view: &'a View,
    pub(super) grid: Grid,
    pub(super) first: usize,
    pub(super) splats: &'a mut [Splat],
    pub(super) bins: &'a mut Bins,
}

impl Kernel for Preprocess<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { posed, view, grid, first, splats, bins } = self;
        let coefficients = (posed.sh_degree + 1).pow(2);
        let mut written = 0;
        bins.clear();
        for start in (0..splats.len()).step_by(LANES) {
            let count = LANES.min(splats.len() - start);
            let base = first + start;
            let group = Group::load(posed, base, count);
            let projected = group.project(view);
            let bases = group.bases(view);
            for lane in 0..count {
                if projected[VISIBLE][lane] == 0.0 {
                    continue;
                }
                let p = Projected::from_fields(std::array::from_fn(|k| projected[k][lane]));
                let sh = &posed.sh[(base + lane) * coefficients..][..coefficients];
                let colour = colour::evaluate(sh, &std::array::from_fn(|k| bases[k][lane]));
                if !colour.iter().all(|c| c.is_finite()) {
                    continue;
                }
                let reached = p.reached.map(|t| t as u16);
                splats[written] = Splat {
                    paint: Paint::new(&p, colour::clamped(colour, posed.colour_clamp)),
                    ellipse: p.ellipse,
                    columns: [reached[0], reached[1]],
                };
                bins.push((first + written) as u32, p.depth, grid.strips(reached));
                written += 1;
            }
        }
        bins.finish(grid);
    }
}

/// Sixteen Gaussians, one number of each per row.
struct Group {
    means: [[f32; LANES]; 3],
    factors: [[[f32; LANES]; 3]; 3],
    frames: [[[f32; LANES]; 3]; 3],
    opacities: [f32; LANES],
}

impl Group {
    /// `count` Gaussians from `base` on; the other lanes have opacity 0 and so are culled.
    #[inline(always)]
    fn load(posed: &Posed, base: usize, count: usize) -> Self {
        let mut group = Self {
            means: [[0.0; LANES]; 3],
            factors: [[[0.0; LANES]; 3]; 3],
            frames: [[[0.0; LANES]; 3]; 3],
            opacities: [0.0; LANES],
        };
        let range = base..base + count;
        for (lane, mean) in posed.means[range.clone()].iter().enumerate() {
            scatter(&mut group.means, lane, mean.to_array());
        }
        for (lane, factor) in posed.factors[range.clone()].iter().enumerate() {
            scatter_matrix(&mut group.factors, lane, factor);
        }
        match &posed.view_frames {
            Some(frames) => {
                for (lane, frame) in frames[range.clone()].iter().enumerate() {
                    scatter_matrix(&mut group.frames, lane, frame);
                }
            }
            None => (0..3).for_each(|k| group.frames[k][k] = [1.0; LANES]),
        }
        group.opacities[..count].copy_from_slice(&posed.opacities[range]);
        group
    }

    #[inline(always)]
    fn project(&self, view: &View) -> [[f32; LANES]; FIELDS] {
        let mut rows = [[0.0; LANES]; FIELDS];
        for lane in 0..LANES {
            let mean = self.means.map(|row| row[lane]);
            let factor = self.factors.map(|column| column.map(|row| row[lane]));
            let fields = project(view, mean, factor, self.opacities[lane]).fields();
            for (row, field) in rows.iter_mut().zip(fields) {
                row[lane] = field;
            }
        }
        rows
    }

    #[inline(always)]
    fn bases(&self, view: &View) -> [[f32; LANES]; 16] {
        let mut rows = [[0.0; LANES]; 16];
        for lane in 0..LANES {
            let mean = self.means.map(|row| row[lane]);
            let frame = self.frames.map(|column| column.map(|row| row[lane]));
            let basis = colour::basis(colour::direction(mean, view.position, frame));
            for (row, value) in rows.iter_mut().zip(basis) {
                row[lane] = value;
            }
        }
        rows
    }
}

#[inline(always)]
fn scatter(rows: &mut [[f32; LANES]; 3], lane: usize, values: [f32; 3]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row[lane] = value;
    }
}

#[inline(always)]
fn scatter_matrix(rows: &mut [[[f32; LANES]; 3]; 3], lane: usize, matrix: &glam::Mat3) {
    for (rows, column) in rows.iter_mut().zip(matrix.to_cols_array_2d()) {
        scatter(rows, lane, column);
    }
}
