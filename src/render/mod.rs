//! (layer in construction)
pub mod splat;
