//! The definition of the 3DGS image, in `f64`, pixel by pixel and splat by splat, with nothing clever: what the renderer
//! is held against, here and in its tests. [`draw`] also does without any of the cut-offs: the exact image, and what each
//! cut-off alone costs and saves.

mod project;
mod tiled;

pub use tiled::{Drawn, draw};

use crate::splat::RenderSettings;
use glam::DVec3;
use project::{Splat, sorted, splats};
use skinsplat_core::scene::{Camera, Posed};

/// What is skipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutoffs {
    /// Alpha below this is not blended (3DGS: 1/255). Above 0.
    pub alpha: f64,
    /// A splat that would leave less transmittance than this ends its pixel (3DGS: 1e-4).
    pub transmittance: f64,
    /// Splats end with the tiles that three standard deviations of their longer axis touch.
    pub three_sigma: bool,
}

impl Cutoffs {
    /// Nothing that could be seen is skipped: 2,000 splats of this alpha on one pixel change less than half a step of an
    /// 8-bit image by a factor of 1000.
    pub const NONE: Self = Self { alpha: 1e-9, transmittance: 0.0, three_sigma: false };
    /// As 3DGS.
    pub const STOCK: Self = Self { alpha: 1.0 / 255.0, transmittance: 1e-4, three_sigma: true };
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
    let splats = sorted(posed, camera, settings, Cutoffs::STOCK);
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
    let splats = splats(posed, camera, settings, Cutoffs::STOCK);
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

/// Colour over the background, alpha and depth of every pixel, row by row.
pub fn render(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Vec<[f64; 5]> {
    render_chosen(posed, camera, settings, &chosen(posed, camera, settings))
}

/// The Gaussians that every pixel blends, front to back.
pub fn chosen(posed: &Posed, camera: &Camera, settings: &RenderSettings) -> Vec<Vec<usize>> {
    let splats = sorted(posed, camera, settings, Cutoffs::STOCK);
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
    let splats = splats(posed, camera, settings, Cutoffs::STOCK);
    let background = DVec3::from_array(settings.background.map(f64::from));
    std::iter::zip(pixels(camera), chosen)
        .map(|(pixel, chosen)| blend(chosen.iter().filter_map(|&i| splats[i].as_ref()), pixel, background))
        .collect()
}

fn pixels(camera: &Camera) -> impl Iterator<Item = [usize; 2]> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

fn part(splats: &[Splat], pixel: [usize; 2], pane: &Pane) -> Parted {
    let mut parted = Parted { chosen: Vec::new(), front: 0 };
    let front =
        walk(splats.iter(), pixel, Some(pane), Cutoffs::STOCK, |k, _| parted.chosen.push(splats[k].gaussian));
    Parted { front, ..parted }
}

/// Visits the splats that a pixel blends, front to back: position in the sequence, and alpha times the transmittance
/// before it, in which a pane counts as it is passed. Returns how many lie in front of the pane.
fn walk<'a>(
    splats: impl Iterator<Item = &'a Splat>,
    pixel: [usize; 2],
    mut pane: Option<&Pane>,
    cutoffs: Cutoffs,
    mut visit: impl FnMut(usize, f64),
) -> usize {
    let (mut transmittance, mut visited, mut front) = (1.0, 0, None);
    for (k, splat) in splats.enumerate() {
        if let Some(passed) = pane.take_if(|pane| splat.depth as f32 >= pane.depth as f32) {
            front = Some(visited);
            transmittance *= 1.0 - passed.coverage;
            if transmittance < cutoffs.transmittance {
                break;
            }
        }
        let Some(alpha) = splat.visible_alpha(pixel).filter(|alpha| *alpha >= cutoffs.alpha) else {
            continue;
        };
        let after = transmittance * (1.0 - alpha);
        if after < cutoffs.transmittance {
            break;
        }
        visit(k, alpha * transmittance);
        visited += 1;
        transmittance = after;
    }
    front.unwrap_or(visited)
}

fn blend<'a>(splats: impl Iterator<Item = &'a Splat>, pixel: [usize; 2], background: DVec3) -> [f64; 5] {
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
