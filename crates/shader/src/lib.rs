//! Skinning of Gaussian splats on the GPU: one WGSL source and what naga makes of it (HLSL, GLSL, MSL, SPIR-V).
//!
//! [`SKINNING`] is the source; `translations/` holds the other languages. [`layout`] says what its buffers hold and fills them,
//! [`batch`] holds Gaussians and joints as plain data, [`mod@reference`] computes in `f64` what the shader should answer.
//!
//! Features: `translate` translates the source, `gpu` runs it through wgpu. Without them the crate builds on `skinsplat-core` alone.

pub mod batch;
pub mod cases;
mod choice;
#[cfg(feature = "gpu")]
pub mod errors;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod layout;
pub mod reference;
#[cfg(feature = "gpu")]
pub mod timing;
#[cfg(feature = "translate")]
pub mod translate;

pub use choice::{Colour, Rotation, Shape, entry_points};

/// The source, WGSL.
pub const SKINNING: &str = include_str!("../shaders/skinning.wgsl");

/// The same for WebGL 2, WGSL: a fragment per Gaussian. Comes after [`bindless`].
pub const VIEW: &str = include_str!("../shaders/view.wgsl");

/// [`VIEW`] in GLSL ES 3.00, with the functions that it needs.
pub const VIEW_GLSL: &str = include_str!("../translations/view.frag");

/// The functions of [`SKINNING`] that read no binding.
pub fn bindless() -> &'static str {
    SKINNING.split_once("// ---- Bindings").map_or(SKINNING, |(functions, _)| functions)
}

/// All of the shader for WebGL 2, WGSL.
pub fn view_source() -> String {
    [bindless(), VIEW].concat()
}
