#![doc = include_str!("../README.md")]
//!
//! Bytes to scene types and back: the only place that knows file formats.
//!
//! Every reader takes a path and returns scene types or one [`Error`] that names the file, the field and what was
//! expected. Nothing is allocated from a count that the file's own length does not back, and every writer writes beside
//! its target and renames ([`atomic`]).
//!
//! | module | formats |
//! |---|---|
//! | [`avatar`] | avatars whoever made them: tells the formats apart |
//! | [`ply`] | 3DGS avatars, with their binding in extra properties |
//! | [`splatting_avatar`] | avatars that SplattingAvatar exports |
//! | [`body`], [`gltf`] | SMPL-style `.npz`, skinned glTF 2.0 |
//! | [`poses`] | SMPL-style `.npz` and JSON, glTF clips |
//! | [`camera`] | camera JSON, `transforms.json`, `cameras.npz` |
//! | [`frames`] | PNG, JPEG and `.npy` images and masks |
//! | [`npy`], [`npz`] | NumPy arrays |
//! | [`folder`] | a subject as a folder of sequences |
//! | [`layouts`] | data sets as others store them: PeopleSnapshot as prepared for InstantAvatar |
//! | [`sequence`] | posed frames with their cameras, decoded when asked for |
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod atomic;
pub mod avatar;
pub mod body;
pub mod camera;
mod capture;
mod digest;
pub mod error;
pub mod folder;
pub mod frames;
pub mod gltf;
pub mod key;
pub mod layouts;
pub mod npy;
pub mod npz;
pub mod ply;
pub mod poses;
mod reduce;
pub mod select;
pub mod sequence;
mod sourced;
pub mod splatting_avatar;

pub use capture::Capture;
pub use error::Error;
pub use folder::Subject;
pub use sequence::{FrameGenerator, FrameRef, FrameSource, Sequence, Truth};
pub use sourced::{SourceDigest, Sourced};
