//! [`draw`]: all pixels, tile by tile in parallel.

use super::project::{Splat, TILE, sorted};
use super::{Cutoffs, Step, underlay_at, walk};
use crate::View;
use glam::DVec3;
use rayon::prelude::*;
use skinsplat_core::scene::{Image, Posed, SceneError};

/// An image, and how much each Gaussian adds to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Colour over the background.
    pub image: Image,
    /// Σ alpha · transmittance over all pixels, per Gaussian.
    pub contributions: Vec<f64>,
}

/// Draws Gaussians with the given cut-offs.
///
/// # Errors
/// As [`crate::splat::Renderer::render`].
pub fn draw(posed: &Posed, view: &View, cutoffs: Cutoffs) -> Result<Drawn, SceneError> {
    view.check(posed)?;
    let [width, height] = view.size();
    let splats = sorted(posed, view, cutoffs);
    let across = width.div_ceil(TILE);
    let lists = tile_lists(&splats, across, height.div_ceil(TILE));
    let tiles: Vec<Tile> = lists
        .par_iter()
        .enumerate()
        .map(|(i, list)| Tile::new(view, &splats, list, corner(i, across), cutoffs))
        .collect();
    let mut image = Image::filled(width, height, [0.0; 3]);
    let mut contributions = vec![0.0; posed.len()];
    for (i, (tile, list)) in tiles.iter().zip(&lists).enumerate() {
        let [left, top] = corner(i, across);
        let columns = TILE.min(width - left);
        for (k, row) in tile.colours.chunks(columns).enumerate() {
            let start = (top + k) * width + left;
            image.pixels_mut()[start..start + columns].copy_from_slice(row);
        }
        for (&k, share) in list.iter().zip(&tile.shares) {
            contributions[splats[k].gaussian] += share;
        }
    }
    Ok(Drawn { image, contributions })
}

/// First pixel of a tile.
fn corner(tile: usize, across: usize) -> [usize; 2] {
    [tile % across * TILE, tile / across * TILE]
}

/// One tile of the image.
struct Tile {
    /// Of the pixels within the image, row by row.
    colours: Vec<[f32; 3]>,
    /// What each listed splat adds.
    shares: Vec<f64>,
}

impl Tile {
    fn new(view: &View, splats: &[Splat], list: &[usize], [left, top]: [usize; 2], cutoffs: Cutoffs) -> Self {
        let [width, height] = view.size();
        let mut tile = Self { colours: Vec::with_capacity(TILE * TILE), shares: vec![0.0; list.len()] };
        for y in top..(top + TILE).min(height) {
            for x in left..(left + TILE).min(width) {
                tile.blend(view, splats, list, [x, y], cutoffs);
            }
        }
        tile
    }

    /// Adds a pixel.
    fn blend(&mut self, view: &View, splats: &[Splat], list: &[usize], pixel: [usize; 2], cutoffs: Cutoffs) {
        let (mut colour, mut covered) = (DVec3::ZERO, 0.0);
        let listed = list.iter().map(|&k| &splats[k]);
        walk(listed, pixel, underlay_at(view, pixel), cutoffs, |step, share| {
            covered += share;
            colour += share
                * match step {
                    Step::Underlay(own) => own.colour,
                    Step::Splat(k) => {
                        self.shares[k] += share;
                        splats[list[k]].colour
                    }
                };
        });
        let background = DVec3::from_array(view.background.map(f64::from));
        self.colours.push((colour + background * (1.0 - covered)).as_vec3().to_array());
    }
}

/// For every tile the splats that may touch it, in order.
fn tile_lists(splats: &[Splat], across: usize, down: usize) -> Vec<Vec<usize>> {
    let mut lists = vec![Vec::new(); across * down];
    for (k, splat) in splats.iter().enumerate() {
        let [x0, x1, y0, y1] = splat.pixels;
        if x0 >= x1 || y0 >= y1 {
            continue;
        }
        for row in y0 / TILE..y1.div_ceil(TILE) {
            for column in x0 / TILE..x1.div_ceil(TILE) {
                lists[row * across + column].push(k);
            }
        }
    }
    lists
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splat::render;
    use glam::Vec3;
    use skinsplat_core::math::random::SplitMix64;
    use skinsplat_core::math::sh;
    use skinsplat_core::scene::{Camera, Gaussians, OwnedPosed};

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

    /// dB.
    fn psnr(a: &Image, b: &Image) -> f64 {
        let pairs = a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        -10.0 * (sum / (3 * a.pixels().len()) as f64).log10()
    }

    #[test]
    fn with_the_stock_cutoffs_it_is_the_rasterizer() {
        let (gaussians, camera) = scene();
        let posed = OwnedPosed::from_static(&gaussians);
        for antialiased in [false, true] {
            let view = View::new(&camera).over([0.2, 0.3, 0.4]).antialiased(antialiased);
            let fast = render(&posed.as_posed(), &view).unwrap().image;
            let plain = draw(&posed.as_posed(), &view, Cutoffs::STOCK).unwrap().image;
            let psnr = psnr(&fast, &plain);
            // A pixel whose alpha is within rounding of a cut-off may fall on either side.
            assert!(psnr > 75.0, "{psnr} dB");
        }
    }

    #[test]
    fn every_cutoff_changes_the_image_and_the_exact_image_has_none() {
        let (gaussians, camera) = scene();
        let posed = OwnedPosed::from_static(&gaussians);
        let grey = View::new(&camera).over([0.5; 3]);
        let exact = draw(&posed.as_posed(), &grey, Cutoffs::NONE).unwrap();
        let with = |cutoffs| psnr(&draw(&posed.as_posed(), &grey, cutoffs).unwrap().image, &exact.image);
        let alpha = with(Cutoffs { alpha: 1.0 / 255.0, ..Cutoffs::NONE });
        assert!(alpha.is_finite() && with(Cutoffs { alpha: 0.05, ..Cutoffs::NONE }) < alpha);
        assert!(with(Cutoffs { three_sigma: true, ..Cutoffs::NONE }).is_finite());
        let antialiased = draw(&posed.as_posed(), &grey.antialiased(true), Cutoffs::NONE).unwrap();
        assert!(psnr(&antialiased.image, &exact.image).is_finite());
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
        let drawn = draw(&OwnedPosed::from_static(&gaussians).as_posed(), &View::new(&camera), Cutoffs::NONE)
            .unwrap();
        let sum: f64 = drawn.image.pixels().iter().map(|p| f64::from(p[0])).sum();
        let shares: f64 = drawn.contributions.iter().sum();
        assert!((sum - shares).abs() < 1e-5 * sum, "{sum} {shares}");
    }
}
