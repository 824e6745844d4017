#![doc = include_str!("../README.md")]
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod aggregate;
pub mod error;
pub mod lpips;
pub mod metric;
pub mod motion;
pub mod planes;
pub mod protocol;
pub mod psnr;
pub mod region;
pub mod score;
pub mod ssim;
pub mod truth;
pub mod variants;

pub use aggregate::{Aggregation, Summary};
pub use error::MetricsError;
pub use lpips::{InputRange, LpipsNet, LpipsVariant, PerceptualDistance};
pub use metric::{
    AvatarStats, FrameInput, METRICS, Measure, Measured, Metric, MetricId, OverFrames, ROTATION_JUMP_DEGREES,
    Values,
};
pub use motion::Before;
pub use planes::Planes;
pub use protocol::{Background, Clamp, PROTOCOLS, Protocol, ProtocolId, Quantisation};
pub use psnr::{ErrorSums, PsnrVariant};
pub use region::Region;
pub use score::{FrameScore, Prepared, Wanted};
pub use ssim::{SsimSettings, SsimVariant, ssim};
pub use truth::Truth;
pub use variants::{VARIANT_IDS, all_variants};

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 3;
