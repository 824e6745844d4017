//! Speed against accuracy: what every choice that a user can make costs, and how far it is from the exact answer.
//!
//! Everything is measured in one call on one [`Stage`]: an avatar, a body, a realistic motion and one whose joints are
//! turned by nearly 180 degrees, where solvers separate. Every [`Sweep`] is data; [`Sweep::section`] makes the table of
//! it, [`recommend()`] reads the choices for three uses off the rows, by stated rules.
//!
//! All times are of one thread. They, and what is judged by them (the front, the recommendations), are the only things
//! that differ from call to call: errors have the same bits for any number of threads.

mod candidate;
mod clock;
mod error;
mod error_stats;
mod exact;
mod html;
mod motion;
mod page;
mod pareto;
mod picture;
mod recommend;
pub mod savings;
mod section;
mod stage;
mod sweep;

pub use clock::Spread;
pub use error::Error;
pub use error_stats::{Degrees, Fidelity};
pub use html::html;
pub use page::{csv, json, markdown};
pub use pareto::pareto_front;
pub use picture::scatter;
pub use recommend::{Pick, Recommendation, recommend};
pub use section::{Outcome, Sweep, SweepRow, Unit};
pub use stage::{Options, Stage};
pub use sweep::{SWEEPS, measure};

use skinsplat_table::Table;

/// Version of the JSON schema.
pub const SCHEMA: u32 = 2;

/// The result: where it was measured, the sweeps, sections that other modules add, and what follows.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Trade {
    /// Version of the schema.
    pub schema: u32,
    /// Data set and subject.
    pub subject: String,
    /// What the numbers come from. Sentences without full stops.
    pub ran_on: Vec<String>,
    /// The tables, in reading order.
    pub sections: Vec<Table>,
    /// One per use.
    pub recommendations: Vec<Recommendation>,
}

impl Trade {
    /// The result of sweeps on a stage. Further sections may be pushed before it is written.
    pub fn new(stage: &Stage, sweeps: &[Sweep]) -> Self {
        Self {
            schema: SCHEMA,
            subject: stage.name.clone(),
            ran_on: stage.ran_on(),
            sections: sweeps.iter().map(Sweep::section).collect(),
            recommendations: recommend(sweeps),
        }
    }
}
