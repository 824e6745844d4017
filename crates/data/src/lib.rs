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
//! | [`avatar`] | avatars whoever made them: tells the formats apart; the npz of Gaussians, torch and HAHA checkpoints |
//! | [`ply`] | 3DGS avatars, with their binding in extra properties |
//! | [`splatting_avatar`] | avatars that SplattingAvatar exports |
//! | [`body`], [`gltf`] | SMPL, SMPL-H, SMPL-X and their like as `.npz` or `.pkl`, skinned glTF 2.0 |
//! | [`poses`] | poses and motions: SMPL-style `.npz`, `.pkl` and JSON, AMASS, AIST++, glTF clips |
//! | [`camera`] | camera JSON, `transforms.json` (also nerfstudio's), `cameras.json` of 3DGS, `cameras.npz` |
//! | [`frames`] | PNG, JPEG and `.npy` images and masks |
//! | [`masks`] | what the values of masks mean |
//! | [`npy`], [`npz`], [`pickle`], [`arrays`] | NumPy arrays; Python pickles of them, nothing executed |
//! | [`hdf5`] | arrays of HDF5 files |
//! | [`torch`] | tensors of torch checkpoints |
//! | [`folder`] | a subject as a folder of sequences |
//! | [`layouts`] | data sets as others store them: NeuMan, PeopleSnapshot, GalaBasketball, X-Humans |
//! | [`sequence`] | posed frames with their cameras, decoded when asked for |
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod arrays;
pub mod atomic;
pub mod avatar;
pub mod body;
pub mod camera;
mod capture;
pub mod depth;
mod digest;
pub mod entries;
pub mod error;
pub mod folder;
pub mod frames;
pub mod gltf;
pub mod hdf5;
mod image_size;
mod jpeg_scan;
pub mod key;
pub mod layouts;
pub mod listing;
pub mod masks;
mod models;
pub mod npy;
pub mod npz;
pub mod pickle;
pub mod ply;
pub mod pose_noise;
pub mod poses;
mod reduce;
pub mod select;
pub mod sequence;
mod shapes;
pub mod source;
mod sourced;
pub mod splatting_avatar;
pub mod torch;
pub mod words;

pub use capture::Capture;
pub use error::Error;
pub use folder::Subject;
pub use masks::{MaskFile, MaskReading};
pub use models::{Doubt, Doubtful, Gender, ShapeFit};
pub use sequence::{FrameFiles, FrameGenerator, FrameRef, FrameSource, Sequence, Truth};
pub use sourced::{SourceDigest, Sourced};
