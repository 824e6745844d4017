//! Every format, by name.

use super::{Table, csv, json, latex, markdown, text};

/// A format that tables are written in.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// What a user calls it.
    pub id: &'static str,
    /// Of files, without the point.
    pub extension: &'static str,
    /// What it is for.
    pub about: &'static str,
    /// Writes a table: a pure function.
    pub write: fn(&Table) -> String,
}

/// The formats. Another one is a file with a function and a line here.
pub const FORMATS: &[Format] = &[
    Format { id: "text", extension: "txt", about: "Columns that line up in a terminal", write: text },
    Format { id: "markdown", extension: "md", about: "GitHub-flavoured Markdown", write: markdown },
    Format { id: "csv", extension: "csv", about: "A line per row, numbers in full precision", write: csv },
    Format { id: "json", extension: "json", about: "The whole value, typed", write: json },
    Format { id: "latex", extension: "tex", about: "LaTeX, for booktabs", write: latex },
];

impl Format {
    /// The format of this name.
    pub fn named(id: &str) -> Option<&'static Self> {
        FORMATS.iter().find(|format| format.id == id)
    }
}
