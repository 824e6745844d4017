//! Executing a plan and keeping what comes out.
//!
//! [`Library`] holds the data at hand, `avatars` makes or reads what is to be drawn, a
//! [`Drawable`](drawable::Drawable); `frame` is where one is drawn in a pose and scored. [`execute()`] walks the frames,
//! [`store`] remembers every record by its content key, [`merge`] collects those of several machines, [`gallery`] shows where the variants differ, [`motion`]
//! draws them in poses that no frame has.
//!
//! Each file imports only from those before it in this list: `textured`, `foreign`, `drawable`, `library`, `frame`,
//! `looks`, `before`, `held_out`, `cache`, `refined_poses`, `fitting`, `curve_frames`, `avatars`, `sizes`, `execute`, `costs`, `gallery`, `pictures`, `motion`.

mod avatars;
mod before;
pub mod cache;
pub mod costs;
mod curve_frames;
pub mod curves;
pub mod drawable;
mod error;
mod execute;
#[cfg(feature = "faults")]
pub mod faults;
pub mod fitting;
pub mod foreign;
mod frame;
pub mod gallery;
pub mod held_out;
mod library;
mod looks;
mod machine;
pub mod merge;
pub mod motion;
pub mod pictures;
pub mod plan_file;
pub mod provenance;
mod refined_poses;
pub mod renders;
mod sizes;
pub mod store;
pub mod textured;

pub use error::Error;
pub use execute::{Event, check, execute};
pub use library::{Library, LoadedDataset, RegisteredAvatar, subject_notes};
pub use machine::Machine;
