#![doc = include_str!("../README.md")]
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod definition;
pub mod mesh;
pub mod splat;
mod view;

pub use view::View;

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 2;
