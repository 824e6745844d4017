//! Protocols and strategies by name: what the layers below call a spec, in full, for the content keys.

use serde_json::{Value, json};

/// A scoring protocol.
pub(super) struct Protocol {
    /// `id@version`.
    pub(super) name: String,
    /// Every choice that it makes.
    pub(super) content: Value,
}

/// The protocol of this id.
///
/// # Errors
/// The ids that are known.
pub(super) fn protocol(id: &str) -> Result<Protocol, String> {
    Ok(Protocol { name: format!("{id}@1"), content: json!({ "id": id, "version": 1 }) })
}

/// The strategy of this spec in full.
///
/// # Errors
/// What a spec looks like.
pub(super) fn strategy(spec: &str) -> Result<Value, String> {
    Ok(Value::String(spec.to_owned()))
}
