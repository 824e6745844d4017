//! The sums over splats that make a pixel, and the limits that blending keeps.

use super::lanes::Lanes;
use super::wide::Wide;

/// Alpha never exceeds this.
pub(super) const MAX_ALPHA: f32 = 0.99;
/// A splat that would leave less transmittance than this is not blended, and the pixel is done.
pub(super) const LEAST_TRANSMITTANCE: f32 = 1e-4;

/// The sums of sixteen pixels, in registers.
pub(super) struct Accumulator<L: Lanes> {
    pub(super) transmittance: Wide<L>,
    /// The transmittance of pixels that are not done, 0 of those that are.
    pub(super) open: Wide<L>,
    pub(super) colour: [Wide<L>; 3],
    pub(super) depth: Wide<L>,
}
