//! What can stop a measurement.

use crate::{data, fit, metrics, report::plot::PlotError, scene, strategy};

/// Why nothing could be measured. A single sweep that cannot run is a row that says so instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Data that cannot be read.
    #[error(transparent)]
    Data(#[from] data::Error),
    /// An avatar that cannot be made.
    #[error(transparent)]
    Fit(#[from] fit::Error),
    /// An avatar that cannot be posed.
    #[error(transparent)]
    Strategy(#[from] strategy::StrategyError),
    /// A pose or an image that breaks an invariant.
    #[error(transparent)]
    Scene(#[from] scene::SceneError),
    /// An image that cannot be compared.
    #[error(transparent)]
    Metrics(#[from] metrics::MetricsError),
    /// A plot that cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A subject without what the measurement needs.
    #[error("{subject}: {problem}; expected {expected}")]
    Subject {
        /// Its name.
        subject: String,
        /// What is wrong.
        problem: String,
        /// What was expected.
        expected: String,
    },
    /// A pool of one thread that the system refuses.
    #[error("cannot start a thread to measure on: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}
