//! Content keys: what a number depends on, hashed.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// Versions of the code that numbers depend on. They are part of every key, so raising one makes a run redo what it
/// influences. Raise one by hand, with a line in CHANGELOG.md, whenever a change moves numbers by more than rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeVersions {
    /// Avatars made from frames, and the loading of those frames.
    pub fit: u32,
    /// Posing.
    pub strategy: u32,
    /// Splatting and triangle rasterizer.
    pub render: u32,
    /// Metrics.
    pub metrics: u32,
}

impl CodeVersions {
    /// The versions of this build.
    pub const CURRENT: Self = Self { fit: 3, strategy: 2, render: 2, metrics: 2 };
}

/// The value as JSON text that depends on nothing but the value: object keys sorted by their bytes, no white space,
/// numbers in shortest round-trip form.
pub fn canonical_json(value: &impl Serialize) -> String {
    let value = serde_json::to_value(value).expect("keys are strings and every type here serialises");
    let mut text = String::new();
    write_canonical(&value, &mut text);
    text
}

fn write_canonical(value: &Value, text: &mut String) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<(&String, &Value)> = map.iter().collect();
            entries.sort_by_key(|(key, _)| *key);
            text.push('{');
            for (i, (key, value)) in entries.into_iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                let _ = write!(text, "{}:", Value::String(key.clone()));
                write_canonical(value, text);
            }
            text.push('}');
        }
        Value::Array(items) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                write_canonical(item, text);
            }
            text.push(']');
        }
        scalar => {
            let _ = write!(text, "{scalar}");
        }
    }
}

/// SHA-256 of the value's [`canonical_json`], in hexadecimal.
pub fn content_key(value: &impl Serialize) -> String {
    let digest = Sha256::digest(canonical_json(value).as_bytes());
    digest.iter().fold(String::with_capacity(64), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn keys_do_not_depend_on_field_order() {
        let text = r#"{"b":[1,{"z":null,"a":"\""}],"a":0.1}"#;
        let value: Value = serde_json::from_str(text).expect("valid");
        assert_eq!(canonical_json(&value), r#"{"a":0.1,"b":[1,{"a":"\"","z":null}]}"#);
        // sha256sum of the text `{}`
        let empty = "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a";
        assert_eq!(content_key(&json!({})), empty);
    }
}
