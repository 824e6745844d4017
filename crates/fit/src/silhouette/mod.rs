//! A differentiable silhouette: how well a drawn mesh covers a mask, and how that changes when its vertices move.
//!
//! The silhouette is the area that the mesh covers of each pixel: a box filter over an indicator function, optionally
//! smoothed further by a Gaussian ([`Blur`]) that is applied to the mask alike. Only its outline moves it. By the
//! transport theorem, the derivative of `L(coverage)` is
//!
//! ```text
//! dL = ∫ over the outline of (dL / dcoverage at the point) (outward normal · velocity of the point) ds
//! ```
//!
//! exactly, and nothing but the outline has to be visited. This is what is computed ([`outline`]): the outline is made of
//! pieces of mesh edges whose faces all lie on one side in the image, the pieces that nothing else covers. The
//! alternative, a sigmoid of the distance to each triangle (SoftRas) or to the nearest outline edge, blurs the
//! silhouette in a way that depends on the mesh, costs a search per pixel, and pulls only within its band; here the pull
//! of a misplaced outline depends on which side of the mask's it lies and not on how far away.
//!
//! | file | subject |
//! |---|---|
//! | `topology` | edges of a mesh and the faces beside them |
//! | `coverage` | which samples a projected mesh covers |
//! | `blur` | the Gaussian filter, its own adjoint |
//! | `overlap` | intersection over union of two soft masks |
//! | `outline` | from derivatives by coverage to derivatives by projected vertices |

mod blur;
mod coverage;
mod outline;
mod overlap;
mod topology;

pub(super) use blur::Blur;
pub(super) use topology::Topology;

use coverage::Coverage;
use glam::DVec2;

/// A rectangle of pixels of an image; nothing outside of it is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Window {
    pub(super) fn area(self) -> usize {
        self.width * self.height
    }

    fn corner(self) -> DVec2 {
        DVec2::new(self.left as f64, self.top as f64)
    }
}

/// How well a mesh covers a mask.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Match {
    /// Soft intersection over union of the filtered silhouette and the filtered mask, at most one; see [`overlap`].
    pub(super) iou: f64,
    /// Its derivative by every projected vertex, per pixel.
    pub(super) gradient: Vec<DVec2>,
}

/// Compares the silhouette of projected vertices (pixels; NaN for those that have no projection, whose faces are left
/// out) with a mask: one value per pixel of the window, already filtered by `blur`.
pub(super) fn compare(
    topology: &Topology,
    points: &[DVec2],
    window: Window,
    mask: &[f32],
    blur: &Blur,
) -> Match {
    let coverage = Coverage::of(points, topology, window);
    let mut soft = coverage.fractions();
    blur.apply(&mut soft, window.width);
    let (iou, mut gradient) = overlap::overlap(&soft, mask);
    // the filter is symmetric: its own adjoint
    blur.apply(&mut gradient, window.width);
    Match { iou, gradient: outline::pulled_back(topology, points, &coverage, &gradient) }
}

/// How much of a mask the silhouette of projected vertices covers, pixels. Arguments as [`compare`].
pub(super) fn common_area(topology: &Topology, points: &[DVec2], window: Window, mask: &[f32]) -> f64 {
    let coverage = Coverage::of(points, topology, window).fractions();
    coverage.iter().zip(mask).map(|(c, &m)| c * f64::from(m)).sum()
}
