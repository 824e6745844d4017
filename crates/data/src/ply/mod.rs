//! Avatars as 3DGS PLY files.
//!
//! The standard properties come first, in the standard order (`x y z nx ny nz f_dc_* f_rest_* opacity scale_* rot_*`,
//! `f_rest` channel by channel: all R, all G, all B), so that every splat viewer opens the file. The binding follows in
//! further properties of each vertex, four bytes wide like all others:
//!
//! | binding | properties |
//! |---|---|
//! | vertex | `joint_0 …` (uint) and `weight_0 …` (float), padded with zeros to the longest row |
//! | face | `face` (uint), `bary_0 bary_1 bary_2` (float), `offset` (float, metres along the normal) |
//!
//! Two more kinds of file are told apart by what they hold ([`Dialect`]): SuperSplat's compressed PLY, and iHuman's, whose
//! values are activated.
//!
//! A tool that filters vertices keeps the binding aligned with them. Comments say what the file is; they stand after the
//! properties, since viewers exist that expect `element vertex` in the third line.
//!
//! The parser is our own: `serde-ply` deserialises rows into types that are fixed at compile time (or into a map per
//! row), while the properties of a splat are known only from the header (SH degree, influences, what other tools add). A
//! column here is an offset, which is also no slower.

mod activated;
mod compressed;
mod header;
mod read;
mod rows;
mod write;

pub(crate) use activated::logit;
pub use header::Encoding;
pub use read::{Dialect, Stored, read, read_avatar};
pub use write::{Metadata, write_avatar};

/// Coefficients of `f_rest` for SH degrees 0 to 3.
const REST_COUNTS: [usize; 4] = [0, 9, 24, 45];
