#![doc = include_str!("../README.md")]

mod best;
mod cell;
mod column;
mod csv;
mod digits;
mod escape;
mod formats;
mod json;
mod latex;
pub mod markdown;
mod row;
mod table;
pub mod text;

pub use best::mark_best;
pub use cell::{Cell, Content};
pub use column::{Align, Column, Direction};
pub use csv::{csv, csv_by_cell, text as csv_text};
pub use digits::Digits;
pub use escape::{is_hidden, visible};
pub use formats::{FORMATS, Format};
pub use json::{json, to_json};
pub use latex::latex;
pub use markdown::markdown;
pub use row::{Row, RowKind};
pub use table::{Label, Table};
pub use text::text;
