//! The bytes of a pickle, read forwards.

use skinsplat_core::scene::SceneError;
use std::ops::Range;

/// A place in the file. Every read is checked against its end.
#[derive(Debug)]
pub(super) struct Input {
    pub(super) at: usize,
}

impl Input {
    /// The range of the next `count` bytes.
    pub(super) fn take(&mut self, file: &[u8], count: usize) -> Result<Range<usize>, SceneError> {
        let end = self.at.checked_add(count).filter(|&end| end <= file.len());
        let Some(end) = end else {
            let problem =
                format!("{} bytes where {count} were announced at byte {}", file.len() - self.at, self.at);
            return Err(SceneError::new("pickle", problem, "a complete file"));
        };
        let range = self.at..end;
        self.at = end;
        Ok(range)
    }

    pub(super) fn array<const N: usize>(&mut self, file: &[u8]) -> Result<[u8; N], SceneError> {
        let range = self.take(file, N)?;
        Ok(std::array::from_fn(|i| file[range.start + i]))
    }

    pub(super) fn byte(&mut self, file: &[u8]) -> Result<u8, SceneError> {
        Ok(self.array::<1>(file)?[0])
    }

    /// A length of 1, 4 or 8 bytes, and what it announces.
    pub(super) fn counted(&mut self, file: &[u8], width: usize) -> Result<Range<usize>, SceneError> {
        let length = match width {
            1 => u64::from(self.byte(file)?),
            4 => u64::from(u32::from_le_bytes(self.array(file)?)),
            _ => u64::from_le_bytes(self.array(file)?),
        };
        self.take(file, usize::try_from(length).unwrap_or(usize::MAX))
    }

    /// A line, without its end.
    pub(super) fn line(&mut self, file: &[u8]) -> Result<Range<usize>, SceneError> {
        let length = file[self.at..].iter().position(|&b| b == b'\n');
        let Some(length) = length else {
            let problem = format!("a line at byte {} that does not end", self.at);
            return Err(SceneError::new("pickle", problem, "a complete file"));
        };
        let range = self.take(file, length)?;
        self.at += 1;
        let end = if file[range.clone()].ends_with(b"\r") { range.end - 1 } else { range.end };
        Ok(range.start..end)
    }

    pub(super) fn text_line<'a>(&mut self, file: &'a [u8]) -> Result<&'a str, SceneError> {
        let range = self.line(file)?;
        std::str::from_utf8(&file[range])
            .map_err(|e| SceneError::new("pickle", e.to_string(), "a line of text"))
    }
}

/// The bytes of a quoted string of protocol 0: Python's `repr` of a `str`.
pub(super) fn unquoted(line: &[u8]) -> Option<Vec<u8>> {
    let (&quote, rest) = line.split_first()?;
    let inner = rest.strip_suffix(&[quote]).filter(|_| quote == b'\'' || quote == b'"')?;
    let mut bytes = Vec::with_capacity(inner.len());
    let mut at = 0;
    while let Some(&byte) = inner.get(at) {
        at += 1;
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        let escape = *inner.get(at)?;
        at += 1;
        let byte = match escape {
            b'n' => b'\n',
            b'r' => b'\r',
            b't' => b'\t',
            b'a' => 7,
            b'b' => 8,
            b'v' => 11,
            b'f' => 12,
            b'x' => {
                let digits = std::str::from_utf8(inner.get(at..at + 2)?).ok()?;
                at += 2;
                u8::from_str_radix(digits, 16).ok()?
            }
            b'0'..=b'7' => {
                let length =
                    inner[at - 1..].iter().take(3).take_while(|b| (b'0'..=b'7').contains(*b)).count();
                let digits = std::str::from_utf8(&inner[at - 1..at - 1 + length]).ok()?;
                at += length - 1;
                u8::from_str_radix(digits, 8).ok()?
            }
            b'\\' | b'\'' | b'"' => escape,
            other => {
                bytes.push(b'\\');
                other
            }
        };
        bytes.push(byte);
    }
    Some(bytes)
}

/// Text of protocol 0: Latin-1, other characters by their numbers in 4 or 8 hexadecimal digits.
pub(super) fn raw_unicode(line: &[u8]) -> Option<String> {
    let mut text = String::with_capacity(line.len());
    let mut at = 0;
    while let Some(&byte) = line.get(at) {
        at += 1;
        let digits = match (byte, line.get(at)) {
            (b'\\', Some(b'u')) => 4,
            (b'\\', Some(b'U')) => 8,
            _ => {
                text.push(char::from(byte));
                continue;
            }
        };
        let code =
            u32::from_str_radix(std::str::from_utf8(line.get(at + 1..at + 1 + digits)?).ok()?, 16).ok()?;
        text.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
        at += 1 + digits;
    }
    Some(text)
}
