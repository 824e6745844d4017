//! Executing a plan and keeping what comes out.
//!
//! [`Library`] holds the data at hand, [`avatars`] makes what is to be posed, [`execute()`] walks the frames, [`store`]
//! remembers every record by its content key, [`gallery`] shows where the variants differ.

pub mod avatars;
mod curve_frames;
pub mod curves;
mod error;
mod execute;
pub mod fitting;
mod frame;
pub mod gallery;
pub mod held_out;
mod library;
pub mod provenance;
pub mod store;
pub mod textured;

pub use error::Error;
pub use execute::{Event, execute};
pub use library::{Library, LoadedDataset};
