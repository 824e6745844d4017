#![doc = include_str!("../README.md")]
//!
//! Avatars from a body and its training frames: what can be gathered from the frames directly, and what an optimiser makes
//! of it.
//!
//! [`clothing`] moves the body's surface onto the outlines in the masks, [`surface`] makes Gaussians on it, [`texture`] a
//! texture for the body's own atlas. All three ask the same two questions: where is a point of the surface seen in each
//! frame (`sighting`), and what explains best what was seen there (`gather`). Frames are loaded a few at a time, in
//! order; within a frame every point is independent: the avatar has the same bits for any number of threads.
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

mod adam;
pub mod clothing;
mod disc;
mod error;
mod fill;
mod frame_order;
mod gather;
mod loss;
pub mod options;
pub mod pose_fit;
mod poses;
pub mod recipe;
mod room;
pub mod shape;
mod sighting;
mod silhouette;
pub mod subdivide;
pub mod surface;
mod tessellation;
pub mod texture;
pub mod train;
mod training;

pub use error::Error;
pub use recipe::{FitOptions, RECIPES, Recipe};

/// Version of this code as part of content keys. Raise it by hand, with a line in CHANGELOG.md, whenever a change moves
/// numbers by more than rounding: whoever stored results under the old version computes them anew.
pub const CODE_VERSION: u32 = 5;
