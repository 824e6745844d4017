//! What is wrong with a document, where, and what belongs there: in its own words, not in those of the types that it is read into.

use serde::de::DeserializeOwned;
use serde_json::error::Category;
use skinsplat_data::words::Language;

/// Reads a document of JSON; `what` is what it should be.
///
/// # Errors
/// One line: the place, as `tables[0].sequences`, the problem, and what was expected.
pub(super) fn from_json<T: DeserializeOwned>(text: &str, what: &str) -> Result<T, String> {
    if text.trim_start().starts_with('[') {
        // The reader of types would take its items for fields.
        return Err(described("", "invalid type: sequence, expected struct"));
    }
    serde_json::from_str(text).map_err(|error| match error.classify() {
        Category::Data => described(&place(text, error.line(), error.column()), &error.to_string()),
        _ => format!("no JSON: {error}; expected {what}"),
    })
}

/// The message of a reader of types in the words of JSON.
fn described(place: &str, message: &str) -> String {
    // The place says it better.
    let message = message.rsplit_once(" at line ").map_or(message, |(message, _)| message);
    let (problem, expected) = Language::Json.told(message);
    let expected = match expected {
        None if problem.starts_with("missing field") => "it, as reports/SCHEMA.md says".to_owned(),
        None => "what reports/SCHEMA.md says".to_owned(),
        Some(known) => format!("{known}, as reports/SCHEMA.md says"),
    };
    let place = if place.is_empty() { String::new() } else { format!("{place}: ") };
    format!("{place}{problem}; expected {expected}")
}

/// A list or an object that a place lies in.
enum Within {
    List(usize),
    Object(String),
}

/// The value that ends or begins at a position of a text of JSON (line from 1, bytes of it that were read): as keys and indices.
fn place(text: &str, line: usize, column: usize) -> String {
    let before: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let bytes = &text.as_bytes()[..text.len().min(before + column)];
    let mut within: Vec<Within> = Vec::new();
    let mut found = String::new();
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'"' => {
                let end = end_of_string(bytes, at);
                let is_key = matches!(text.as_bytes()[end..].trim_ascii_start().first(), Some(b':'));
                if let (true, Some(Within::Object(key))) = (is_key, within.last_mut()) {
                    *key =
                        String::from_utf8_lossy(&bytes[(at + 1).min(end)..end.saturating_sub(1).max(at + 1)])
                            .into_owned();
                }
                found = path(&within);
                at = end;
                continue;
            }
            open @ (b'[' | b'{') => {
                found = path(&within);
                within.push(if open == b'[' { Within::List(0) } else { Within::Object(String::new()) });
            }
            b']' | b'}' => {
                within.pop();
                found = path(&within);
            }
            b',' => {
                if let Some(Within::List(index)) = within.last_mut() {
                    *index += 1;
                }
            }
            b':' | b' ' | b'\n' | b'\r' | b'\t' => {}
            _ => found = path(&within),
        }
        at += 1;
    }
    found
}

/// Where a string that begins at a position ends.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(bytes.len())
}

fn path(within: &[Within]) -> String {
    let mut path = String::new();
    for level in within {
        match level {
            Within::List(index) => path += &format!("[{index}]"),
            Within::Object(key) if path.is_empty() => path += key,
            Within::Object(key) => path += &format!(".{key}"),
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        items: Vec<Inner>,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        name: String,
        value: f64,
        count: Option<u32>,
    }

    #[test]
    fn messages_name_the_field_and_what_belongs_there() {
        let schema = "as reports/SCHEMA.md says";
        for (text, expected) in [
            (r#"{"items": "none"}"#, format!("items: text \"none\"; expected a list, {schema}")),
            ("[]", format!("a list; expected an object, {schema}")),
            (
                "{\"items\": [\n {\"name\": \"a, \\\"[b\", \"value\": 1},\n {\"name\": \"c\", \"value\": \"high\"}]}",
                format!("items[1].value: text \"high\"; expected a number, {schema}"),
            ),
            (
                r#"{"items": [{"name": "a", "value": 1, "count": -3}]}"#,
                format!("items[0].count: integer `-3`; expected a whole number, {schema}"),
            ),
            (
                r#"{"items": [{"name": "a"}]}"#,
                format!("items[0]: missing field `value`; expected it, {schema}"),
            ),
            (r#"{"items": [3]}"#, format!("items[0]: integer `3`; expected an object, {schema}")),
            (
                r#"{"items": [], "more": 1}"#,
                format!("more: unknown field `more`; expected `items`, {schema}"),
            ),
        ] {
            assert_eq!(from_json::<Outer>(text, "a document").unwrap_err(), expected, "{text}");
        }
        let whole = Outer { items: vec![Inner { name: "a".into(), value: 1.0, count: Some(3) }] };
        let text = r#"{"items": [{"name": "a", "value": 1, "count": 3}]}"#;
        assert_eq!(from_json::<Outer>(text, "a document"), Ok(whole));
        let error = from_json::<Outer>("{\"items\": [", "a document").unwrap_err();
        assert!(error.starts_with("no JSON: ") && error.ends_with("; expected a document"), "{error}");
    }
}
