//! Parts of a sequence that know from what they were computed.
//!
//! A pose file stores angles, and what an evaluation poses with are quaternions: sines of these angles, rounded. A content
//! key must not depend on how a sine is rounded, so the poses carry the digest of what the file stores.

use super::digest::{Content, Fingerprint};
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

/// SHA-256 of the numbers or parameters that something was computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceDigest(pub(super) [u8; 32]);

impl SourceDigest {
    /// Of bytes: a file, or a text that names every parameter of a generator.
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Fingerprint::new().bytes(bytes).finish()
    }

    /// Of something that was computed from this and one more number.
    pub(super) fn and(self, number: u64) -> Self {
        Fingerprint::new().bytes(&self.0).number(number).finish()
    }
}

impl fmt::Display for SourceDigest {
    /// In hexadecimal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A value and, where the value is not what is stored itself, the digest of what it was computed from. It cannot be changed
/// in place: another value is another [`Sourced`], made by `from`, whose own numbers count.
#[derive(Clone, Debug, PartialEq)]
pub struct Sourced<T> {
    value: Arc<T>,
    source: Option<SourceDigest>,
}

impl<T> Sourced<T> {
    /// A value that is a function of what `source` is the digest of, and of nothing else.
    pub fn computed(value: T, source: SourceDigest) -> Self {
        Self { value: Arc::new(value), source: Some(source) }
    }

    /// The value made from this one and a number.
    pub(super) fn derived(&self, value: T, number: u64) -> Self {
        Self { value: Arc::new(value), source: self.source.map(|source| source.and(number)) }
    }
}

impl<T: Content> Sourced<T> {
    /// The digest of what the value was computed from; of its own numbers if they are what is stored.
    pub fn digest(&self) -> SourceDigest {
        self.source.unwrap_or_else(|| {
            let mut hash = Fingerprint::new();
            self.value.add_to(&mut hash);
            hash.finish()
        })
    }
}

impl<T> From<T> for Sourced<T> {
    /// A value whose numbers are those that are stored.
    fn from(value: T) -> Self {
        Self { value: Arc::new(value), source: None }
    }
}

impl<T> Deref for Sourced<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}
