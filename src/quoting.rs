//! Words of a shell.

use skinsplat_table::is_hidden;
use std::ffi::OsStr;
use std::fmt::Write;

/// A word that bash reads as this argument, whatever it holds, on one line. Bytes that are no text, and characters that a
/// terminal obeys, become escapes.
pub fn quoted(argument: &OsStr) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_./:=,+@%-".contains(c);
    match argument.to_str() {
        Some(text) if !text.is_empty() && text.chars().all(plain) => text.to_owned(),
        Some(text) if !text.contains(is_hidden) => format!("'{}'", text.replace('\'', r"'\''")),
        _ => escaped(argument.as_encoded_bytes()),
    }
}

/// `$'…'`.
fn escaped(bytes: &[u8]) -> String {
    let mut text = String::from("$'");
    for &byte in bytes {
        match byte {
            b'\'' | b'\\' => {
                text.push('\\');
                text.push(char::from(byte));
            }
            b' '..=b'~' => text.push(char::from(byte)),
            // Always three octal digits: what follows cannot be taken for another.
            other => {
                let _ = write!(text, "\\{other:03o}");
            }
        }
    }
    text.push('\'');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_hold_whatever_they_are() {
        for (argument, word) in [
            ("plain-1.toml", "plain-1.toml"),
            ("", "''"),
            ("two words", "'two words'"),
            ("it's $HOME", r"'it'\''s $HOME'"),
            ("ä", "'ä'"),
            ("a\u{202e}b", r"$'a\342\200\256b'"),
            ("a\nEND_OF_JOB\n'1", r"$'a\012END_OF_JOB\012\'1'"),
        ] {
            assert_eq!(quoted(OsStr::new(argument)), word);
        }
    }

    #[cfg(unix)]
    #[test]
    fn bash_reads_them_back() {
        use std::os::unix::ffi::{OsStrExt, OsStringExt};
        let words: Vec<Vec<u8>> = (1..=255_u8)
            .map(|byte| vec![b'a', byte, b'1'])
            .chain([b"$(touch x) `y` \"z\" !a *".to_vec(), b"\xff\xfe'\\\n".to_vec()])
            .collect();
        for word in words {
            let script = format!("printf %s {}", quoted(OsStr::from_bytes(&word)));
            let answer =
                std::process::Command::new("bash").args(["-c", &script]).output().expect("bash runs");
            assert_eq!(answer.stdout, word, "{:?}", std::ffi::OsString::from_vec(word.clone()));
        }
    }
}
