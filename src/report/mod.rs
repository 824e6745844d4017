//! Records to tables: pure functions, no clock, no file.
//!
//! ```text
//! Plan + Records ─ results() ─► Results ─┬─ to_json()            results.json
//!                                        ├─ page()               tables.md
//!                                        ├─ Table ─ markdown, csv, json, latex
//!                                        └─ compare(baseline)    verdict, frames that moved
//! ```
//!
//! A [`Table`] is the one value that every format prints. Missing frames are counted and named, a metric that was not
//! computed is "n/c" and never 0, and the best value of a sequence is judged on the printed digits.

mod build;
mod captions;
mod collect;
pub mod compare;
mod csv;
mod curves;
mod latex;
mod layout;
mod markdown;
mod page;
mod paper;
mod replicates;
mod results;
pub mod stats;
mod table;

pub use collect::results;
pub use csv::csv;
pub use curves::{curve_plots, curves_csv};
pub use latex::latex;
pub use markdown::markdown;
pub use page::page;
pub use results::{FrameResult, Results, SCHEMA, SequenceResults, TableResults, VariantResults};
pub use table::{Cell, Comparison, Content, MetricDifference, Row, RowKind, Table, TableColumn};

use skinsplat_metrics::MetricsError;

/// Records that do not belong to the plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A planned experiment was not given.
    #[error("experiment `{experiment}` is in the plan; expected it among the experiments of the report")]
    Unplanned {
        /// Its id.
        experiment: String,
    },
    /// Scores that cannot be aggregated.
    #[error("{at}: {source}")]
    Scores {
        /// The experiment, or the sequence and variant.
        at: String,
        /// What is wrong with them.
        source: MetricsError,
    },
}
