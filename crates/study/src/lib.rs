#![doc = include_str!("../README.md")]
//!
//! Sweeps as data: [`trade`] measures what every choice costs and how far it is from the exact answer, [`stress`] where each
//! breaks.
#![cfg_attr(test, expect(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod stress;
pub mod trade;
