//! Numerical stability at the extremes: every strategy and solver on inputs that are hard on purpose.
//!
//! Needs no data. Reference answers are computed here: averages in double-double arithmetic (`exact`), images by the
//! definition in `f64`, rotations about one axis in closed form. Everything is deterministic: the same options give the
//! same bytes, for any number of threads.

mod averages;
mod double_double;
mod exact;
mod method;
mod problem;
mod report;
pub mod table;

pub use report::{Picture, Report};
use table::Findings;

/// A part of the examination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Solvers and projections on hard averages.
    Averages,
}

impl Section {
    /// Every section, in the order of the report.
    pub const ALL: [Self; 1] = [Self::Averages];

    /// Its id.
    pub fn id(self) -> &'static str {
        match self {
            Self::Averages => "averages",
        }
    }
}

/// What a section found, and pictures of the worst.
#[derive(Clone, Debug)]
pub struct Examined {
    /// Numbers.
    pub findings: Findings,
    /// Rendered failures.
    pub pictures: Vec<Picture>,
}

impl From<Findings> for Examined {
    fn from(findings: Findings) -> Self {
        Self { findings, pictures: Vec::new() }
    }
}

/// Examines a section; `quick` takes fewer inputs.
pub fn examine(section: Section, quick: bool) -> Examined {
    match section {
        Section::Averages => averages::run(quick).into(),
    }
}
