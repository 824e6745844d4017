//! Paths in documents: what is no Unicode in them is replaced by U+FFFD, since no key and no number depends on a path.

use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One path.
pub(super) fn path<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Paths by name.
pub(super) fn paths<S: Serializer>(
    paths: &BTreeMap<String, PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let shown: BTreeMap<&String, String> =
        paths.iter().map(|(name, path)| (name, path.to_string_lossy().into_owned())).collect();
    shown.serialize(serializer)
}
