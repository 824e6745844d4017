//! First phase on the way back: what strips ask of a chunk's splats becomes derivatives by Gaussian.

use super::backward_blend::{COLOUR_SUMS, SplatSums};
use super::backward_colour::{self, Touched};
use super::backward_project::{Source, SourceGradient};
use super::bin::{Bins, splat_of};
use super::colour;
use super::derivatives::Derivatives;
use super::lanes::{Kernel, Lanes};
use super::preprocess::{Group, LANES};
use super::project::Projection;
use super::wide::{Mask, Wide, each};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use skinsplat_core::scene::{Posed, PosedGradient};

/// The part of a [`PosedGradient`] that belongs to a chunk of Gaussians.
pub(super) struct Output<'a> {
    means: &'a mut [Vec3],
    factors: &'a mut [Mat3],
    opacities: &'a mut [f32],
    sh: &'a mut [[f32; 3]],
    /// Empty where Gaussians have no frames.
    view_frames: &'a mut [Mat3],
    screen: &'a mut [[f32; 2]],
    radii: &'a mut [f32],
}

impl<'a> Output<'a> {
    /// The parts of `gradient` for chunks of Gaussians with so many SH coefficients each.
    pub(super) fn chunks(
        gradient: &'a mut PosedGradient,
        chunk: usize,
        coefficients: usize,
    ) -> impl IndexedParallelIterator<Item = Self> {
        let PosedGradient { means, factors, opacities, sh, view_frames, screen, radii } = gradient;
        let mut frames = view_frames.chunks_mut(chunk);
        let frames: Vec<&mut [Mat3]> =
            (0..means.len().div_ceil(chunk)).map(|_| frames.next().unwrap_or_default()).collect();
        let parts = means
            .par_chunks_mut(chunk)
            .zip(factors.par_chunks_mut(chunk))
            .zip(opacities.par_chunks_mut(chunk))
            .zip(sh.par_chunks_mut(chunk * coefficients))
            .zip(frames)
            .zip(screen.par_chunks_mut(chunk))
            .zip(radii.par_chunks_mut(chunk));
        parts.map(|((((((means, factors), opacities), sh), view_frames), screen), radii)| Self {
            means,
            factors,
            opacities,
            sh,
            view_frames,
            screen,
            radii,
        })
    }

    /// Writes all but SH and frames of the Gaussians from `start` on.
    #[inline(always)]
    fn write<L: Lanes>(&mut self, start: usize, count: usize, gradient: &SourceGradient<L>) {
        let SourceGradient { mean, factor: [f, g, h], opacity, screen, radius } = *gradient;
        let columns = [
            mean[0], mean[1], mean[2], f[0], f[1], f[2], g[0], g[1], g[2], h[0], h[1], h[2], opacity,
            screen[0], screen[1], radius,
        ];
        for (i, row) in (start..start + count).zip(Wide::transpose(&columns)) {
            let row = row.store();
            let [x, y, z, factor @ .., opacity, sx, sy, radius] = row;
            self.means[i] = Vec3::new(x, y, z);
            self.factors[i] = Mat3::from_cols_array(&factor);
            self.opacities[i] = opacity;
            self.screen[i] = [sx, sy];
            self.radii[i] = radius;
        }
    }
}

/// Gathers the sums of the splats of a chunk and takes them back to its Gaussians.
pub(super) struct BackwardGaussians<'a, 'b> {
    pub(super) posed: &'a Posed<'a>,
    pub(super) projection: &'a Projection,
    pub(super) derivatives: Derivatives,
    /// Number of the chunk's first Gaussian.
    pub(super) first: usize,
    pub(super) bins: &'a Bins,
    /// The sums of all strips, and where those of this chunk begin in each strip.
    pub(super) sums: &'a [SplatSums],
    pub(super) starts: &'a [u32],
    pub(super) out: Output<'b>,
    /// By splat of the chunk.
    pub(super) scratch: &'a mut Vec<SplatSums>,
}

impl Kernel for BackwardGaussians<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, l: L) {
        self.gather(l);
        let mut splat = 0;
        for (group, &visible) in self.bins.visible().iter().enumerate() {
            let start = group * LANES;
            let count = LANES.min(self.out.means.len() - start);
            self.group(l, start, count, visible, splat);
            splat += visible.count_ones() as usize;
        }
    }
}

impl BackwardGaussians<'_, '_> {
    /// Adds up the strips, in their order.
    #[inline(always)]
    fn gather<L: Lanes>(&mut self, l: L) {
        self.scratch.clear();
        self.scratch.resize(self.bins.splats(), SplatSums::default());
        for (strip, &start) in self.starts.iter().enumerate() {
            let entries = self.bins.strip(strip);
            let sums = &self.sums[start as usize..][..entries.len()];
            for (&entry, sums) in entries.iter().zip(sums) {
                let total = &mut self.scratch[splat_of(entry) - self.first].0;
                *total = (Wide::load(l, total) + Wide::load(l, &sums.0)).store();
            }
        }
    }

    /// Sixteen Gaussians of the chunk, of which some are `visible`, as splats from `splat` on.
    #[inline(always)]
    fn group<L: Lanes>(&mut self, l: L, start: usize, count: usize, visible: u16, mut splat: usize) {
        let n = |value: f32| Wide::splat(l, value);
        let mut rows = [[0.0; LANES]; LANES];
        let mut touched = 0;
        for (lane, row) in rows.iter_mut().enumerate() {
            if visible >> lane & 1 == 1 {
                *row = self.scratch[splat].0;
                touched |= u16::from(row.iter().any(|&sum| sum != 0.0)) << lane;
                splat += 1;
            }
        }
        let zero = n(0.0);
        let mut gradient = SourceGradient {
            mean: [zero; 3],
            factor: [[zero; 3]; 3],
            opacity: zero,
            screen: [zero; 2],
            radius: zero,
        };
        let sh = start * self.coefficients()..(start + count) * self.coefficients();
        if visible == 0 {
            self.out.sh[sh].fill([0.0; 3]);
            self.no_frames(start, count);
            return self.out.write(start, count, &gradient);
        }
        let sums = Wide::load_transposed(l, &rows);
        let group = Group::load(self.posed, self.first + start, count);
        let load = |row: [f32; LANES]| Wide::load(l, &row);
        let source = Source {
            mean: each(group.means, load),
            factor: each(group.factors, |column| each(column, load)),
            opacity: load(group.opacities),
        };
        let [power, x, y, xx, xy, yy, ..] = sums;
        gradient = source.adjoint(self.projection, [power, x, y, xx, xy, yy], self.derivatives);
        if touched == 0 {
            self.out.sh[sh].fill([0.0; 3]);
            self.no_frames(start, count);
        } else {
            let colour = [sums[COLOUR_SUMS], sums[COLOUR_SUMS + 1], sums[COLOUR_SUMS + 2]];
            let frames = group.frames.map(|frames| each(frames, |column| each(column, load)));
            let by_direction = self.colour(l, start, count, source.mean, frames, colour, Touched(touched));
            for i in 0..3 {
                gradient.mean[i] = gradient.mean[i] + by_direction[i];
            }
        }
        self.out.write(start, count, &gradient.kept(l, visible, touched));
    }

    /// Writes the SH's derivatives and returns those with respect to the mean.
    #[inline(always)]
    fn colour<L: Lanes>(
        &mut self,
        l: L,
        start: usize,
        count: usize,
        mean: [Wide<L>; 3],
        frames: Option<[[Wide<L>; 3]; 3]>,
        rgb: [Wide<L>; 3],
        touched: Touched,
    ) -> [Wide<L>; 3] {
        let direction = colour::direction(mean, self.projection.position, frames);
        let basis = colour::basis(direction.unit);
        let coefficients = self.coefficients();
        let sh = &self.posed.sh[(self.first + start) * coefficients..][..count * coefficients];
        let out = &mut self.out.sh[start * coefficients..][..count * coefficients];
        let clamp = self.posed.colour_clamp;
        let by_basis = match coefficients {
            1 => backward_colour::coefficients::<1, L>(l, sh, &basis, rgb, clamp, touched, out),
            4 => backward_colour::coefficients::<4, L>(l, sh, &basis, rgb, clamp, touched, out),
            9 => backward_colour::coefficients::<9, L>(l, sh, &basis, rgb, clamp, touched, out),
            _ => backward_colour::coefficients::<16, L>(l, sh, &basis, rgb, clamp, touched, out),
        };
        let turned = backward_colour::turned(&direction, &by_basis);
        if frames.is_some() {
            self.write_frames(l, start, count, mean, turned, touched);
        }
        backward_colour::mean(frames, turned)
    }

    fn no_frames(&mut self, start: usize, count: usize) {
        if !self.out.view_frames.is_empty() {
            self.out.view_frames[start..start + count].fill(Mat3::ZERO);
        }
    }

    /// Writes the derivatives with respect to the frames F, which turn the way d from the camera: those with respect to F d
    /// times dᵀ.
    #[inline(never)]
    fn write_frames<L: Lanes>(
        &mut self,
        l: L,
        start: usize,
        count: usize,
        mean: [Wide<L>; 3],
        turned: [Wide<L>; 3],
        touched: Touched,
    ) {
        let camera = self.projection.position;
        let way = each([0, 1, 2], |i| (mean[i] - Wide::splat(l, camera[i])).store());
        let turned = each(turned, Wide::store);
        for (lane, frame) in self.out.view_frames[start..start + count].iter_mut().enumerate() {
            let own = Vec3::from_array(turned.map(|axis| axis[lane]));
            let column = |axis: usize| own * way[axis][lane];
            let is_touched = touched.has(lane);
            *frame = if is_touched { Mat3::from_cols(column(0), column(1), column(2)) } else { Mat3::ZERO };
        }
    }

    fn coefficients(&self) -> usize {
        colour::sh_count(self.posed)
    }
}

impl<L: Lanes> SourceGradient<L> {
    /// Zeros where Gaussians were not touched; the radius where they were not visible.
    #[inline(always)]
    fn kept(&self, l: L, visible: u16, touched: u16) -> Self {
        let (visible, touched) = (mask(l, visible), mask(l, touched));
        Self {
            mean: each(self.mean, |v| touched.keep(v)),
            factor: each(self.factor, |column| each(column, |v| touched.keep(v))),
            opacity: touched.keep(self.opacity),
            screen: each(self.screen, |v| touched.keep(v)),
            radius: visible.keep(self.radius),
        }
    }
}

/// One bit per lane.
#[inline(always)]
fn mask<L: Lanes>(l: L, bits: u16) -> Mask<L> {
    let mut lanes = [0.0; LANES];
    for (lane, value) in lanes.iter_mut().enumerate() {
        *value = f32::from(bits >> lane & 1);
    }
    Wide::splat(l, 0.0).less(Wide::load(l, &lanes))
}
