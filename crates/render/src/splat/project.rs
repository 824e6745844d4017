//! Gaussians to screen-space splats: culling, EWA projection, radius and tile rectangle, as the original 3DGS CUDA
//! rasterizer defines them (Kerbl et al. 2023; `preprocessCUDA`).
//!
//! Sixteen Gaussians at a time, without branches.

use super::grid::TILE;
use super::lanes::Lanes;
use super::wide::{Wide, each};
use glam::DMat4;
use skinsplat_core::scene::{Camera, rasterizer};

const NEAR: f32 = rasterizer::NEAR as f32;
const JACOBIAN_LIMIT: f32 = rasterizer::JACOBIAN_LIMIT as f32;
pub(super) const LOW_PASS: f32 = rasterizer::LOW_PASS as f32;
/// Least ratio of determinants before and after the low-pass that the antialiasing factor may take the root of.
pub(super) const LEAST_COMPENSATION: f32 = 0.000_025;
/// Pixels by which culling bounds are widened: more than the rounding of any position in the image.
pub(super) const SAFETY: f32 = 0.01;
/// `log2(e) / 2`: turns `dᵀ Σ⁻¹ d` into a power of two.
pub(super) const HALF_LOG2_E: f32 = std::f32::consts::LOG2_E * 0.5;
/// Alpha never reaches 1/255 with less (to a few ulp below, for the pixel test to decide).
const LEAST_OPACITY: f32 = 0.999_999 / 255.0;
/// An opacity beyond this changes nothing (alpha is capped at 0.99) but could overflow.
const MAX_OPACITY: f32 = 1e30;

/// The camera in the form in which the kernels use it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    /// First three rows of the world-to-camera transform.
    pub(super) rows: [[f32; 4]; 3],
    /// x and y rows of projection times world-to-camera.
    pub(super) clip: [[f32; 4]; 2],
    pub(super) focal: [f32; 2],
    /// Limits of x/z and y/z in the Jacobian.
    pub(super) limit: [f32; 2],
    pub(super) size: [f32; 2],
    /// Tiles across and down.
    pub(super) tiles: [usize; 2],
    /// Camera centre, world.
    pub(super) position: [f32; 3],
    pub(super) antialiased: bool,
}

impl Projection {
    /// The half fields of view are `size / (2 focal)` also where the principal point is off centre, as in the original
    /// (which knows centred ones only): an off-centre principal point moves the projected means and nothing else.
    pub(super) fn new(camera: &Camera, antialiased: bool) -> Self {
        let [width, height] = [camera.width, camera.height];
        let rows = rows_f32(&camera.camera_from_world);
        let axis = |row: [f32; 4], focal: f64, centre: f64, size: u32| -> [f32; 4] {
            let scale = (2.0 * focal / f64::from(size)) as f32;
            let shift = (2.0 * centre / f64::from(size) - 1.0) as f32;
            std::array::from_fn(|j| shift.mul_add(rows[2][j], scale * row[j]))
        };
        let limit = |focal: f64, size: u32| JACOBIAN_LIMIT * (f64::from(size) / (2.0 * focal)) as f32;
        Self {
            rows,
            clip: [axis(rows[0], camera.fx, camera.cx, width), axis(rows[1], camera.fy, camera.cy, height)],
            focal: [camera.fx as f32, camera.fy as f32],
            limit: [limit(camera.fx, width), limit(camera.fy, height)],
            size: [width as f32, height as f32],
            tiles: [(width as usize).div_ceil(TILE), (height as usize).div_ceil(TILE)],
            position: camera.position().as_vec3().to_array(),
            antialiased,
        }
    }
}

fn rows_f32(m: &DMat4) -> [[f32; 4]; 3] {
    std::array::from_fn(|i| m.row(i).as_vec4().to_array())
}

/// What the rasterizer needs to know of a Gaussian. T is sixteen lanes, or one number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected<T> {
    /// 1 if it can change any pixel, else 0.
    pub(super) visible: T,
    /// Pixel position in the original's frame: pixel i has its centre at i.
    pub(super) mean: [T; 2],
    /// Projection depth.
    pub(super) depth: T,
    /// xx, xy, yy of the screen covariance with low-pass, pixels².
    pub(super) covariance: [T; 3],
    /// xx, xy, yy of its inverse.
    pub(super) conic: [T; 3],
    /// Opacity, compensated where antialiasing is on.
    pub(super) opacity: T,
    /// Three standard deviations of the longer axis, whole pixels.
    pub(super) radius: T,
    /// `log2(255 opacity)`: alpha reaches 1/255 where `log2(e)/2 dᵀ conic d` is at most this.
    pub(super) reach: T,
    /// The original's tile rectangle (x from, x to, y from, y to; half open), less the tiles that the ellipse of
    /// alpha = 1/255 cannot touch.
    pub(super) tiles: [T; 4],
    pub(super) ellipse: Ellipse<T>,
}

/// The ellipse around a splat outside of which its alpha is below 1/255, enlarged by every rounding error on the way. Row
/// dy of it spans `slope dy ± sqrt(half_width² - bend dy²)`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ellipse<T> {
    pub(super) slope: T,
    pub(super) bend: T,
    pub(super) half_width_squared: T,
    /// dy of the rightmost point; the leftmost is at its negative.
    pub(super) rightmost: T,
}

impl<T> Projected<T> {
    #[inline(always)]
    pub(super) fn map<U>(&self, f: impl Fn(&T) -> U) -> Projected<U> {
        let two = |[a, b]: &[T; 2]| [f(a), f(b)];
        let three = |[a, b, c]: &[T; 3]| [f(a), f(b), f(c)];
        let [x0, x1, y0, y1] = &self.tiles;
        Projected {
            visible: f(&self.visible),
            mean: two(&self.mean),
            depth: f(&self.depth),
            covariance: three(&self.covariance),
            conic: three(&self.conic),
            opacity: f(&self.opacity),
            radius: f(&self.radius),
            reach: f(&self.reach),
            tiles: [f(x0), f(x1), f(y0), f(y1)],
            ellipse: Ellipse {
                slope: f(&self.ellipse.slope),
                bend: f(&self.ellipse.bend),
                half_width_squared: f(&self.ellipse.half_width_squared),
                rightmost: f(&self.ellipse.rightmost),
            },
        }
    }
}

/// Projects Gaussians with the factor M of their covariance (columns, Σ = M Mᵀ).
#[inline(always)]
pub(super) fn project<L: Lanes>(
    projection: &Projection,
    mean: [Wide<L>; 3],
    factor: [[Wide<L>; 3]; 3],
    opacity: Wide<L>,
) -> Projected<Wide<L>> {
    let number = |value: f32| opacity.constant(value);
    let z = affine(projection.rows[2], mean);
    let inverse_z = number(1.0) / z;
    let axes = [
        screen_axis(projection, 0, mean, factor, inverse_z).factor,
        screen_axis(projection, 1, mean, factor, inverse_z).factor,
    ];
    let (bare_xx, xy, bare_yy) = (dot(axes[0], axes[0]), dot(axes[0], axes[1]), dot(axes[1], axes[1]));
    let (xx, yy) = (bare_xx + number(LOW_PASS), bare_yy + number(LOW_PASS));
    let determinant = xx * yy - xy * xy;
    let inverse = number(1.0) / determinant;
    let conic = [yy * inverse, -(xy * inverse), xx * inverse];

    let middle = number(0.5) * (xx + yy);
    let largest =
        middle + (middle * middle - determinant).max(number(rasterizer::LEAST_DISCRIMINANT as f32)).sqrt();
    let radius = (number(rasterizer::DEVIATIONS as f32) * largest.sqrt()).ceil();
    let mean = [pixel_position(projection, 0, mean, z), pixel_position(projection, 1, mean, z)];

    let ratio = ((bare_xx * bare_yy - xy * xy) * inverse).max(number(LEAST_COMPENSATION));
    let opacity = if projection.antialiased { opacity * ratio.sqrt() } else { opacity };
    let bounded = opacity.min(number(MAX_OPACITY));
    let reach = (number(255.0) * bounded).log2();
    // The power at a pixel is a difference of terms as large as xx yy / det times itself; each is off by a few ulp.
    let slack = (xx * yy * inverse).mul_add(number(4e-6), number(1.0 + 1e-4));
    let square = reach.mul_add(slack, number(1e-4)) * number(1.0 / HALF_LOG2_E);
    let [x0, x1] = tile_range(projection, 0, mean[0], radius, (square * xx).sqrt());
    let [y0, y1] = tile_range(projection, 1, mean[1], radius, (square * yy).sqrt());
    let inverse_yy = number(1.0) / yy;
    let half_width_squared = square * determinant * inverse_yy;
    let ellipse = Ellipse {
        slope: xy * inverse_yy,
        bend: determinant * inverse_yy * inverse_yy,
        half_width_squared,
        rightmost: xy * (square / xx).sqrt(),
    };

    // One infinity or NaN among these makes their sum so.
    let parts =
        [opacity, mean[0], mean[1], z, xx, yy, radius, square, determinant, inverse, half_width_squared];
    let mut sum = number(0.0);
    for part in parts {
        sum = sum + part.abs();
    }
    let drawable =
        (number(NEAR).less(z)).and(number(0.0).less(determinant)).and(sum.less(number(f32::INFINITY)));
    let reaches = (x0.less(x1)).and(y0.less(y1)).and(number(LEAST_OPACITY).less(opacity));
    Projected {
        visible: drawable.and(reaches).keep(number(1.0)),
        mean,
        depth: z,
        covariance: [xx, xy, yy],
        conic,
        opacity: bounded,
        radius,
        reach,
        tiles: [x0, x1, y0, y1],
        ellipse,
    }
}

/// Screen axis k of the linearised projection.
#[derive(Clone, Copy)]
pub(super) struct ScreenAxis<L: Lanes> {
    /// x/z or y/z, and the same within the Jacobian's limit.
    pub(super) slope: Wide<L>,
    pub(super) limited: Wide<L>,
    /// Row k of J W.
    pub(super) row: [Wide<L>; 3],
    /// Row k of J W M. The rows' Gram matrix is the screen covariance.
    pub(super) factor: [Wide<L>; 3],
}

#[inline(always)]
pub(super) fn screen_axis<L: Lanes>(
    projection: &Projection,
    k: usize,
    mean: [Wide<L>; 3],
    factor: [[Wide<L>; 3]; 3],
    inverse_z: Wide<L>,
) -> ScreenAxis<L> {
    let number = |value: f32| inverse_z.constant(value);
    let limit = number(projection.limit[k]);
    let slope = affine(projection.rows[k], mean) * inverse_z;
    let limited = slope.max(-limit).min(limit);
    let scale = number(projection.focal[k]) * inverse_z;
    let (forward, along) = (projection.rows[2], projection.rows[k]);
    let mut row = [limited; 3];
    for i in 0..3 {
        row[i] = limited.neg_mul_add(number(forward[i]), number(along[i])) * scale;
    }
    ScreenAxis { slope, limited, row, factor: each(factor, |column| dot(row, column)) }
}

/// Pixel coordinate k. The original computes `((ndc + 1) size - 1) / 2` in f64 and rounds: the same bits as one fused
/// multiply-add.
#[inline(always)]
fn pixel_position<L: Lanes>(projection: &Projection, k: usize, mean: [Wide<L>; 3], z: Wide<L>) -> Wide<L> {
    let w = z.constant(1.0) / (z + z.constant(1e-7));
    let ndc = affine(projection.clip[k], mean) * w;
    ndc.mul_add(z.constant(0.5 * projection.size[k]), z.constant(0.5 * (projection.size[k] - 1.0)))
}

/// Tiles `[from, to)` along axis k that a square of `radius` around `centre` touches, by the original's formula, and no
/// further than `extent` from the centre.
#[inline(always)]
fn tile_range<L: Lanes>(
    projection: &Projection,
    k: usize,
    centre: Wide<L>,
    radius: Wide<L>,
    extent: Wide<L>,
) -> [Wide<L>; 2] {
    let number = |value: f32| centre.constant(value);
    let (per_side, tiles) = (number(1.0 / TILE as f32), number(projection.tiles[k] as f32));
    // The original truncates towards zero, then clamps to zero from below: the same as the floor.
    let clamped = |v: Wide<L>| (v * per_side).floor().max(number(0.0)).min(tiles);
    let [from, to] = [clamped(centre - radius), clamped(centre + radius + number((TILE - 1) as f32))];
    let first = ((centre - extent - number(SAFETY)) * per_side).floor();
    let last = ((centre + extent + number(SAFETY)) * per_side).floor();
    [from.max(first), to.min(last + number(1.0))]
}

/// `row · (p, 1)`.
#[inline(always)]
pub(super) fn affine<L: Lanes>(row: [f32; 4], p: [Wide<L>; 3]) -> Wide<L> {
    let number = |value: f32| p[0].constant(value);
    let sum = p[0].mul_add(number(row[0]), number(row[3]));
    p[2].mul_add(number(row[2]), p[1].mul_add(number(row[1]), sum))
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(a: [Wide<L>; 3], b: [Wide<L>; 3]) -> Wide<L> {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}
