//! SSIM as 3DGS trains with it (11x11 Gaussian window with σ 1.5, zero-padded, per channel) and its derivative, in `f32`.
//!
//! With the window G, the moments m = G∗x, p = G∗x², q = G∗(xy) and the same of the truth, the derivative of Σ S with
//! respect to x is `G∗S_m + 2x (G∗S_p) + y (G∗S_q)`: G is symmetric, and zero padding is its own adjoint. Two passes over
//! strips of rows: the first leaves S_m, S_p and S_q of every pixel, the second filters them. Products are filtered row
//! by row as in the first pass of the metric; multiplications and additions stay apart, so that all machines agree.

use super::Window;
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::Image;

/// Radius of the window.
pub(super) const RADIUS: usize = 5;
const TAPS: usize = 2 * RADIUS + 1;
/// Channels lie side by side.
const CHANNELS: usize = 3;
/// Zeros before and behind a row.
const BORDER: usize = RADIUS * CHANNELS;
/// Rows per unit of work.
const STRIP: usize = 24;
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// Memory that is kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Dssim {
    /// S_m, S_p and S_q of the window, row by row.
    partials: [Vec<f32>; 3],
}

impl Dssim {
    /// Adds `weight` times the derivative of Σ SSIM to `gradient` and returns Σ (SSIM − 1) over the channels of the
    /// window. Both images must agree within [`RADIUS`] pixels of the window's border and outside it, unless the border is
    /// the image's.
    pub(super) fn add(
        &mut self,
        image: &Image,
        truth: &Image,
        window: &Window,
        weight: f32,
        gradient: &mut Image,
    ) -> f64 {
        let (columns, rows) = (CHANNELS * window.x.len(), window.y.len());
        for partial in &mut self.partials {
            partial.resize(columns * rows, 0.0);
        }
        let sources = Sources { image, truth, window, taps: taps() };
        let [m, p, q] = &mut self.partials;
        let strips = m
            .par_chunks_mut(STRIP * columns)
            .zip(p.par_chunks_mut(STRIP * columns))
            .zip(q.par_chunks_mut(STRIP * columns));
        let sums: Vec<f64> = strips
            .enumerate()
            .map(|(strip, ((m, p), q))| {
                skinsplat_simd::arch().dispatch(Partials {
                    sources: &sources,
                    first: strip * STRIP,
                    out: [m, p, q],
                })
            })
            .collect();
        let width = image.width();
        let target = &mut gradient.pixels_mut()[window.y.start * width..window.y.end * width];
        target.par_chunks_mut(STRIP * width).enumerate().for_each(|(strip, out)| {
            skinsplat_simd::arch().dispatch(Gather {
                sources: &sources,
                partials: &self.partials,
                first: strip * STRIP,
                weight,
                out,
            });
        });
        sums.iter().sum()
    }
}

/// The window of both images.
struct Sources<'a> {
    image: &'a Image,
    truth: &'a Image,
    window: &'a Window,
    taps: [f32; TAPS],
}

impl Sources<'_> {
    fn columns(&self) -> usize {
        CHANNELS * self.window.x.len()
    }

    /// Row `row` of the window (which may lie `RADIUS` outside it) of an image, with its surroundings; zeros outside the image.
    #[inline(always)]
    fn load(&self, image: &Image, row: isize, out: &mut [f32]) {
        let y = self.window.y.start as isize + row;
        out.fill(0.0);
        if y < 0 || y >= image.height() as isize {
            return;
        }
        let (start, end) =
            (self.window.x.start.saturating_sub(RADIUS), (self.window.x.end + RADIUS).min(image.width()));
        let pixels = &image.pixels()[y as usize * image.width()..][start..end];
        let offset = CHANNELS * (start + RADIUS - self.window.x.start);
        out[offset..offset + CHANNELS * pixels.len()].copy_from_slice(pixels.as_flattened());
    }
}

/// The weights of the window in one dimension.
fn taps() -> [f32; TAPS] {
    let weight = |k: usize| {
        let d = k as f64 - RADIUS as f64;
        portable::exp(-d * d / (2.0 * 1.5 * 1.5))
    };
    let sum: f64 = (0..TAPS).map(weight).sum();
    std::array::from_fn(|k| (weight(k) / sum) as f32)
}

/// `out[i] = Σ_k taps[k] row[i + 3k]`.
#[inline(always)]
fn filter_row(taps: &[f32; TAPS], row: &[f32], out: &mut [f32]) {
    let n = out.len();
    let [r0, r1, r2, r3, r4, r5, r6, r7, r8, r9, r10] =
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10].map(|k| &row[CHANNELS * k..CHANNELS * k + n]);
    for i in 0..n {
        let far = taps[0] * (r0[i] + r10[i]) + taps[1] * (r1[i] + r9[i]);
        let middle = taps[2] * (r2[i] + r8[i]) + taps[3] * (r3[i] + r7[i]);
        let near = taps[4] * (r4[i] + r6[i]) + taps[5] * r5[i];
        out[i] = (far + middle) + near;
    }
}

/// The same down the rows of `rows`, `stride` apart, from row `first` on.
#[inline(always)]
fn filter_columns(taps: &[f32; TAPS], rows: &[f32], stride: usize, first: usize, out: &mut [f32]) {
    let n = out.len();
    let row = |k: usize| &rows[(first + k) * stride..(first + k) * stride + n];
    let (r0, r1, r2, r3, r4, r5) = (row(0), row(1), row(2), row(3), row(4), row(5));
    let (r6, r7, r8, r9, r10) = (row(6), row(7), row(8), row(9), row(10));
    for i in 0..n {
        let far = taps[0] * (r0[i] + r10[i]) + taps[1] * (r1[i] + r9[i]);
        let middle = taps[2] * (r2[i] + r8[i]) + taps[3] * (r3[i] + r7[i]);
        let near = taps[4] * (r4[i] + r6[i]) + taps[5] * r5[i];
        out[i] = (far + middle) + near;
    }
}

/// First pass over a strip.
struct Partials<'a, 'b> {
    sources: &'a Sources<'b>,
    first: usize,
    out: [&'a mut [f32]; 3],
}

impl pulp::NullaryFnOnce for Partials<'_, '_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let Self { sources, first, out: [m_out, p_out, q_out] } = self;
        let n = sources.columns();
        let rows = m_out.len() / n;
        let halo = rows + 2 * RADIUS;
        let mut filtered: [Vec<f32>; 5] = std::array::from_fn(|_| vec![0.0; halo * n]);
        let mut padded: [Vec<f32>; 2] = std::array::from_fn(|_| vec![0.0; n + 2 * BORDER]);
        let mut product = vec![0.0; n + 2 * BORDER];
        for row in 0..halo {
            let y = first as isize + row as isize - RADIUS as isize;
            let [x_row, y_row] = &mut padded;
            sources.load(sources.image, y, x_row);
            sources.load(sources.truth, y, y_row);
            let part = row * n..(row + 1) * n;
            filter_row(&sources.taps, x_row, &mut filtered[0][part.clone()]);
            filter_row(&sources.taps, y_row, &mut filtered[1][part.clone()]);
            multiply(x_row, x_row, &mut product);
            filter_row(&sources.taps, &product, &mut filtered[2][part.clone()]);
            multiply(y_row, y_row, &mut product);
            filter_row(&sources.taps, &product, &mut filtered[3][part.clone()]);
            multiply(x_row, y_row, &mut product);
            filter_row(&sources.taps, &product, &mut filtered[4][part]);
        }
        let mut moments: [Vec<f32>; 5] = std::array::from_fn(|_| vec![0.0; n]);
        let (mut index, mut sum) = (vec![0.0; n], 0.0);
        for row in 0..rows {
            for (moment, filtered) in moments.iter_mut().zip(&filtered) {
                filter_columns(&sources.taps, filtered, n, row, moment);
            }
            let part = row * n..(row + 1) * n;
            let out = [&mut m_out[part.clone()], &mut p_out[part.clone()], &mut q_out[part]];
            sum += index_row(&moments, out, &mut index);
        }
        sum
    }
}

#[inline(always)]
fn multiply(a: &[f32], b: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = a * b;
    }
}

/// The derivatives of S with respect to m, p and q along a row, and Σ (S − 1).
#[inline(always)]
fn index_row(moments: &[Vec<f32>; 5], [s_m, s_p, s_q]: [&mut [f32]; 3], index: &mut [f32]) -> f64 {
    let n = s_m.len();
    let [m, t, p, u, q] = [0, 1, 2, 3, 4].map(|k| &moments[k][..n]);
    let (s_p, s_q, index) = (&mut s_p[..n], &mut s_q[..n], &mut index[..n]);
    for i in 0..n {
        let (mx, my) = (m[i], t[i]);
        let (mxx, myy, mxy) = (mx * mx, my * my, mx * my);
        // S = A1 A2 / (B1 B2)
        let (a1, a2) = (2.0 * mxy + C1, 2.0 * (q[i] - mxy) + C2);
        let (b1, b2) = (mxx + myy + C1, (p[i] - mxx) + (u[i] - myy) + C2);
        let (above, below) = (a1 * a2, b1 * b2);
        let s = above / below;
        // dA1/dm = 2 my = -dA2/dm, dB1/dm = 2 mx = -dB2/dm
        s_m[i] = 2.0 * (my * (a2 - a1) - mx * s * (b2 - b1)) / below;
        s_p[i] = -s / b2;
        s_q[i] = 2.0 * a1 / below;
        index[i] = (above - below) / below;
    }
    let mut sums = [0.0f64; 8];
    for part in index.chunks(8) {
        for (sum, &value) in sums.iter_mut().zip(part) {
            *sum += f64::from(value);
        }
    }
    sums.iter().sum()
}

/// Second pass over a strip.
struct Gather<'a, 'b> {
    sources: &'a Sources<'b>,
    partials: &'a [Vec<f32>; 3],
    first: usize,
    weight: f32,
    out: &'a mut [[f32; 3]],
}

impl pulp::NullaryFnOnce for Gather<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { sources, partials, first, weight, out } = self;
        let n = sources.columns();
        let width = sources.image.width();
        let rows = out.len() / width;
        let halo = rows + 2 * RADIUS;
        let all = partials[0].len() / n;
        let mut filtered: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; halo * n]);
        let mut padded = vec![0.0; n + 2 * BORDER];
        for row in 0..halo {
            let y = first as isize + row as isize - RADIUS as isize;
            if y < 0 || y >= all as isize {
                continue;
            }
            for (filtered, partial) in filtered.iter_mut().zip(partials) {
                padded[BORDER..BORDER + n].copy_from_slice(&partial[y as usize * n..][..n]);
                filter_row(&sources.taps, &padded, &mut filtered[row * n..(row + 1) * n]);
            }
        }
        let mut gathered: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; n]);
        for row in 0..rows {
            for (gathered, filtered) in gathered.iter_mut().zip(&filtered) {
                filter_columns(&sources.taps, filtered, n, row, gathered);
            }
            let y = sources.window.y.start + first + row;
            let x = sources.image.pixels()[y * width..][sources.window.x.clone()].as_flattened();
            let t = sources.truth.pixels()[y * width..][sources.window.x.clone()].as_flattened();
            let target = out[row * width..][sources.window.x.clone()].as_flattened_mut();
            let [of_m, of_p, of_q] = [0, 1, 2].map(|k| &gathered[k][..n]);
            for i in 0..n {
                target[i] += weight * (of_m[i] + 2.0 * x[i] * of_p[i] + t[i] * of_q[i]);
            }
        }
    }
}
