//! What can stop a measurement.

/// Why nothing could be measured. A single sweep that cannot run is a row that says so instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Data that cannot be read.
    #[error(transparent)]
    Data(#[from] skinsplat_data::Error),
    /// An avatar that cannot be made.
    #[error(transparent)]
    Fit(#[from] skinsplat_fit::Error),
    /// An avatar that cannot be posed.
    #[error(transparent)]
    Strategy(#[from] skinsplat_posing::PosingError),
    /// A pose or an image that breaks an invariant.
    #[error(transparent)]
    Scene(#[from] skinsplat_core::scene::SceneError),
    /// An image that cannot be compared.
    #[error(transparent)]
    Metrics(#[from] skinsplat_metrics::MetricsError),
    /// A plot that cannot be drawn.
    #[error(transparent)]
    Plot(#[from] skinsplat_plot::PlotError),
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
