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
            c if is_hidden(c) => {
                c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| shown += &format!("\\u{unit:04x}"));
            }
            c => shown.push(c),
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_change_no_string() {
        let names = ["plain", "a\u{202e}b\u{e0041}\u{7f}", "two\nlines"];
        let text = to_json(&names);
        assert!(!text.contains(|c| is_hidden(c) && c != '\n'), "{text}");
        assert_eq!(serde_json::from_str::<Vec<String>>(&text).unwrap(), names);
    }
}
