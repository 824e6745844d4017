//! How data sets are stored: a layout is a file here and a line in [`LAYOUTS`].

mod peoplesnapshot;

use super::Error;
use super::folder::{Options, Subject};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A layout that is read from files.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// What registries call it.
    pub id: &'static str,
    /// What lies where, in a line.
    pub summary: &'static str,
    /// Reads a subject; no image is decoded.
    pub load: fn(&Request<'_>) -> Result<Subject, Error>,
}

/// What a reader is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The folder of the subject.
    pub folder: &'a Path,
    /// Which frames are for what, where the registry says so.
    pub split: Option<&'a Split>,
    /// How the subject is loaded.
    pub options: &'a Options,
}

/// The layouts. Another one is a file with a function and a line here.
pub const LAYOUTS: &[Layout] = &[
    Layout {
        id: "folder",
        summary: "sequences train* and test*, each with transforms.json, or cameras.npz and poses.npz",
        load: |request| Subject::load(request.folder, request.options),
    },
    peoplesnapshot::LAYOUT,
];

impl Layout {
    /// The layout of this id.
    pub fn named(id: &str) -> Option<&'static Self> {
        LAYOUTS.iter().find(|layout| layout.id == id)
    }
}

/// Which video frames are trained on and which are held out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// First frame, last frame (inclusive), step.
    pub train: [usize; 3],
    /// First frame, last frame (inclusive), step.
    pub test: [usize; 3],
}

impl Request<'_> {
    /// The split of a layout that does not bring its own.
    ///
    /// # Errors
    /// If the registry has none for the subject.
    pub fn required_split(&self) -> Result<&Split, Error> {
        let name = self.folder.file_name().unwrap_or_default().to_string_lossy();
        let expected = "splits.<subject> = { train = [first, last, step], test = ... }";
        self.split.ok_or_else(|| Error::invalid(self.folder, format!("splits.{name}"), "missing", expected))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layout_has_an_id_of_its_own() {
        let mut ids: Vec<&str> = LAYOUTS.iter().map(|layout| layout.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), LAYOUTS.len());
        assert!(ids.iter().all(|id| Layout::named(id).is_some_and(|layout| layout.id == *id)));
    }
}
