//! The splatting rasterizer: Gaussians to an image with the semantics of the original 3DGS CUDA rasterizer (Kerbl et
//! al. 2023), so that an avatar fitted elsewhere scores the same here.
//!
//! Two parallel phases. First, chunks of Gaussians are projected and coloured and entered into the strips of the image
//! that they reach (`project`, `colour`, `preprocess`, `bin`). Then each strip sorts its splats by depth, finds the 4x4
//! pixel blocks that each can change (`reach`) and blends them block by block with the pixels in registers (`blend`).
//! A pixel is visited only for splats whose ellipse of alpha = 1/255 comes within 4x4 pixels of it, and the result is the
//! same as visiting them all.
//!
//! The image has the same bits for any number of threads and any vector width. So have the derivatives that
//! [`Renderer::backward`] takes back from the pixels to the Gaussians (`backward` and the modules named after it).
//!
//! # Where it departs from the original, on purpose
//! - Principal points may be anywhere; the Jacobian's limit stays `1.3 size / (2 focal)` on both sides of the axis.
//! - Gaussians with a number that is not finite (also after projection), or whose screen covariance has a determinant
//!   below 0 by rounding, are not drawn. (The original drops a determinant of exactly 0 only.)
//! - The screen covariance is the Gram matrix of J W M, which equals J W Σ Wᵀ Jᵀ and rounds better.
//! - Antialiasing follows the original's later version: opacity times `sqrt(max(0.000025, det / det_low_passed))`.

mod accumulator;
mod backward;
mod backward_blend;
mod backward_colour;
mod backward_gaussian;
mod backward_project;
mod backward_strip;
mod bin;
mod blend;
mod colour;
mod derivatives;
mod forward;
#[cfg(test)]
mod gaussians_fixture;
mod grid;
mod lanes;
#[cfg(target_arch = "x86_64")]
mod lanes_x86;
mod layer;
mod parallel;
mod preprocess;
mod profile;
mod project;
mod reach;
mod renderer;
mod strip;
mod wide;

pub use derivatives::Derivatives;
pub use profile::{Phase, PhaseTimes};
pub use renderer::{Renderer, render};
pub use skinsplat_simd::Level as SimdLevel;
