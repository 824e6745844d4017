#![doc = include_str!("../README.md")]

mod chart;
mod page;
mod scale;
mod table;
mod ticks;
mod viewer;

pub use chart::{Chart, Kind, Point, Series};
pub use page::{Page, Part, Section};
pub use scale::Scale;
pub use viewer::{Frame, Picture, View, Viewer};
