//! Versions of the code that numbers depend on.

use serde::{Deserialize, Serialize};

/// Versions of the code that numbers depend on. They are part of every key, so raising one makes a run redo what it
/// influences. Raise one by hand, with a line in CHANGELOG.md, whenever a change moves numbers by more than rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeVersions {
    /// Avatars made from frames, and the loading of those frames.
    pub fit: u32,
    /// Posing.
    pub strategy: u32,
    /// Splatting and triangle rasterizer.
    pub render: u32,
    /// Metrics.
    pub metrics: u32,
}

impl CodeVersions {
    /// The versions of this build.
    pub const CURRENT: Self = Self {
        fit: skinsplat_fit::CODE_VERSION,
        strategy: skinsplat_posing::CODE_VERSION,
        render: skinsplat_render::CODE_VERSION,
        metrics: skinsplat_metrics::CODE_VERSION,
    };
}
