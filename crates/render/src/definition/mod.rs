//! The definition of the 3DGS image, in `f64`, pixel by pixel and splat by splat, with nothing clever: what the renderer
//! is held against, here and in its tests. [`draw`] also does without any of the cut-offs: the exact image, and what each
//! cut-off alone costs and saves.

mod project;
mod tiled;

pub use tiled::{Drawn, draw};

use crate::View;
use glam::DVec3;
use project::{Splat, sorted, splats};
use skinsplat_core::scene::{Posed, SceneError, Underlay};

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

/// One of the things that a pixel blends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blended {
    /// A Gaussian, by its index.
    Gaussian(usize),
    /// The view's underlay.
    Underlay,
}

/// Colour over the background, alpha and depth of every pixel, row by row.
///
/// # Errors
/// As [`crate::splat::Renderer::render`].
pub fn render(posed: &Posed, view: &View) -> Result<Vec<[f64; 5]>, SceneError> {
    render_selected(posed, view, &selected(posed, view)?)
}

/// What every pixel blends, front to back.
///
/// # Errors
/// As [`crate::splat::Renderer::render`].
pub fn selected(posed: &Posed, view: &View) -> Result<Vec<Vec<Blended>>, SceneError> {
    view.check(posed)?;
    let splats = sorted(posed, view, Cutoffs::STOCK);
    let of_pixel = |pixel| {
        let mut blended = Vec::new();
        walk(&splats, pixel, underlay_at(view, pixel), Cutoffs::STOCK, |step, _| {
            blended.push(match step {
                Step::Splat(k) => Blended::Gaussian(splats[k].gaussian),
                Step::Underlay(_) => Blended::Underlay,
            });
        });
        blended
    };
    Ok(pixels(view).map(of_pixel).collect())
}

/// [`render`] with every pixel blending what it is told to: smooth in all parameters.
///
/// # Errors
/// As [`crate::splat::Renderer::render`].
pub fn render_selected(
    posed: &Posed,
    view: &View,
    selected: &[Vec<Blended>],
) -> Result<Vec<[f64; 5]>, SceneError> {
    view.check(posed)?;
    let splats = splats(posed, view, Cutoffs::STOCK);
    let background = DVec3::from_array(view.background.map(f64::from));
    let of_pixel = |(pixel, blended): ([usize; 2], &Vec<Blended>)| {
        let parts = blended.iter().filter_map(|blended| match blended {
            Blended::Gaussian(i) => {
                splats[*i].as_ref().map(|splat| (splat.colour, splat.alpha(pixel), splat.depth))
            }
            Blended::Underlay => underlay_at(view, pixel).map(|own| (own.colour, own.coverage, own.depth)),
        });
        blend(parts, background)
    };
    Ok(std::iter::zip(pixels(view), selected).map(of_pixel).collect())
}

fn pixels(view: &View) -> impl Iterator<Item = [usize; 2]> + use<> {
    let [width, height] = view.size();
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

/// What a pixel shows of an underlay.
#[derive(Clone, Copy)]
struct UnderlayPixel {
    colour: DVec3,
    coverage: f64,
    /// Gaussians at it or beyond lie behind.
    depth: f64,
}

/// `None` where nothing is covered.
fn underlay_at(view: &View, [x, y]: [usize; 2]) -> Option<UnderlayPixel> {
    let Underlay { colour, coverage, depth } = view.underlay?;
    let (colour, coverage) = (colour.at(x, y).map(f64::from), f64::from(coverage.at(x, y)));
    // The lesser of a NaN and a number is the number.
    let depth = f64::from(depth.at(x, y).min(f32::MAX));
    (coverage > 0.0).then_some(UnderlayPixel { colour: DVec3::from_array(colour), coverage, depth })
}

/// One of the things that a walk meets.
enum Step {
    /// Position in the sequence.
    Splat(usize),
    Underlay(UnderlayPixel),
}

/// Visits what a pixel blends, front to back, each with its alpha times the transmittance before it. An underlay is blended
/// before the first splat that does not lie in front of it, or at the end, however little light is left; splats are not.
fn walk<'a>(
    splats: impl IntoIterator<Item = &'a Splat>,
    pixel: [usize; 2],
    mut underlay: Option<UnderlayPixel>,
    cutoffs: Cutoffs,
    mut visit: impl FnMut(Step, f64),
) {
    let mut transmittance = 1.0;
    for (k, splat) in splats.into_iter().enumerate() {
        if let Some(passed) = underlay.take_if(|own| splat.depth as f32 >= own.depth as f32) {
            visit(Step::Underlay(passed), passed.coverage * transmittance);
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
        visit(Step::Splat(k), alpha * transmittance);
        transmittance = after;
    }
    if let Some(left) = underlay {
        visit(Step::Underlay(left), left.coverage * transmittance);
    }
}

/// Parts with their colour, alpha and depth, front to back, over a background.
fn blend(parts: impl Iterator<Item = (DVec3, f64, f64)>, background: DVec3) -> [f64; 5] {
    let (mut transmittance, mut colour, mut depth) = (1.0, DVec3::ZERO, 0.0);
    for (own, alpha, z) in parts {
        colour += own * (alpha * transmittance);
        depth += z * alpha * transmittance;
        transmittance *= 1.0 - alpha;
    }
    let colour = colour + background * transmittance;
    [colour.x, colour.y, colour.z, 1.0 - transmittance, depth]
}
