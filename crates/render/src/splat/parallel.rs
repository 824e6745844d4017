//! How work is shared out. Nothing here changes the image.

use std::sync::{Mutex, PoisonError};

/// Memory that the work of one thread reuses, by thread.
#[derive(Debug)]
pub(super) struct PerThread<S>(Vec<Mutex<S>>);

impl<S> Default for PerThread<S> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<S: Default> PerThread<S> {
    /// As many as the current pool has threads.
    pub(super) fn fit_pool(&mut self) {
        self.0.resize_with(rayon::current_num_threads(), Mutex::default);
    }

    /// Visits every thread's, one after the other.
    pub(super) fn for_each(&self, mut visit: impl FnMut(&mut S)) {
        self.0.iter().for_each(|own| visit(&mut own.lock().unwrap_or_else(PoisonError::into_inner)));
    }

    /// Runs `work` with this thread's.
    pub(super) fn with(&self, work: impl FnOnce(&mut S)) {
        let thread = rayon::current_thread_index().unwrap_or(0) % self.0.len();
        work(&mut self.0[thread].lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Gaussians per chunk: enough chunks to share out, few enough to gather from.
pub(super) fn chunk_length(count: usize) -> usize {
    (count / 64).clamp(256, 16384).next_multiple_of(16)
}
