//! Paths shared by the integration tests.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use std::path::PathBuf;

pub mod png;

/// A file under `tests/data`.
pub fn data(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(path)
}

/// A reference-value file under `tests/data/fixtures` (same layout as the set it was taken from).
pub fn fixture(path: &str) -> PathBuf {
    data("fixtures").join(path)
}

/// A JSON fixture.
pub fn json(path: &str) -> serde_json::Value {
    let path = fixture(path);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}
