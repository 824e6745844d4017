//! Numerical stability at the extremes: every strategy and solver on inputs that are hard on purpose.
//!
//! Needs no data. Reference answers are computed here: averages in double-double arithmetic (`exact`), images by the
//! definition in `f64` ([`skinsplat_render::definition`]), frames of faces and rotated SH in `f64`; the body is the built-in arm.
//! Everything is deterministic: the same options give the same bytes, for any number of threads.

mod averages;
mod double_double;
mod exact;
mod faces;
mod method;
mod page;
mod pictures;
mod poses;
mod problem;
mod renderer;
mod report;
mod scales;
mod scenes;
mod sequences;
mod stage;
pub mod table;

pub use page::page;
pub use report::{Picture, Report};

use skinsplat_posing::PosingError;
use table::Findings;

/// A part of the examination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Solvers and projections on hard averages.
    Averages,
    /// Smooth motions through degenerate poses, and the remedy.
    Sequences,
    /// Rotation choices on hard poses.
    Poses,
    /// Frames on bad faces.
    Faces,
    /// Scales, conditions and coefficients.
    Scales,
    /// The splat renderer.
    Renderer,
}

/// What a section found, and pictures of the worst.
#[derive(Clone, Debug)]
pub struct Examined {
    /// Numbers.
    pub findings: Findings,
    /// Rendered failures.
    pub pictures: Vec<Picture>,
}

impl Section {
    /// Every section, in the order of the report.
    pub const ALL: [Self; 6] =
        [Self::Averages, Self::Sequences, Self::Poses, Self::Faces, Self::Scales, Self::Renderer];

    /// Its id.
    pub fn id(self) -> &'static str {
        match self {
            Self::Averages => "averages",
            Self::Sequences => "sequences",
            Self::Poses => "poses",
            Self::Faces => "faces",
            Self::Scales => "scales",
            Self::Renderer => "renderer",
        }
    }

    /// Examines it; `quick` takes fewer inputs.
    ///
    /// # Errors
    /// None that the built-in body does not cause.
    pub fn examine(self, quick: bool) -> Result<Examined, PosingError> {
        let pictures = if self == Self::Sequences { pictures::draw(quick)? } else { Vec::new() };
        let findings = match self {
            Self::Averages => averages::run(quick),
            Self::Sequences => sequences::run(quick)?,
            Self::Poses => poses::run(quick)?,
            Self::Faces => faces::run(),
            Self::Scales => scales::run()?,
            Self::Renderer => renderer::run(quick)?,
        };
        Ok(Examined { findings, pictures })
    }
}
