//! Gaussians to screen-space splats: culling, EWA projection, radius and tile rectangle, as the original 3DGS CUDA
//! rasterizer defines them (Kerbl et al. 2023; `preprocessCUDA`).
//!
//! Written for one Gaussian, without branches, and run over sixteen at a time: the compiler vectorises the loop.

use crate::scene::Camera;
use glam::DMat4;

/// Side of the tiles that bound a splat's reach, pixels.
pub(super) const TILE: usize = 16;
/// Gaussians at or in front of this view depth are not drawn.
const NEAR: f32 = 0.2;
/// The projection is linearised no further out than this multiple of the half field of view.
const JACOBIAN_LIMIT: f32 = 1.3;
/// Variance added to both screen axes, pixels².
const LOW_PASS: f32 = 0.3;
/// Least ratio of determinants before and after the low-pass that the antialiasing factor may take the root of.
const LEAST_COMPENSATION: f32 = 0.000_025;
/// Pixels by which culling bounds are widened: more than the rounding of any position in the image.
pub(super) const SAFETY: f32 = 0.01;
/// `log2(e) / 2`: turns `dᵀ Σ⁻¹ d` into a power of two.
pub(super) const HALF_LOG2_E: f32 = std::f32::consts::LOG2_E * 0.5;
/// An opacity beyond this changes nothing (alpha is capped at 0.99) but could overflow.
const MAX_OPACITY: f32 = 1e30;

/// The camera in the form in which the kernels use it.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// First three rows of the world-to-camera transform.
    rows: [[f32; 4]; 3],
    /// x and y rows of projection times world-to-camera.
    clip: [[f32; 4]; 2],
    focal: [f32; 2],
    /// Limits of x/z and y/z in the Jacobian.
    limit: [f32; 2],
    size: [f64; 2],
    /// Tiles across and down.
    pub(super) tiles: [usize; 2],
    /// Camera centre, world.
    pub(super) position: [f32; 3],
    antialiased: bool,
}

impl View {
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
            size: [f64::from(width), f64::from(height)],
            tiles: [(width as usize).div_ceil(TILE), (height as usize).div_ceil(TILE)],
            position: camera.position().as_vec3().to_array(),
            antialiased,
        }
    }
}

fn rows_f32(m: &DMat4) -> [[f32; 4]; 3] {
    std::array::from_fn(|i| m.row(i).as_vec4().to_array())
}

/// What the rasterizer needs to know of one Gaussian.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Projected {
    /// Whether it can change any pixel.
    pub(super) visible: bool,
    /// Pixel position in the original's frame: pixel i has its centre at i.
    pub(super) mean: [f32; 2],
    /// View depth.
    pub(super) depth: f32,
    /// xx, xy, yy of the screen covariance with low-pass, pixels².
    pub(super) covariance: [f32; 3],
    /// xx, xy, yy of its inverse.
    pub(super) conic: [f32; 3],
    /// Opacity, compensated where antialiasing is on.
    pub(super) opacity: f32,
    /// Three standard deviations of the longer axis, whole pixels.
    pub(super) radius: f32,
    /// `log2(255 opacity)`: alpha reaches 1/255 where `log2(e)/2 dᵀ conic d` is at most this.
    pub(super) reach: f32,
    /// The original's tile rectangle (x from, x to, y from, y to; half open), less the tiles that the ellipse of
    /// alpha = 1/255 cannot touch.
    pub(super) reached: [f32; 4],
    /// The ellipse of alpha = 1/255, for culling.
    pub(super) ellipse: Ellipse,
}

/// The ellipse around a splat outside of which its alpha is below 1/255, enlarged by every rounding error on the way. Row
/// dy of it spans `slope dy ± sqrt(half_width² - bend dy²)`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ellipse {
    pub(super) slope: f32,
    pub(super) bend: f32,
    pub(super) half_width_squared: f32,
    /// dy of the rightmost point; the leftmost is at its negative.
    pub(super) rightmost: f32,
}

/// Numbers in a [`Projected`].
pub(super) const FIELDS: usize = 21;
/// Which of them says whether the Gaussian is visible (1 or 0).
pub(super) const VISIBLE: usize = 0;

impl Projected {
    /// All fields in a row, so that sixteen Gaussians can be held field by field.
    #[inline(always)]
    pub(super) fn fields(self) -> [f32; FIELDS] {
        let Self { visible, mean, depth, covariance, conic, opacity, radius, reach, reached, ellipse } = self;
        [
            if visible { 1.0 } else { 0.0 },
            mean[0],
            mean[1],
            depth,
            covariance[0],
            covariance[1],
            covariance[2],
            conic[0],
            conic[1],
            conic[2],
            opacity,
            radius,
            reach,
            reached[0],
            reached[1],
            reached[2],
            reached[3],
            ellipse.slope,
            ellipse.bend,
            ellipse.half_width_squared,
            ellipse.rightmost,
        ]
    }

    /// The inverse of [`Projected::fields`].
    #[inline(always)]
    pub(super) fn from_fields(f: [f32; FIELDS]) -> Self {
        Self {
            visible: f[VISIBLE] != 0.0,
            mean: [f[1], f[2]],
            depth: f[3],
            covariance: [f[4], f[5], f[6]],
            conic: [f[7], f[8], f[9]],
            opacity: f[10],
            radius: f[11],
            reach: f[12],
            reached: [f[13], f[14], f[15], f[16]],
            ellipse: Ellipse { slope: f[17], bend: f[18], half_width_squared: f[19], rightmost: f[20] },
        }
    }
}

/// Projects one Gaussian with the factor M of its covariance (columns, Σ = M Mᵀ).
#[inline(always)]
pub(super) fn project(view: &View, mean: [f32; 3], factor: [[f32; 3]; 3], opacity: f32) -> Projected {
    let [x, y, z] = view.rows.map(|row| affine(row, mean));
    let tx = least(view.limit[0], greatest(-view.limit[0], x / z));
    let ty = least(view.limit[1], greatest(-view.limit[1], y / z));
    // Rows of J W, then of J W M, whose Gram matrix is the screen covariance.
    let (jx, jy) = (view.focal[0] / z, view.focal[1] / z);
    let row = |k: usize, j: f32, t: f32| -> [f32; 3] {
        std::array::from_fn(|i| j * (-t).mul_add(view.rows[2][i], view.rows[k][i]))
    };
    let through = |row: [f32; 3]| factor.map(|column| dot(row, column));
    let (u, v) = (through(row(0, jx, tx)), through(row(1, jy, ty)));
    let (bare_xx, xy, bare_yy) = (dot(u, u), dot(u, v), dot(v, v));
    let (xx, yy) = (bare_xx + LOW_PASS, bare_yy + LOW_PASS);
    let determinant = xx * yy - xy * xy;
    let inverse = 1.0 / determinant;
    let conic = [yy * inverse, -xy * inverse, xx * inverse];

    let middle = 0.5 * (xx + yy);
    let largest = middle + greatest(0.1, middle * middle - determinant).sqrt();
    let radius = (3.0 * largest.sqrt()).ceil();
    let w = 1.0 / (z + 1e-7);
    let centre = |axis: usize| -> f32 {
        let ndc = affine(view.clip[axis], mean) * w;
        (((f64::from(ndc) + 1.0) * view.size[axis] - 1.0) * 0.5) as f32
    };
    let mean = [centre(0), centre(1)];
    let [x0, x1] = tile_range(mean[0], radius, view.tiles[0]);
    let [y0, y1] = tile_range(mean[1], radius, view.tiles[1]);

    let ratio = greatest(LEAST_COMPENSATION, (bare_xx * bare_yy - xy * xy) / determinant);
    let factor = if view.antialiased { ratio.sqrt() } else { 1.0 };
    let opacity = least(MAX_OPACITY, opacity * factor);
    let reach = log2(255.0 * opacity);
    // The power at a pixel is a difference of terms as large as xx yy / det times itself; each is off by a few ulp.
    let slack = 1e-4 + 4e-6 * (xx * yy * inverse);
    let squared = (reach * (1.0 + slack) + 1e-4) / HALF_LOG2_E;
    let (rx0, rx1) = narrowed([x0, x1], mean[0], (squared * xx).sqrt());
    let (ry0, ry1) = narrowed([y0, y1], mean[1], (squared * yy).sqrt());
    let inverse_yy = 1.0 / yy;
    let ellipse = Ellipse {
        slope: xy * inverse_yy,
        bend: determinant * inverse_yy * inverse_yy,
        half_width_squared: squared * determinant * inverse_yy,
        rightmost: xy * (squared / xx).sqrt(),
    };

    let sum = mean[0].abs() + mean[1].abs() + xx + yy + xy.abs() + radius + z + squared;
    let finite = (sum < f32::INFINITY) & (determinant < f32::INFINITY) & (inverse < f32::INFINITY);
    let visible = (z > NEAR) & (determinant > 0.0) & finite & (rx1 > rx0) & (ry1 > ry0) & (reach >= 0.0);
    Projected {
        visible,
        mean,
        depth: z,
        covariance: [xx, xy, yy],
        conic,
        opacity,
        radius,
        reach,
        reached: [rx0, rx1, ry0, ry1],
        ellipse,
    }
}

/// The part of a tile range within `extent` of `centre`.
#[inline(always)]
fn narrowed([from, to]: [f32; 2], centre: f32, extent: f32) -> (f32, f32) {
    let side = TILE as f32;
    let first = ((centre - extent - SAFETY) / side).floor();
    let last = ((centre + extent + SAFETY) / side).floor();
    (greatest(from, first), least(to, last + 1.0))
}

/// Tiles `[from, to)` that an interval of `radius` around `centre` touches, by the original's formula.
#[inline(always)]
fn tile_range(centre: f32, radius: f32, tiles: usize) -> [f32; 2] {
    let (side, tiles) = (TILE as f32, tiles as f32);
    let clamp = |v: f32| least(tiles, greatest(0.0, v.trunc()));
    [clamp((centre - radius) / side), clamp((centre + radius + (side - 1.0)) / side)]
}

/// `row · (p, 1)`.
#[inline(always)]
fn affine(row: [f32; 4], p: [f32; 3]) -> f32 {
    row[2].mul_add(p[2], row[1].mul_add(p[1], row[0].mul_add(p[0], row[3])))
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

// One instruction each, unlike `f32::min` and `f32::max` with their NaN rules.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Base-2 logarithm of a positive normal number, to about 1e-7; anything for other numbers, NaN for NaN.
#[inline(always)]
fn log2(v: f32) -> f32 {
    // v = m 2^e with m in [sqrt(1/2), sqrt(2)); log2 m = 2/ln 2 artanh((m - 1) / (m + 1)).
    const ROOT_HALF: u32 = 0x3f35_04f3;
    let offset = v.to_bits().wrapping_sub(ROOT_HALF);
    let e = (offset as i32) >> 23;
    let m = f32::from_bits((offset & 0x007f_ffff).wrapping_add(ROOT_HALF));
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = s2.mul_add(s2.mul_add(s2.mul_add(1.0 / 9.0, 1.0 / 7.0), 1.0 / 5.0), 1.0 / 3.0);
    let artanh = s.mul_add(s2 * series, s);
    let result = artanh.mul_add(2.0 * std::f32::consts::LOG2_E, e as f32);
    if v > 0.0 { result } else { f32::NEG_INFINITY }
}
