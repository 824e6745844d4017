//! From a Gaussian to a splat on the screen: EWA projection and colour as in Kerbl et al. 2023, in `f64`.

use super::Cutoffs;
use crate::View;
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::rasterizer::{self, DEVIATIONS, LEAST_DISCRIMINANT, LOW_PASS};
use skinsplat_core::scene::{Camera, ColourClamp, Posed};

pub(super) use rasterizer::TILE;

/// Alpha is capped here.
const MAX_ALPHA: f64 = 0.99;

/// A splat on the screen.
pub(super) struct Splat {
    /// Index of its Gaussian.
    pub gaussian: usize,
    /// Camera depth, metres.
    pub depth: f64,
    /// Pixels; pixel i has its centre at i.
    mean: DVec2,
    footprint: Footprint,
    opacity: f64,
    pub colour: DVec3,
    /// Pixels that it may touch: x from, x to, y from, y to, half open.
    pub pixels: [usize; 4],
}

impl Splat {
    fn power(&self, [x, y]: [usize; 2]) -> f64 {
        self.footprint.power(self.mean - DVec2::new(x as f64, y as f64))
    }

    /// As if it reached everywhere.
    pub(super) fn alpha(&self, pixel: [usize; 2]) -> f64 {
        (self.opacity * portable::exp(self.power(pixel))).min(MAX_ALPHA)
    }

    /// Where it reaches.
    pub(super) fn visible_alpha(&self, pixel: [usize; 2]) -> Option<f64> {
        let ([x, y], [x0, x1, y0, y1]) = (pixel, self.pixels);
        let within = x >= x0 && x < x1 && y >= y0 && y < y1;
        within.then(|| self.alpha(pixel))
    }
}

/// One per Gaussian; none for those that are not drawn.
pub(super) fn splats(posed: &Posed, view: &View, cutoffs: Cutoffs) -> Vec<Option<Splat>> {
    (0..posed.len()).into_par_iter().map(|i| project(posed, i, view, cutoffs)).collect()
}

/// In drawing order: by depth in `f32` as the original, then by index.
pub(super) fn sorted(posed: &Posed, view: &View, cutoffs: Cutoffs) -> Vec<Splat> {
    let mut splats: Vec<Splat> = splats(posed, view, cutoffs).into_iter().flatten().collect();
    splats.sort_by(|a, b| (a.depth as f32).total_cmp(&(b.depth as f32)));
    splats
}

fn project(posed: &Posed, i: usize, view: &View, cutoffs: Cutoffs) -> Option<Splat> {
    let (world, camera) = (posed.means[i].as_dvec3(), view.camera);
    let p = camera.camera_from_world.transform_point3(world);
    // The constant of the original is an f32.
    if p.z <= f64::from(0.2f32) {
        return None;
    }
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let footprint = Footprint::new(posed.factors[i].as_dmat3(), p, camera);
    let compensation = if view.antialiased { footprint.compensation() } else { 1.0 };
    let opacity = f64::from(posed.opacities[i]) * compensation;
    let mean = screen_mean(p, camera);
    if !(footprint.determinant.is_finite() && mean.is_finite()) {
        return None;
    }
    let (from, to) = if cutoffs.three_sigma {
        tiles_touched(mean, footprint.radius())
    } else {
        let reach =
            (2.0 * portable::ln(opacity / cutoffs.alpha).max(0.0) * footprint.variances()).map(f64::sqrt);
        ((mean - reach).ceil(), (mean + reach).floor() + 1.0)
    };
    let (from, to) = (from.clamp(DVec2::ZERO, size), to.clamp(DVec2::ZERO, size));
    let pixels = [from.x as usize, to.x as usize, from.y as usize, to.y as usize];
    Some(Splat {
        gaussian: i,
        depth: p.z,
        mean,
        footprint,
        opacity,
        colour: colour(posed, i, world - camera.position()),
        pixels,
    })
}

/// The covariance on the screen, Σ' = J W Σ Wᵀ Jᵀ + 0.3 I, by the rows of J W M: its determinant and its inverse as sums
/// of squares, which do not cancel for needles.
struct Footprint {
    /// J W M, pixels.
    rows: [DVec3; 2],
    /// |r0 × r1|², the determinant without the low-pass (Cauchy and Binet).
    bare: f64,
    /// det Σ'.
    determinant: f64,
}

impl Footprint {
    /// Of Σ = M Mᵀ; the slope in J is limited to 1.3 half fields of view; `p` is the mean in camera coordinates.
    fn new(factor: DMat3, p: DVec3, camera: &Camera) -> Self {
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let focal = DVec2::new(camera.fx, camera.fy);
        let limit = 1.3 * size / (2.0 * focal);
        let slope = (DVec2::new(p.x, p.y) / p.z).clamp(-limit, limit);
        let jacobian = [
            DVec3::new(focal.x / p.z, 0.0, -focal.x * slope.x / p.z),
            DVec3::new(0.0, focal.y / p.z, -focal.y * slope.y / p.z),
        ];
        let factor = DMat3::from_mat4(camera.camera_from_world) * factor;
        let rows = jacobian.map(|row| factor.transpose() * row);
        let bare = rows[0].cross(rows[1]).length_squared();
        let trace = rows[0].length_squared() + rows[1].length_squared();
        Self { rows, bare, determinant: bare + LOW_PASS * trace + LOW_PASS * LOW_PASS }
    }

    /// −½ dᵀ Σ'⁻¹ d.
    fn power(&self, d: DVec2) -> f64 {
        let across = d.x * self.rows[1] - d.y * self.rows[0];
        -0.5 * (across.length_squared() + LOW_PASS * d.length_squared()) / self.determinant
    }

    /// Of both axes, pixels².
    fn variances(&self) -> DVec2 {
        DVec2::new(self.rows[0].length_squared(), self.rows[1].length_squared()) + LOW_PASS
    }

    /// Three standard deviations of the longer axis, pixels.
    fn radius(&self) -> f64 {
        let variances = self.variances();
        let middle = 0.5 * (variances.x + variances.y);
        let largest = middle + (middle * middle - self.determinant).max(LEAST_DISCRIMINANT).sqrt();
        (DEVIATIONS * largest.sqrt()).ceil()
    }

    /// Of the opacity, for what the low-pass adds.
    fn compensation(&self) -> f64 {
        (self.bare / self.determinant).max(0.000_025).sqrt()
    }
}

fn screen_mean(p: DVec3, camera: &Camera) -> DVec2 {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let (focal, centre) = (DVec2::new(camera.fx, camera.fy), DVec2::new(camera.cx, camera.cy));
    let ndc = (2.0 * focal / size * DVec2::new(p.x, p.y) + (2.0 * centre / size - 1.0) * p.z) / (p.z + 1e-7);
    ((ndc + 1.0) * size - 1.0) / 2.0
}

/// Pixels from and to of the tiles within a radius.
fn tiles_touched(mean: DVec2, radius: f64) -> (DVec2, DVec2) {
    let tile = TILE as f64;
    (((mean - radius) / tile).trunc() * tile, ((mean + radius + (tile - 1.0)) / tile).trunc() * tile)
}

fn colour(posed: &Posed, i: usize, direction: DVec3) -> DVec3 {
    let direction = match posed.view_frames {
        Some(frames) => frames[i].as_dmat3() * direction,
        None => direction,
    };
    let count = (posed.sh_degree + 1).pow(2);
    let coefficients = &posed.sh[i * count..][..count];
    let colour: DVec3 = std::iter::zip(coefficients, basis(direction.normalize()))
        .map(|(c, b)| DVec3::from_array(c.map(f64::from)) * b)
        .sum();
    let least = (colour + 0.5).max(DVec3::ZERO);
    match posed.colour_clamp {
        ColourClamp::NonNegative => least,
        ColourClamp::Unit => least.min(DVec3::ONE),
    }
}

/// Real spherical harmonics, from their closed forms.
fn basis(d: DVec3) -> [f64; 16] {
    let DVec3 { x, y, z } = d;
    let pi = std::f64::consts::PI;
    let c = |numerator: f64, denominator: f64| (numerator / (denominator * pi)).sqrt();
    [
        c(1.0, 4.0),
        -c(3.0, 4.0) * y,
        c(3.0, 4.0) * z,
        -c(3.0, 4.0) * x,
        c(15.0, 4.0) * x * y,
        -c(15.0, 4.0) * y * z,
        c(5.0, 16.0) * (3.0 * z * z - 1.0),
        -c(15.0, 4.0) * x * z,
        c(15.0, 16.0) * (x * x - y * y),
        -c(35.0, 32.0) * y * (3.0 * x * x - y * y),
        c(105.0, 4.0) * x * y * z,
        -c(21.0, 32.0) * y * (5.0 * z * z - 1.0),
        c(7.0, 16.0) * z * (5.0 * z * z - 3.0),
        -c(21.0, 32.0) * x * (5.0 * z * z - 1.0),
        c(105.0, 16.0) * z * (x * x - y * y),
        -c(35.0, 32.0) * x * (x * x - 3.0 * y * y),
    ]
}
