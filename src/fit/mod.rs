//! Avatars from a body and its training frames. No optimiser yet: what can be gathered from the frames directly.
//!
//! [`surface`] makes Gaussians on the body's surface, [`texture`] a texture for the body's own atlas. Both look at the
//! same thing: where a point of the surface is seen in each frame ([`sighting`]), and which colour explains what was seen
//! there ([`gather`]).

mod disc;
mod error;
mod fill;
mod gather;
mod sighting;
pub mod surface;
mod tessellation;
pub mod texture;

pub use error::Error;
