//! From a Gaussian to a splat on the screen: EWA projection and colour as in Kerbl et al. 2023, in `f64`.

use super::Cutoffs;
use crate::render::splat::RenderSettings;
use crate::scene::{Camera, ColourClamp, Posed};
use glam::{DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// Side of a tile, pixels.
pub(super) const TILE: usize = 16;
/// Variance added to both screen axes, pixels².
const LOW_PASS: f64 = 0.3;
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
    conic: DMat2,
    opacity: f64,
    pub colour: DVec3,
    /// Pixels that it may touch: x from, x to, y from, y to, half open.
    pub pixels: [usize; 4],
}

impl Splat {
    fn power(&self, [x, y]: [usize; 2]) -> f64 {
        let d = self.mean - DVec2::new(x as f64, y as f64);
        -0.5 * d.dot(self.conic * d)
    }

    /// As if it reached everywhere.
    pub(super) fn alpha(&self, pixel: [usize; 2]) -> f64 {
        (self.opacity * self.power(pixel).exp()).min(MAX_ALPHA)
    }

    /// Where it reaches.
    pub(super) fn visible_alpha(&self, pixel: [usize; 2]) -> Option<f64> {
        let ([x, y], [x0, x1, y0, y1]) = (pixel, self.pixels);
        let within = x >= x0 && x < x1 && y >= y0 && y < y1;
        (within && self.power(pixel) <= 0.0).then(|| self.alpha(pixel))
    }
}

/// One per Gaussian; none for those that are not drawn.
pub(super) fn splats(
    posed: &Posed,
    camera: &Camera,
    settings: &RenderSettings,
    cutoffs: Cutoffs,
) -> Vec<Option<Splat>> {
    (0..posed.len()).into_par_iter().map(|i| project(posed, i, camera, settings, cutoffs)).collect()
}

/// In drawing order: by depth in `f32` as the original, then by index.
pub(super) fn sorted(
    posed: &Posed,
    camera: &Camera,
    settings: &RenderSettings,
    cutoffs: Cutoffs,
) -> Vec<Splat> {
    let mut splats: Vec<Splat> = splats(posed, camera, settings, cutoffs).into_iter().flatten().collect();
    splats.sort_by(|a, b| (a.depth as f32).total_cmp(&(b.depth as f32)));
    splats
}

fn project(
    posed: &Posed,
    i: usize,
    camera: &Camera,
    settings: &RenderSettings,
    cutoffs: Cutoffs,
) -> Option<Splat> {
    let world = posed.means[i].as_dvec3();
    let p = camera.camera_from_world.transform_point3(world);
    // The constant of the original is an f32.
    if p.z <= f64::from(0.2f32) {
        return None;
    }
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let bare = screen_covariance(posed.factors[i].as_dmat3(), p, camera);
    let covariance = bare + DMat2::from_diagonal(DVec2::splat(LOW_PASS));
    let determinant = covariance.determinant();
    let compensation =
        if settings.antialiased { (bare.determinant() / determinant).max(0.000_025).sqrt() } else { 1.0 };
    let opacity = f64::from(posed.opacities[i]) * compensation;
    let mean = screen_mean(p, camera);
    let drawable = determinant != 0.0 && determinant.is_finite() && mean.is_finite();
    if !drawable || opacity < cutoffs.alpha {
        return None;
    }
    let (from, to) = if cutoffs.three_sigma {
        tiles_touched(mean, covariance)
    } else {
        let variance = DVec2::new(covariance.x_axis.x, covariance.y_axis.y);
        let reach = (2.0 * (opacity / cutoffs.alpha).ln() * variance).powf(0.5);
        ((mean - reach).ceil(), (mean + reach).floor() + 1.0)
    };
    let (from, to) = (from.clamp(DVec2::ZERO, size), to.clamp(DVec2::ZERO, size));
    let pixels = [from.x as usize, to.x as usize, from.y as usize, to.y as usize];
    Some(Splat {
        gaussian: i,
        depth: p.z,
        mean,
        conic: covariance.inverse(),
        opacity,
        colour: colour(posed, i, world - camera.position()),
        pixels,
    })
}

/// J W Σ Wᵀ Jᵀ, the slope in J limited to 1.3 half fields of view; `p` is the mean in camera coordinates.
fn screen_covariance(factor: DMat3, p: DVec3, camera: &Camera) -> DMat2 {
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
    let entry = |a: usize, b: usize| rows[a].dot(rows[b]);
    DMat2::from_cols_array(&[entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)])
}

fn screen_mean(p: DVec3, camera: &Camera) -> DVec2 {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let (focal, centre) = (DVec2::new(camera.fx, camera.fy), DVec2::new(camera.cx, camera.cy));
    let ndc = (2.0 * focal / size * DVec2::new(p.x, p.y) + (2.0 * centre / size - 1.0) * p.z) / (p.z + 1e-7);
    ((ndc + 1.0) * size - 1.0) / 2.0
}

/// Pixels from and to of the tiles within three standard deviations of the longer axis.
fn tiles_touched(mean: DVec2, covariance: DMat2) -> (DVec2, DVec2) {
    let middle = 0.5 * (covariance.x_axis.x + covariance.y_axis.y);
    let largest = middle + (middle * middle - covariance.determinant()).max(0.1).sqrt();
    let radius = (3.0 * largest.sqrt()).ceil();
    let tile = TILE as f64;
    (((mean - radius) / tile).trunc() * tile, ((mean + radius + (tile - 1.0)) / tile).trunc() * tile)
}

fn colour(posed: &Posed, i: usize, direction: DVec3) -> DVec3 {
    let direction = match &posed.view_frames {
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
