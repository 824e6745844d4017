//! The adjoint of the projection: from a splat's moments to its Gaussian's mean, factor and opacity.

use super::derivatives::Derivatives;
use super::lanes::Lanes;
use super::project::{
    LEAST_COMPENSATION, LOW_PASS, Projected, Projection, ScreenAxis, affine, dot, project, screen_axis,
};
use super::wide::Wide;

/// What the original adds to the squared determinant of the screen covariance on the way back.
const DETERMINANT_GUARD: f32 = 1e-7;

/// Sixteen Gaussians as the projection reads them. The factor by columns.
#[derive(Clone, Copy)]
pub(super) struct Source<L: Lanes> {
    pub(super) mean: [Wide<L>; 3],
    pub(super) factor: [[Wide<L>; 3]; 3],
    pub(super) opacity: Wide<L>,
}

/// Derivatives with respect to a [`Source`].
#[derive(Clone, Copy)]
pub(super) struct SourceGradient<L: Lanes> {
    pub(super) mean: [Wide<L>; 3],
    pub(super) factor: [[Wide<L>; 3]; 3],
    pub(super) opacity: Wide<L>,
    /// With respect to the position on screen, in half image sizes.
    pub(super) screen: [Wide<L>; 2],
    /// Not a derivative: the radius on screen, pixels.
    pub(super) radius: Wide<L>,
}

/// Σ g, Σ g dx, Σ g dy, Σ g dx², Σ g dx dy, Σ g dy² with g = `dL/d ln α` of a pixel and d the mean less the pixel.
pub(super) type Moments<L> = [Wide<L>; 6];

impl<L: Lanes> Source<L> {
    /// Derivatives from the moments of the splats.
    #[inline(always)]
    pub(super) fn adjoint(
        &self,
        projection: &Projection,
        moments: Moments<L>,
        derivatives: Derivatives,
    ) -> SourceGradient<L> {
        let n = |value: f32| self.opacity.constant(value);
        let projected = project(projection, self.mean, self.factor, self.opacity);
        let inverse_z = n(1.0) / projected.depth;
        let axes = [
            screen_axis(projection, 0, self.mean, self.factor, inverse_z),
            screen_axis(projection, 1, self.mean, self.factor, inverse_z),
        ];

        let [power, x, y, ..] = moments;
        let [a, b, c] = projected.conic;
        let screen = [
            -a.mul_add(x, b * y) * n(0.5 * projection.size[0]),
            -b.mul_add(x, c * y) * n(0.5 * projection.size[1]),
        ];
        let mut covariance = covariance_from_conic(&projected, moments, derivatives);
        if projection.antialiased {
            let more = compensation(&projected, &axes, power, derivatives);
            for k in 0..3 {
                covariance[k] = covariance[k] + more[k];
            }
        }

        // The covariance is the Gram matrix of the axes' factors.
        let [xx, xy, yy] = covariance;
        let [u, v] = [axes[0].factor, axes[1].factor];
        let du = combined(n(2.0) * xx, u, xy, v);
        let dv = combined(n(2.0) * yy, v, xy, u);
        let mut factor = self.factor;
        for j in 0..3 {
            factor[j] = combined(du[j], axes[0].row, dv[j], axes[1].row);
        }
        let mut mean = [n(0.0); 3];
        for (k, by_factor) in [du, dv].into_iter().enumerate() {
            let row = transformed(self.factor, by_factor);
            self.add_jacobian(projection, k, &axes[k], inverse_z, row, derivatives, &mut mean);
            self.add_position(projection, k, projected.depth, screen[k], &mut mean);
        }
        // α is the product of the opacity and what does not depend on it.
        SourceGradient { mean, factor, opacity: power / self.opacity, screen, radius: projected.radius }
    }

    /// Through row k of J W, whose derivative is `row`.
    #[inline(always)]
    fn add_jacobian(
        &self,
        projection: &Projection,
        k: usize,
        axis: &ScreenAxis<L>,
        inverse_z: Wide<L>,
        row: [Wide<L>; 3],
        derivatives: Derivatives,
        mean: &mut [Wide<L>; 3],
    ) {
        let n = |value: f32| inverse_z.constant(value);
        let (own, forward) = (along(projection.rows[k], row), along(projection.rows[2], row));
        let scale = n(projection.focal[k]) * inverse_z * inverse_z;
        let limit = n(projection.limit[k]);
        let free = axis.slope.at_least(-limit).and(limit.at_least(axis.slope));
        // -f x/z²: of x/z, beyond the limit, nothing moves; the original forgets that for z.
        let power = match derivatives {
            Derivatives::Exact => free.select(n(2.0), n(1.0)),
            Derivatives::OriginalKernels => n(2.0),
        };
        let by_z = scale * (power * axis.limited).mul_add(forward, -own);
        let by_x = free.keep(-(scale * forward));
        for i in 0..3 {
            mean[i] = by_z.mul_add(n(projection.rows[2][i]), by_x.mul_add(n(projection.rows[k][i]), mean[i]));
        }
    }

    /// Through coordinate k of the position on screen, in half image sizes.
    #[inline(always)]
    fn add_position(
        &self,
        projection: &Projection,
        k: usize,
        z: Wide<L>,
        screen: Wide<L>,
        mean: &mut [Wide<L>; 3],
    ) {
        let n = |value: f32| z.constant(value);
        let w = n(1.0) / (z + n(1e-7));
        let by_clip = screen * w;
        let by_w = by_clip * (affine(projection.clip[k], self.mean) * w);
        for i in 0..3 {
            let clip = by_clip.mul_add(n(projection.clip[k][i]), mean[i]);
            mean[i] = by_w.neg_mul_add(n(projection.rows[2][i]), clip);
        }
    }
}

/// Derivatives with respect to xx, xy, yy of the screen covariance, through its inverse: `½ K S K` for the conic K and the
/// second moments S (xy counted twice).
#[inline(always)]
fn covariance_from_conic<L: Lanes>(
    projected: &Projected<Wide<L>>,
    [.., sxx, sxy, syy]: Moments<L>,
    derivatives: Derivatives,
) -> [Wide<L>; 3] {
    let n = |value: f32| sxx.constant(value);
    let [a, b, c] = projected.conic;
    let (left, right) = (
        [a.mul_add(sxx, b * sxy), a.mul_add(sxy, b * syy)],
        [b.mul_add(sxx, c * sxy), b.mul_add(sxy, c * syy)],
    );
    let half = match derivatives {
        Derivatives::Exact => n(0.5),
        Derivatives::OriginalKernels => {
            let [xx, xy, yy] = projected.covariance;
            let inverse = n(1.0) / (xx * yy - xy * xy);
            n(0.5) / (n(DETERMINANT_GUARD) * inverse).mul_add(inverse, n(1.0))
        }
    };
    [
        half * left[0].mul_add(a, left[1] * b),
        n(2.0) * half * left[0].mul_add(b, left[1] * c),
        half * right[0].mul_add(b, right[1] * c),
    ]
}

/// Derivatives with respect to xx, xy, yy of the screen covariance, through the antialiasing factor
/// `sqrt(det / det_low_passed)`. The original takes the low-passed entries for the bare ones here.
#[inline(always)]
fn compensation<L: Lanes>(
    projected: &Projected<Wide<L>>,
    [u, v]: &[ScreenAxis<L>; 2],
    power: Wide<L>,
    derivatives: Derivatives,
) -> [Wide<L>; 3] {
    let n = |value: f32| power.constant(value);
    let [xx, xy, yy] = projected.covariance;
    let (bare_xx, bare_yy) = (dot(u.factor, u.factor), dot(v.factor, v.factor));
    let ratio = (bare_xx * bare_yy - xy * xy) / (xx * yy - xy * xy);
    // d ln α / d ratio.
    let by_ratio = n(LEAST_COMPENSATION).less(ratio).keep(n(0.5) * power / ratio);
    let (x, y) = match derivatives {
        Derivatives::Exact => (bare_xx, bare_yy),
        Derivatives::OriginalKernels => (xx, yy),
    };
    let w = n(LOW_PASS);
    let determinant = (x + w) * (y + w) - xy * xy;
    let scale = by_ratio * w / (determinant * determinant);
    [scale * y.mul_add(y + w, xy * xy), n(-2.0) * scale * xy * (x + y + w), scale * x.mul_add(x + w, xy * xy)]
}

/// `a u + b v`.
#[inline(always)]
fn combined<L: Lanes>(a: Wide<L>, u: [Wide<L>; 3], b: Wide<L>, v: [Wide<L>; 3]) -> [Wide<L>; 3] {
    [a.mul_add(u[0], b * v[0]), a.mul_add(u[1], b * v[1]), a.mul_add(u[2], b * v[2])]
}

/// `M v`, M by columns.
#[inline(always)]
fn transformed<L: Lanes>([x, y, z]: [[Wide<L>; 3]; 3], v: [Wide<L>; 3]) -> [Wide<L>; 3] {
    [dot([x[0], y[0], z[0]], v), dot([x[1], y[1], z[1]], v), dot([x[2], y[2], z[2]], v)]
}

/// The row's first three numbers times v.
#[inline(always)]
fn along<L: Lanes>([x, y, z, _]: [f32; 4], v: [Wide<L>; 3]) -> Wide<L> {
    let n = |value: f32| v[0].constant(value);
    v[2].mul_add(n(z), v[1].mul_add(n(y), v[0] * n(x)))
}
