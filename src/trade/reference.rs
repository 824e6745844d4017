//! A plain splat renderer in f64 in which every cut-off of the 3DGS rasterizer can be switched off: the exact image, and
//! what each cut-off alone costs and saves. Slow: pixel by pixel and splat by splat, tile by tile in parallel.
//!
//! The projection (EWA, Jacobian limited to 1.3 half fields of view, near plane at 0.2, low-pass of 0.3 pixels²) is that
//! of Kerbl et al. 2023; it defines the image, and only what is skipped is a choice here.

use crate::math::sh;
use crate::scene::{Camera, ColourClamp, Image, Posed};
use glam::{DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// Side of a tile, pixels.
const TILE: usize = 16;
/// Gaussians at or in front of this depth are not drawn.
const NEAR: f64 = 0.2;
/// Variance added to both screen axes, pixels².
const LOW_PASS: f64 = 0.3;
/// Alpha is capped here.
const MAX_ALPHA: f64 = 0.99;
/// Where nothing is cut off, splats end where their alpha is below this: 2,000 of them on one pixel change less than half
/// a step of an 8-bit image by a factor of 1000.
const NOTHING: f64 = 1e-9;

/// What is skipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutoffs {
    /// Alpha below this is not blended (3DGS: 1/255).
    pub alpha: f64,
    /// A splat that would leave less transmittance than this ends its pixel (3DGS: 1e-4).
    pub transmittance: f64,
    /// Splats end with the tiles that three standard deviations of their longer axis touch.
    pub three_sigma: bool,
    /// Opacity is compensated for the low-pass.
    pub antialiased: bool,
}

impl Cutoffs {
    /// Nothing is skipped.
    pub const NONE: Self =
        Self { alpha: NOTHING, transmittance: 0.0, three_sigma: false, antialiased: false };
    /// As 3DGS.
    pub const STOCK: Self =
        Self { alpha: 1.0 / 255.0, transmittance: 1e-4, three_sigma: true, antialiased: false };
}

/// An image, and how much each Gaussian adds to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Colour over the background.
    pub image: Image,
    /// Σ alpha · transmittance over all pixels, per Gaussian.
    pub contributions: Vec<f64>,
}

/// A splat on the screen.
struct Splat {
    gaussian: usize,
    depth: f64,
    mean: DVec2,
    conic: DMat2,
    opacity: f64,
    colour: DVec3,
    /// Pixels that it may touch: x from, x to, y from, y to, half open.
    pixels: [usize; 4],
}

/// Draws Gaussians with the given cut-offs.
///
/// # Panics
/// If the arrays of `posed` differ in length.
pub(super) fn draw(posed: &Posed, camera: &Camera, background: [f32; 3], cutoffs: Cutoffs) -> Reference {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut splats: Vec<Splat> =
        (0..posed.len()).into_par_iter().filter_map(|i| project(posed, i, camera, cutoffs)).collect();
    splats.sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.gaussian.cmp(&b.gaussian)));
    let across = width.div_ceil(TILE);
    let mut lists = vec![Vec::new(); across * height.div_ceil(TILE)];
    for (k, splat) in splats.iter().enumerate() {
        let [x0, x1, y0, y1] = splat.pixels;
        for row in y0 / TILE..y1.div_ceil(TILE) {
            for column in x0 / TILE..x1.div_ceil(TILE) {
                lists[row * across + column].push(k);
            }
        }
    }
    let background = DVec3::from_array(background.map(f64::from));
    let tiles: Vec<(Vec<[f32; 3]>, Vec<f64>)> = lists
        .par_iter()
        .enumerate()
        .map(|(tile, list)| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let mut shares = vec![0.0; list.len()];
            let mut colours = Vec::with_capacity(TILE * TILE);
            for y in top..(top + TILE).min(height) {
                for x in left..(left + TILE).min(width) {
                    colours.push(blend(&splats, list, [x, y], cutoffs, background, &mut shares));
                }
            }
            (colours, shares)
        })
        .collect();
    let mut image = Image::filled(width, height, [0.0; 3]);
    let mut contributions = vec![0.0; posed.len()];
    for (tile, (colours, shares)) in tiles.iter().enumerate() {
        let (left, top) = (tile % across * TILE, tile / across * TILE);
        let columns = TILE.min(width - left);
        for (k, row) in colours.chunks(columns).enumerate() {
            let start = (top + k) * width + left;
            image.pixels_mut()[start..start + columns].copy_from_slice(row);
        }
        for (&k, share) in lists[tile].iter().zip(shares) {
            contributions[splats[k].gaussian] += share;
        }
    }
    Reference { image, contributions }
}

/// The colour of a pixel; adds to the shares of the listed splats.
fn blend(
    splats: &[Splat],
    list: &[usize],
    [x, y]: [usize; 2],
    cutoffs: Cutoffs,
    background: DVec3,
    shares: &mut [f64],
) -> [f32; 3] {
    let pixel = DVec2::new(x as f64, y as f64);
    let (mut transmittance, mut colour) = (1.0, DVec3::ZERO);
    for (&k, share) in list.iter().zip(shares) {
        let splat = &splats[k];
        let [x0, x1, y0, y1] = splat.pixels;
        if x < x0 || x >= x1 || y < y0 || y >= y1 {
            continue;
        }
        let d = splat.mean - pixel;
        let alpha = (splat.opacity * (-0.5 * d.dot(splat.conic * d)).exp()).min(MAX_ALPHA);
        if alpha < cutoffs.alpha {
            continue;
        }
        let after = transmittance * (1.0 - alpha);
        if after < cutoffs.transmittance {
            break;
        }
        colour += splat.colour * (alpha * transmittance);
        *share += alpha * transmittance;
        transmittance = after;
    }
    (colour + background * transmittance).as_vec3().to_array()
}

fn project(posed: &Posed, i: usize, camera: &Camera, cutoffs: Cutoffs) -> Option<Splat> {
    let world = posed.means[i].as_dvec3();
    let p = camera.camera_from_world.transform_point3(world);
    if p.z <= NEAR {
        return None;
    }
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let focal = DVec2::new(camera.fx, camera.fy);
    let limit = 1.3 * size / (2.0 * focal);
    let slope = (DVec2::new(p.x, p.y) / p.z).clamp(-limit, limit);
    let jacobian = [
        DVec3::new(focal.x / p.z, 0.0, -focal.x * slope.x / p.z),
        DVec3::new(0.0, focal.y / p.z, -focal.y * slope.y / p.z),
    ];
    let factor = DMat3::from_mat4(camera.camera_from_world) * posed.factors[i].as_dmat3();
    let rows = jacobian.map(|row| factor.transpose() * row);
    let bare = DMat2::from_cols_array(&[
        rows[0].dot(rows[0]),
        rows[0].dot(rows[1]),
        rows[0].dot(rows[1]),
        rows[1].dot(rows[1]),
    ]);
    let covariance = bare + DMat2::from_diagonal(DVec2::splat(LOW_PASS));
    let determinant = covariance.determinant();
    let compensation =
        if cutoffs.antialiased { (bare.determinant() / determinant).max(0.000_025).sqrt() } else { 1.0 };
    let opacity = f64::from(posed.opacities[i]) * compensation;
    if !(determinant > 0.0 && determinant.is_finite() && opacity > cutoffs.alpha) {
        return None;
    }
    // Pixel i has its centre at i here, at i + 1/2 in the camera.
    let mean = focal * DVec2::new(p.x, p.y) / p.z + DVec2::new(camera.cx, camera.cy) - 0.5;
    let variance = DVec2::new(covariance.x_axis.x, covariance.y_axis.y);
    let (low, high) = if cutoffs.three_sigma {
        let middle = 0.5 * (variance.x + variance.y);
        let largest = middle + (middle * middle - determinant).max(0.1).sqrt();
        let radius = (3.0 * largest.sqrt()).ceil();
        let tile = TILE as f64;
        let (from, to) = (((mean - radius) / tile).floor(), ((mean + radius + (tile - 1.0)) / tile).floor());
        (from * tile, to * tile)
    } else {
        let reach = (2.0 * (opacity / cutoffs.alpha).ln() * variance).powf(0.5);
        ((mean - reach).ceil(), (mean + reach).floor() + 1.0)
    };
    let (low, high) = (low.clamp(DVec2::ZERO, size), high.clamp(DVec2::ZERO, size));
    let pixels = [low.x as usize, high.x as usize, low.y as usize, high.y as usize];
    let colour = colour(posed, i, world - camera.position());
    let empty = pixels[0] >= pixels[1] || pixels[2] >= pixels[3];
    let conic = covariance.inverse();
    (!empty && mean.is_finite()).then_some(Splat {
        gaussian: i,
        depth: p.z,
        mean,
        conic,
        opacity,
        colour,
        pixels,
    })
}

fn colour(posed: &Posed, i: usize, direction: DVec3) -> DVec3 {
    let direction = posed.view_frames.as_ref().map_or(direction, |f| f[i].as_dmat3() * direction);
    let count = sh::count(posed.sh_degree);
    let mut coefficients = [[0.0; 3]; 16];
    for (wide, narrow) in coefficients.iter_mut().zip(&posed.sh[i * count..][..count]) {
        *wide = narrow.map(f64::from);
    }
    let unit = direction.normalize_or_zero().to_array();
    let basis = sh::basis(posed.sh_degree, unit);
    let sum: DVec3 = coefficients[..count].iter().zip(basis).map(|(&c, b)| DVec3::from_array(c) * b).sum();
    let least = (sum + 0.5).max(DVec3::ZERO);
    match posed.colour_clamp {
        ColourClamp::NonNegative => least,
        ColourClamp::Unit => least.min(DVec3::ONE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SplitMix64;
    use crate::render::splat::{RenderSettings, render};
    use crate::scene::Gaussians;
    use crate::trade::Fidelity;
    use glam::Vec3;

    /// Two hundred random splats in front of a camera.
    fn scene() -> (Gaussians, Camera) {
        let mut random = SplitMix64::new(11);
        let mut number = |low: f32, high: f32| low + (high - low) * random.unit_f32();
        let mut gaussians = Gaussians { sh_degree: 1, ..Gaussians::default() };
        for _ in 0..200 {
            gaussians.means.push(Vec3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-0.5, 0.5)));
            gaussians.rotations.push([number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0), 0.4]);
            gaussians.log_scales.push(Vec3::new(number(-5.0, -2.0), number(-5.0, -2.0), number(-5.0, -2.0)));
            gaussians.opacity_logits.push(number(-3.0, 4.0));
            gaussians.sh.extend((0..4).map(|_| [number(-0.5, 0.5), number(-0.5, 0.5), number(-0.5, 0.5)]));
        }
        let eye = glam::DVec3::new(0.2, 0.1, -3.0);
        (gaussians, Camera::look_at(eye, glam::DVec3::ZERO, glam::DVec3::Y, 90.0, 72, 65))
    }

    #[test]
    fn with_the_stock_cutoffs_it_is_the_rasterizer() {
        let (gaussians, camera) = scene();
        let posed = Posed::from_static(&gaussians);
        for antialiased in [false, true] {
            let background = [0.2, 0.3, 0.4];
            let settings = RenderSettings { background, antialiased };
            let fast = render(&posed, &camera, &settings).image;
            let plain = draw(&posed, &camera, background, Cutoffs { antialiased, ..Cutoffs::STOCK }).image;
            let psnr = Fidelity::between([(&fast, &plain)]).expect("same size").decibels();
            // A pixel whose alpha is within rounding of a cut-off may fall on either side.
            assert!(psnr > 75.0, "{psnr} dB");
        }
    }

    #[test]
    fn every_cutoff_changes_the_image_and_the_exact_image_has_none() {
        let (gaussians, camera) = scene();
        let posed = Posed::from_static(&gaussians);
        let exact = draw(&posed, &camera, [0.5; 3], Cutoffs::NONE);
        let with = |cutoffs| {
            let image = draw(&posed, &camera, [0.5; 3], cutoffs).image;
            Fidelity::between([(&image, &exact.image)]).expect("same size").decibels()
        };
        let alpha = with(Cutoffs { alpha: 1.0 / 255.0, ..Cutoffs::NONE });
        assert!(alpha.is_finite() && with(Cutoffs { alpha: 0.05, ..Cutoffs::NONE }) < alpha);
        assert!(with(Cutoffs { antialiased: true, ..Cutoffs::NONE }).is_finite());
        assert_eq!(with(Cutoffs { transmittance: 1e-300, ..Cutoffs::NONE }), f64::INFINITY);
        assert!(with(Cutoffs { transmittance: 0.5, ..Cutoffs::NONE }) < 50.0);
    }

    /// What all Gaussians add, and what is left of the background, is everything.
    #[test]
    fn contributions_add_up_to_the_alpha() {
        let (mut gaussians, camera) = scene();
        gaussians.sh_degree = 0;
        // Colour 1: the image is the alpha.
        gaussians.sh = vec![[(0.5 / sh::C0) as f32; 3]; gaussians.len()];
        let drawn = draw(&Posed::from_static(&gaussians), &camera, [0.0; 3], Cutoffs::NONE);
        let sum: f64 = drawn.image.pixels().iter().map(|p| f64::from(p[0])).sum();
        let shares: f64 = drawn.contributions.iter().sum();
        assert!((sum - shares).abs() < 1e-5 * sum, "{sum} {shares}");
    }
}
