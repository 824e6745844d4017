//! A table as JSON: the value itself.

use super::Table;
use super::escape::is_hidden;
use serde::Serialize;

/// The table as JSON, indented, with a final newline.
pub fn json(table: &Table) -> String {
    to_json(table)
}

/// Anything that holds tables as JSON, indented, with a final newline. Characters that a terminal would obey are written as
/// escapes, which read back as what they were. A number that is not finite is `null`.
pub fn to_json(value: &impl Serialize) -> String {
    let text = serde_json::to_string_pretty(value).expect("keys are strings") + "\n";
    if !text.chars().any(|c| c != '\n' && is_hidden(c)) {
        return text;
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' => shown.push('\n'),
            c if is_hidden(c) => shown += &format!("\\u{:04x}", u32::from(c)),
            c => shown.push(c),
        }
    }
    shown
}
