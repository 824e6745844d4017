//! Paths shared by the integration tests.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use std::path::{Path, PathBuf};

pub mod png;

/// A file under `tests/data`.
pub fn data(path: &str) -> PathBuf {
    // The tests of every crate of the workspace share the data at its root.
    let mut roots = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|root| root.join("tests/data"));
    roots.find(|data| data.is_dir()).expect("tests run inside the repository").join(path)
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
