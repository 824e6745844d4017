//! PSNR, SSIM and the place of LPIPS, in the variants that the literature mixes up; [`Protocol`] bundles the choices.
//!
//! The variants differ by more than the gains that papers report, so a number is never without its variant: metrics are
//! named ([`VARIANT_IDS`]), protocols are named and versioned data (`protocols.toml`), and every [`FrameScore`] carries
//! the id of its protocol.
//!
//! Everything is computed in f64 on [`Planes`], in which 8-bit values are exact, with sums in a fixed order: the
//! result is the same bit for bit for any number of threads and any instruction set.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod aggregate;
pub mod error;
pub mod kind;
pub mod lpips;
pub mod planes;
pub mod protocol;
pub mod psnr;
pub mod region;
pub mod score;
pub mod ssim;
pub mod variants;

pub use aggregate::{Aggregation, Summary};
pub use error::MetricsError;
pub use kind::MetricKind;
pub use lpips::{InputRange, LpipsNet, LpipsVariant, PerceptualDistance};
pub use planes::Planes;
pub use protocol::{Background, Clamp, PROTOCOLS, Protocol, ProtocolId, Quantisation};
pub use psnr::{ErrorSums, PsnrVariant};
pub use region::Region;
pub use score::{FrameScore, Truth, Wanted};
pub use ssim::{SsimSettings, SsimVariant, ssim};
pub use variants::{VARIANT_IDS, all_variants};

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 3;
