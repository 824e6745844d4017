//! Executing a plan and keeping what comes out.

pub mod store;
