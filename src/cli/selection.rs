//! Arguments that several subcommands read in the same way.

use anyhow::{Context as _, Result};
use serde::de::DeserializeOwned;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Reads a JSON file into a type; the error names the file and the place in it. A byte order mark is skipped.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = skinsplat_data::error::read_text(path, "file", "a JSON document")?;
    let json = text.strip_prefix('\u{feff}').unwrap_or(&text);
    serde_json::from_str(json).with_context(|| format!("{}: not the JSON that was expected", path.display()))
}

/// `NAME=PATH`, split at the first sign; the path may have any bytes.
pub(super) fn name_and_path(text: &OsStr) -> Option<(String, PathBuf)> {
    let split = match text.to_str() {
        Some(text) => text.split_once('=').map(|(name, path)| (name.to_owned(), PathBuf::from(path)))?,
        None => split_bytes(text)?,
    };
    (!split.0.is_empty() && !split.1.as_os_str().is_empty()).then_some(split)
}

#[cfg(unix)]
fn split_bytes(text: &OsStr) -> Option<(String, PathBuf)> {
    use std::os::unix::ffi::OsStrExt;
    let at = text.as_bytes().iter().position(|&byte| byte == b'=')?;
    let (name, path) = text.as_bytes().split_at(at);
    Some((std::str::from_utf8(name).ok()?.to_owned(), PathBuf::from(OsStr::from_bytes(&path[1..]))))
}

#[cfg(not(unix))]
fn split_bytes(_: &OsStr) -> Option<(String, PathBuf)> {
    None
}

/// Three comma-separated numbers in \[0, 1\].
pub(super) fn parse_colour(text: &str) -> Result<[f32; 3], String> {
    let parts: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match parts[..] {
        [r, g, b] if parts.iter().all(|v| (0.0..=1.0).contains(v)) && text.split(',').count() == 3 => {
            Ok([r, g, b])
        }
        _ => Err(format!("`{text}` is not R,G,B: three sRGB values in [0, 1]")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_need_three_numbers_in_range() {
        assert_eq!(parse_colour("1, 0.5,0"), Ok([1.0, 0.5, 0.0]));
        for bad in ["", "1,1", "1,1,1,1", "1,x,1", "nan,0,0", "1,,1", "255,255,255", "-0.1,0,0"] {
            assert!(parse_colour(bad).is_err(), "{bad}");
        }
    }
}
