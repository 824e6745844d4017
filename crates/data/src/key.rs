//! Content keys: what a number depends on, hashed.

use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt::Write;

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
    sha256_hex(canonical_json(value).as_bytes())
}

/// SHA-256 of bytes, in hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::with_capacity(64), |mut text, byte| {
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
