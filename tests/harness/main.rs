//! The harness: experiment files, plans, the results store, tables.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../support/mod.rs"]
mod support;

mod comparisons;
mod experiments;
mod formats;
mod made_up;
mod metrics;
mod pages;
mod plans;
mod poses;
mod reports;
mod slices;
mod stores;
mod verdicts;
