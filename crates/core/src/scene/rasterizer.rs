//! Constants of the original 3DGS rasterizer (Kerbl et al. 2023), for whoever draws as it does, or has to know beforehand
//! what it will not draw.

/// Side of the tiles that bound a splat's reach, pixels.
pub const TILE: usize = 16;

/// Gaussians at or in front of this view depth are not drawn, metres.
pub const NEAR: f64 = 0.2;

/// The projection is linearised no further out than this multiple of the half field of view.
pub const JACOBIAN_LIMIT: f64 = 1.3;

/// Variance added to both screen axes, pixels².
pub const LOW_PASS: f64 = 0.3;

/// Least discriminant under the root of the larger eigenvalue of a screen covariance, pixels⁴.
pub const LEAST_DISCRIMINANT: f64 = 0.1;

/// Standard deviations along the longer axis out to which a splat is drawn.
pub const DEVIATIONS: f64 = 3.0;
