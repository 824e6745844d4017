//! How data sets are stored: a layout is a file here and a line in [`LAYOUTS`].

mod aligned;
mod colmap;
mod contents;
mod distortion;
mod galabasketball;
mod neuman;
mod peoplesnapshot;
mod readers;
mod snapshot_raw;
mod split;
mod surface;
mod unity;
mod video;
mod xhumans;

pub use contents::{Contents, Found, Part, contents, subjects};
pub use readers::{Reader, readers};

use super::folder::{Options, Subject};
use super::{Capture, Error, FrameRef, Sequence, Sourced, listing};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::{Camera, Pose, RestBody};
use std::path::Path;
use std::sync::Arc;

/// A layout that is read from files.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// What registries call it.
    pub id: &'static str,
    /// What lies where, in a line.
    pub summary: &'static str,
    /// What a subject's folder holds.
    pub parts: &'static [Part],
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
        summary: "sequences train*, test* and perhaps val*, each with transforms.json; exact numbers in cameras.npz and poses.npz",
        parts: &[],
        load: |request| Subject::load(request.folder, request.options),
    },
    peoplesnapshot::LAYOUT,
    snapshot_raw::LAYOUT,
    neuman::LAYOUT,
    xhumans::LAYOUT,
    galabasketball::LAYOUT,
];

impl Layout {
    /// The layout of this id.
    pub fn named(id: &str) -> Option<&'static Self> {
        LAYOUTS.iter().find(|layout| layout.id == id)
    }
}

/// Which points in time are trained on and which are held out: frames of the video, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// First frame, last frame (inclusive), step.
    pub train: [usize; 3],
    /// First frame, last frame (inclusive), step.
    pub test: [usize; 3],
}

impl Request<'_> {
    /// A subject of this folder.
    fn subject(
        &self,
        capture: Capture,
        train: Vec<Sequence>,
        test: Vec<Sequence>,
        notes: Vec<String>,
    ) -> Subject {
        Subject {
            id: listing::file_name(self.folder),
            capture,
            train,
            test,
            val: Vec::new(),
            notes,
            doubts: Vec::new(),
            shapes: Vec::new(),
        }
    }
}

/// What the sequences of a subject share.
struct Shared {
    body: Arc<RestBody>,
    poses: Sourced<Vec<Pose>>,
    cameras: Sourced<Vec<Camera>>,
}

impl Shared {
    /// A sequence of these frames.
    fn sequence(&self, id: &str, frames: Vec<FrameRef>) -> Sequence {
        let Self { body, poses, cameras } = self;
        let (body, poses, cameras) = (body.clone(), poses.clone(), cameras.clone());
        Sequence { id: id.to_owned(), body, poses, cameras, frames, stored_sizes: None }
    }
}

/// Triples of a row of numbers.
fn triples(values: &[f64]) -> Vec<DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice).collect()
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
