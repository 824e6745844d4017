//! The shader on an adapter, through wgpu.

mod adapter;
mod avatar;
mod pipelines;

pub use adapter::{Gpu, GpuError, list};
pub use avatar::Avatar;
pub use pipelines::{Frame, Skinning};
