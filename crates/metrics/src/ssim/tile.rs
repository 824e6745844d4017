//! The inner loops: the sum of the SSIM map over a tile of one channel.
//!
//! Only four moments are needed, because the index reads the variances as their sum: a, b, a² + b², ab. Each row is
//! filtered vertically, then horizontally, one tap at a time over whole rows, which the compiler turns into vector
//! instructions (with the feature `simd` those of the machine it runs on); multiplications and additions stay apart, so that all machines agree to the
//! last bit.

use super::Border;
use super::window::Window;
use crate::psnr::{LANES, lane_sum};
use crate::region::Rect;

/// The numbers in the formula: C1, C2 and the factor on variances (n / (n - 1) for sample covariance).
pub(super) struct Constants {
    pub(super) c1: f64,
    pub(super) c2: f64,
    pub(super) covariance: f64,
}

/// One channel of both images and the part of the map to sum.
pub(super) struct Tile<'a> {
    pub(super) a: &'a [f64],
    pub(super) b: &'a [f64],
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) border: Border,
    pub(super) rect: &'a Rect,
}

/// Buffers that are kept from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    /// Moments of the tile and its surroundings, `rows * stride` each.
    moments: [Vec<f64>; 4],
    /// One row of each moment after the vertical filter.
    columns: [Vec<f64>; 4],
    /// One row of each moment after both.
    means: [Vec<f64>; 4],
    /// One row of the map.
    index: Vec<f64>,
}

/// The work of [`Tile::sum`]. (A closure would not do: it is not inlined into what is compiled per instruction set.)
struct Sum<'a, 'b> {
    tile: &'a Tile<'b>,
    window: &'a Window,
    constants: &'a Constants,
    weights: Option<&'a [f64]>,
    scratch: &'a mut Scratch,
}

impl Sum<'_, '_> {
    #[inline(always)]
    fn run(self) -> f64 {
        self.tile.sum_rows(self.window, self.constants, self.weights, self.scratch)
    }
}

#[cfg(feature = "simd")]
impl pulp::WithSimd for Sum<'_, '_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f64 {
        self.run()
    }
}

/// Runs work on the widest vectors of the machine that it runs on.
#[cfg(feature = "simd")]
fn dispatch(sum: Sum<'_, '_>) -> f64 {
    skinsplat_simd::arch().dispatch(sum)
}

/// Runs work on the vectors that the program is compiled for; the values are the same bit for bit.
#[cfg(not(feature = "simd"))]
fn dispatch(sum: Sum<'_, '_>) -> f64 {
    sum.run()
}

impl Tile<'_> {
    /// Σ of the map over the rectangle, each pixel times its weight if there are weights (for the whole image,
    /// row-major). With [`Border::Valid`] all windows must fit into the image.
    pub(super) fn sum(
        &self,
        window: &Window,
        constants: &Constants,
        weights: Option<&[f64]>,
        scratch: &mut Scratch,
    ) -> f64 {
        dispatch(Sum { tile: self, window, constants, weights, scratch })
    }

    #[inline(always)]
    fn sum_rows(
        &self,
        window: &Window,
        constants: &Constants,
        weights: Option<&[f64]>,
        scratch: &mut Scratch,
    ) -> f64 {
        let columns = self.rect.x.len().next_multiple_of(LANES);
        let stride = (columns + 2 * window.radius).next_multiple_of(LANES);
        self.load_moments(window.radius, stride, scratch);
        let mut sum = 0.0;
        for y in self.rect.y.clone() {
            scratch.filter_row(window, y - self.rect.y.start, columns, stride);
            scratch.index_row(constants);
            let n = self.rect.x.len();
            let index = &scratch.index[..n];
            sum += match weights {
                None => lane_sum([index], |[index]| index),
                Some(weights) => {
                    let weights = &weights[y * self.width + self.rect.x.start..][..n];
                    lane_sum([index, weights], |[index, weight]| weight * index)
                }
            };
        }
        sum
    }

    /// Fills `scratch.moments` with the tile and `radius` pixels around it.
    #[inline(always)]
    fn load_moments(&self, radius: usize, stride: usize, scratch: &mut Scratch) {
        let (x, y) = (&self.rect.x, &self.rect.y);
        let rows = y.len() + 2 * radius;
        for buffer in &mut scratch.moments {
            buffer.clear();
            buffer.resize(rows * stride, 0.0);
        }
        let [a, b, squares, product] = &mut scratch.moments;
        for row in 0..rows {
            let Some(source) = self.source(y.start + row, radius, self.height) else { continue };
            let target = row * stride..row * stride + x.len() + 2 * radius;
            let (a, b) = (&mut a[target.clone()], &mut b[target.clone()]);
            self.load_row(&self.a[source * self.width..][..self.width], radius, a);
            self.load_row(&self.b[source * self.width..][..self.width], radius, b);
            let moments = squares[target.clone()].iter_mut().zip(&mut product[target]);
            for ((squares, product), (a, b)) in moments.zip(a.iter().zip(b.iter())) {
                *squares = *a * *a + *b * *b;
                *product = *a * *b;
            }
        }
    }

    /// Copies the columns of the tile and `radius` on both sides.
    #[inline(always)]
    fn load_row(&self, source: &[f64], radius: usize, target: &mut [f64]) {
        let start = self.rect.x.start;
        let first = radius.saturating_sub(start);
        let last = target.len().min(self.width + radius - start);
        target[first..last].copy_from_slice(&source[start + first - radius..start + last - radius]);
        for i in (0..first).chain(last..target.len()) {
            target[i] = self.source(start + i, radius, self.width).map_or(0.0, |x| source[x]);
        }
    }

    /// The pixel that stands at position `shifted - radius` of an axis of `size` pixels; `None` for a zero.
    #[inline(always)]
    fn source(&self, shifted: usize, radius: usize, size: usize) -> Option<usize> {
        if (radius..size + radius).contains(&shifted) {
            return Some(shifted - radius);
        }
        match self.border {
            Border::ZeroPad | Border::Valid => None,
            Border::Reflect if shifted < radius => Some(radius - shifted),
            Border::Reflect => Some(2 * (size - 1) + radius - shifted),
        }
    }
}

impl Scratch {
    /// Filters row `row` of the tile: `means` then hold `columns` values per moment.
    #[inline(always)]
    fn filter_row(&mut self, window: &Window, row: usize, columns: usize, stride: usize) {
        for m in 0..4 {
            self.columns[m].resize(stride, 0.0);
            self.means[m].clear();
            self.means[m].resize(columns, 0.0);
            for term in &window.terms {
                let rows = &self.moments[m][row * stride..][..(2 * window.radius + 1) * stride];
                let vertical = &mut self.columns[m][..stride];
                filter(vertical, &term.vertical, rows, window.radius * stride, stride, false);
                filter(&mut self.means[m], &term.horizontal, &self.columns[m], window.radius, 1, true);
            }
        }
    }

    /// Turns the row of `means` into a row of the map.
    #[inline(always)]
    fn index_row(&mut self, constants: &Constants) {
        let [a, b, squares, product] = &self.means;
        self.index.resize(a.len(), 0.0);
        let means = a.iter().zip(b).zip(squares.iter().zip(product));
        for (index, ((a, b), (squares, product))) in self.index.iter_mut().zip(means) {
            *index = ssim_at([*a, *b, *squares, *product], constants);
        }
    }
}

/// `out[x] (+)= taps[0] * from[centre + x] + Σ_k taps[k] * (from[centre + x - k step] + from[centre + x + k step])`.
#[inline(always)]
fn filter(out: &mut [f64], taps: &[f64], from: &[f64], centre: usize, step: usize, add: bool) {
    let n = out.len();
    let middle = &from[centre..][..n];
    for (out, middle) in out.iter_mut().zip(middle) {
        *out = taps[0] * middle + if add { *out } else { 0.0 };
    }
    let sides = |k: usize| (&from[centre - k * step..][..n], &from[centre + k * step..][..n]);
    let mut k = 1;
    // Two distances per sweep, to load and store `out` half as often.
    while k + 1 < taps.len() {
        let ((near_before, near_after), (far_before, far_after)) = (sides(k), sides(k + 1));
        for i in 0..n {
            let near = taps[k] * (near_before[i] + near_after[i]);
            out[i] += near + taps[k + 1] * (far_before[i] + far_after[i]);
        }
        k += 2;
    }
    if k < taps.len() {
        let (before, after) = sides(k);
        for i in 0..n {
            out[i] += taps[k] * (before[i] + after[i]);
        }
    }
}

#[inline(always)]
fn ssim_at([a, b, squares, product]: [f64; 4], constants: &Constants) -> f64 {
    let &Constants { c1, c2, covariance } = constants;
    let (mean_squares, mean_product) = (a * a + b * b, a * b);
    let variances = covariance * (squares - mean_squares);
    let covariance = covariance * (product - mean_product);
    (2.0 * mean_product + c1) * (2.0 * covariance + c2) / ((mean_squares + c1) * (variances + c2))
}
