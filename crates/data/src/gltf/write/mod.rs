//! Writing `.glb` files: skinned bodies and their motion, Gaussians.

mod builder;
mod rig;
mod splats;

pub use rig::{Motion, write_body};
pub use splats::{write_skinned_splats, write_splats};
