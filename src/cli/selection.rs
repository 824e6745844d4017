//! Arguments that several subcommands read in the same way.

use anyhow::{Context as _, Result};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads a JSON file into a type; the error names the file and the place in it. A byte order mark is skipped.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = skinsplat_data::source::read_to_string(path)
        .with_context(|| format!("{}: cannot read", path.display()))?;
    let json = text.strip_prefix('\u{feff}').unwrap_or(&text);
    serde_json::from_str(json).with_context(|| format!("{}: not the JSON that was expected", path.display()))
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
