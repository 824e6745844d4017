//! The definition of the 3DGS image, in `f64`, pixel by pixel and splat by splat, with nothing clever: what the renderer
//! is held against, here and in its tests.

use crate::render::splat::RenderSettings;
use crate::scene::{Camera, ColourClamp, Posed};
use glam::{DMat2, DMat3, DVec2, DVec3};

struct Splat {
    /// Of its Gaussian.
    index: usize,
    depth: f64,
    mean: DVec2,
    conic: DMat2,
    opacity: f64,
    colour: DVec3,
    /// Pixels within the tile rectangle: x from, x to, y from, y to.
    pixels: [f64; 4],
}

/// What a pixel shows besides Gaussians.
#[derive(Clone, Copy)]
pub struct Pane {
    /// Linear order R, G, B.
    pub colour: DVec3,
    /// Its alpha.
    pub coverage: f64,
    /// Camera depth, metres: Gaussians at it or beyond lie behind.
    pub depth: f64,
}

/// The Gaussians that a pixel blends, front to back, and how many of them lie in front of its pane.
#[derive(Clone, Debug, PartialEq)]
pub struct Parted {
    /// Indices of Gaussians.
    pub chosen: Vec<usize>,
    /// So many of them lie in front.
    pub front: usize,
}

/// [`chosen`] with a pane in every pixel.
pub fn parted(posed: &Posed, camera: &Camera, settings: &RenderSettings, panes: &[Pane]) -> Vec<Parted> {
    let splats = sorted(posed, camera, settings);
    std::iter::zip(pixels(camera), panes).map(|(pixel, pane)| part(&splats, pixel, pane)).collect()
}

/// [`render_chosen`] with a pane in every pixel.
pub fn render_parted(
    posed: &Posed,
    camera: &Camera,
    settings: &RenderSettings,
    panes: &[Pane],
    parted: &[Parted],
) -> Vec<[f64; 5]> {
    let splats: Vec<Option<Splat>> = (0..posed.len()).map(|i| project(posed, i, camera, settings)).collect();
    let background = DVec3::from_array(settings.background.map(f64::from));
    std::iter::zip(pixels(camera), std::iter::zip(panes, parted))
        .map(|(pixel, (pane, Parted { chosen, front }))| {
            let of = |chosen: &[usize]| -> Vec<&Splat> {
                chosen.iter().filter_map(|&i| splats[i].as_ref()).collect()
            };
            let behind = blend(of(&chosen[*front..]).into_iter(), pixel, background);
            let through = |c: usize, own: f64| own * pane.coverage + behind[c] * (1.0 - pane.coverage);
            let [r, g, b] = [0, 1, 2].map(|c| through(c, pane.colour[c]));
            let (alpha, depth) = (through(3, 1.0), through(4, pane.depth));
            let front = blend(of(&chosen[..*front]).into_iter(), pixel, DVec3::new(r, g, b));
            let left = 1.0 - front[3];
            [front[0], front[1], front[2], front[3] + left * alpha, front[4] + left * depth]
        })
        .collect()
}

/// In drawing order.
fn sorted(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Vec<Splat> {
    let mut splats: Vec<Splat> =
        (0..posed.len()).filter_map(|i| project(posed, i, camera, settings)).collect();
    splats.sort_by(|a, b| (a.depth as f32).total_cmp(&(b.depth as f32)));
    splats
}

/// Colour over the background, alpha and depth of every pixel, row by row.
pub fn render(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Vec<[f64; 5]> {
    render_chosen(posed, camera, settings, &chosen(posed, camera, settings))
}

/// The Gaussians that every pixel blends, front to back.
pub fn chosen(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Vec<Vec<usize>> {
    let splats = sorted(posed, camera, settings);
    let nothing = Pane { colour: DVec3::ZERO, coverage: 0.0, depth: f64::INFINITY };
    pixels(camera).map(|pixel| part(&splats, pixel, &nothing).chosen).collect()
}

/// [`render`] with every pixel blending the Gaussians that it is told to: smooth in all parameters.
pub fn render_chosen(
    posed: &Posed,
    camera: &Camera,
    settings: &RenderSettings,
    chosen: &[Vec<usize>],
) -> Vec<[f64; 5]> {
    let splats: Vec<Option<Splat>> = (0..posed.len()).map(|i| project(posed, i, camera, settings)).collect();
    let background = DVec3::from_array(settings.background.map(f64::from));
    std::iter::zip(pixels(camera), chosen)
        .map(|(pixel, chosen)| blend(chosen.iter().filter_map(|&i| splats[i].as_ref()), pixel, background))
        .collect()
}

fn pixels(camera: &Camera) -> impl Iterator<Item = DVec2> {
    let width = camera.width;
    (0..camera.height).flat_map(move |y| (0..width).map(move |x| DVec2::new(f64::from(x), f64::from(y))))
}

impl Splat {
    fn power(&self, pixel: DVec2) -> f64 {
        let d = self.mean - pixel;
        -0.5 * d.dot(self.conic * d)
    }

    fn alpha(&self, pixel: DVec2) -> f64 {
        (self.opacity * self.power(pixel).exp()).min(0.99)
    }
}

fn part(splats: &[Splat], pixel: DVec2, pane: &Pane) -> Parted {
    let (mut transmittance, mut chosen) = (1.0, Vec::new());
    let mut front = None;
    for splat in splats {
        if front.is_none() && splat.depth as f32 >= pane.depth as f32 {
            front = Some(chosen.len());
            transmittance *= 1.0 - pane.coverage;
            if transmittance < 1e-4 {
                break;
            }
        }
        let [x0, x1, y0, y1] = splat.pixels;
        if pixel.x < x0 || pixel.x >= x1 || pixel.y < y0 || pixel.y >= y1 {
            continue;
        }
        let alpha = splat.alpha(pixel);
        if splat.power(pixel) > 0.0 || alpha < 1.0 / 255.0 {
            continue;
        }
        let after = transmittance * (1.0 - alpha);
        if after < 1e-4 {
            break;
        }
        transmittance = after;
        chosen.push(splat.index);
    }
    Parted { front: front.unwrap_or(chosen.len()), chosen }
}

fn blend<'a>(splats: impl Iterator<Item = &'a Splat>, pixel: DVec2, background: DVec3) -> [f64; 5] {
    let (mut transmittance, mut colour, mut depth) = (1.0, DVec3::ZERO, 0.0);
    for splat in splats {
        let alpha = splat.alpha(pixel);
        colour += splat.colour * (alpha * transmittance);
        depth += splat.depth * alpha * transmittance;
        transmittance *= 1.0 - alpha;
    }
    let colour = colour + background * transmittance;
    [colour.x, colour.y, colour.z, 1.0 - transmittance, depth]
}

fn project(posed: &Posed, i: usize, camera: &Camera, settings: &RenderSettings) -> Option<Splat> {
    let world = posed.means[i].as_dvec3();
    let p = camera.camera_from_world.transform_point3(world);
    // The constant of the original is an f32.
    if p.z <= f64::from(0.2f32) {
        return None;
    }
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let focal = DVec2::new(camera.fx, camera.fy);
    let limit = 1.3 * size / (2.0 * focal);
    let t = DVec2::new(p.x, p.y) / p.z;
    let t = t.clamp(-limit, limit);
    // Rows of the Jacobian.
    let jacobian = [
        DVec3::new(focal.x / p.z, 0.0, -focal.x * t.x / p.z),
        DVec3::new(0.0, focal.y / p.z, -focal.y * t.y / p.z),
    ];
    let factor = DMat3::from_mat4(camera.camera_from_world) * posed.factors[i].as_dmat3();
    let covariance = factor * factor.transpose();
    let entry = |a: usize, b: usize| jacobian[a].dot(covariance * jacobian[b]);
    let bare = DMat2::from_cols_array(&[entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)]);
    let covariance = bare + DMat2::from_diagonal(DVec2::splat(0.3));
    let determinant = covariance.determinant();
    let middle = 0.5 * (covariance.x_axis.x + covariance.y_axis.y);
    let largest = middle + (middle * middle - determinant).max(0.1).sqrt();
    let radius = (3.0 * largest.sqrt()).ceil();

    let centre = DVec2::new(camera.cx, camera.cy);
    let ndc = (2.0 * focal / size * DVec2::new(p.x, p.y) + (2.0 * centre / size - 1.0) * p.z) / (p.z + 1e-7);
    let mean = ((ndc + 1.0) * size - 1.0) / 2.0;
    let tiles = (size / 16.0).ceil();
    let from = ((mean - radius) / 16.0).trunc().clamp(DVec2::ZERO, tiles);
    let to = ((mean + radius + 15.0) / 16.0).trunc().clamp(DVec2::ZERO, tiles);
    let compensation =
        if settings.antialiased { (bare.determinant() / determinant).max(0.000_025).sqrt() } else { 1.0 };
    Some(Splat {
        index: i,
        depth: p.z,
        mean,
        conic: covariance.inverse(),
        opacity: f64::from(posed.opacities[i]) * compensation,
        colour: colour(posed, i, world - camera.position()),
        pixels: [from.x * 16.0, to.x * 16.0, from.y * 16.0, to.y * 16.0],
    })
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
