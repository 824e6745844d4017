//! Derivatives of the image, and those of the original kernels.

use super::accumulator::MAX_ALPHA;

/// Which derivatives [`Renderer::backward`](super::Renderer::backward) computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Derivatives {
    /// Those of the image as it is drawn. Whether a splat is drawn at a pixel at all (culling, alpha of 1/255, the least
    /// transmittance) and the order of splats have none.
    #[default]
    Exact,
    /// Those that the original 3DGS CUDA kernels computed (Kerbl et al. 2023), with their deviations:
    /// - the cap of alpha at 0.99 passes derivatives as if it were not there;
    /// - the squared determinant of the screen covariance is enlarged by 1e-7;
    /// - beyond the Jacobian's limit, its change with depth is taken for what it is within;
    /// - the derivative of the antialiasing factor is evaluated at the low-passed covariance.
    OriginalKernels,
}

impl Derivatives {
    /// Uncapped alphas above this pass no derivative on.
    pub(super) fn greatest_alpha(self) -> f32 {
        match self {
            Self::Exact => MAX_ALPHA,
            Self::OriginalKernels => f32::INFINITY,
        }
    }
}
