//! Records to tables: pure functions, no clock, no file.
//!
//! ```text
//! Plan + Records ─ results() ─► Results ─┬─ to_json()            results.json
//!                                        ├─ page()               tables.md
//!                                        ├─ Table                one of each format of `skinsplat_table`
//!                                        └─ compare(baseline)    verdicts, frames that moved
//! ```
//!
//! A [`Table`](skinsplat_table::Table) is the one value that every format prints. Missing frames are counted and named, a metric that was not
//! computed is "n/c" and never 0, and bold is the best value of a sequence with everything that is not decided to be worse.

mod bend;
mod best;
mod build;
mod captions;
mod collect;
pub mod compare;
mod comparison;
mod curves;
mod differences;
pub mod html;
mod layout;
mod markdown;
mod page;
mod paper;
mod reading;
mod replicates;
mod results;
pub mod timing;

pub use crate::run::gallery::picture_name;
pub use bend::{bend_csv, bend_plots};
pub use collect::{results, results_of, table_results};
pub use comparison::{Comparison, MetricDifference};
pub use curves::{check_curves, curve_plots, curves_csv};
pub use markdown::markdown;
pub use page::{head, incomplete, page};
pub use results::{
    DataDigests, FrameResult, OLDEST_SCHEMA, Results, SCHEMA, SequenceResults, TableResults, VariantResults,
};

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
