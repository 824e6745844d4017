#![doc = include_str!("../README.md")]

mod pack;
mod page;

pub use pack::{Motion, ViewError};
pub use page::{Page, Up};
