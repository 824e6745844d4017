//! How many digits a number is printed with.

use serde::{Deserialize, Serialize};

/// With how many digits a number is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Digits {
    /// So many after the point: `19.70`, `65180`.
    Decimals(usize),
    /// So many significant ones, zeros kept, never fewer than the whole part has: with 3, `0.0420`, `12.0`, `1234`. One
    /// fewer with an exponent below 0.001: `5.3e-4`.
    Significant(usize),
    /// So many significant ones at most, zeros at the end left out: with 3, `0.042`, `12`, `12345`. With an exponent below
    /// 0.001 and from 100000 on: `5.25e-4`.
    Shortest(usize),
    /// As many as tell the number from every other.
    Exact,
}

impl Digits {
    /// Most digits that a document may ask for.
    pub const MOST: usize = 12;

    /// The number with these digits; zero has no sign.
    pub fn show(self, value: f64) -> String {
        unsigned_zero(match self {
            Self::Decimals(digits) => format!("{value:.digits$}"),
            Self::Significant(digits) => significant(value, digits),
            Self::Shortest(digits) => shortest(value, digits),
            Self::Exact => value.to_string(),
        })
    }

    /// The number of digits that was asked for, if there is one.
    pub(crate) fn count(self) -> Option<usize> {
        match self {
            Self::Decimals(digits) | Self::Significant(digits) | Self::Shortest(digits) => Some(digits),
            Self::Exact => None,
        }
    }
}

/// Never `-0.00`.
fn unsigned_zero(text: String) -> String {
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Digits after the point that make so many significant ones; at most two more than that.
fn decimals(size: f64, digits: usize) -> usize {
    let digits = digits as f64;
    (digits - 1.0 - libm::log10(size).floor()).clamp(0.0, digits + 2.0) as usize
}

fn significant(value: f64, digits: usize) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 {
        format!("{value:.0$e}", digits.saturating_sub(2))
    } else {
        format!("{value:.0$}", decimals(size, digits))
    }
}

fn shortest(value: f64, digits: usize) -> String {
    let trimmed = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&size) {
        trimmed(&format!("{value:.0$}", decimals(size, digits)))
    } else {
        let text = format!("{value:.0$e}", digits.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{}e{exponent}", trimmed(mantissa))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_rounded_and_zero_has_no_sign() {
        let show = |value, digits| Digits::Decimals(digits).show(value);
        assert_eq!(show(19.7, 2), "19.70");
        assert_eq!(show(-0.001, 2), "0.00");
        assert_eq!(show(-0.5, 2), "-0.50");
        assert_eq!(show(65180.0, 0), "65180");
    }

    #[test]
    fn significant_digits_keep_their_zeros() {
        let cases = [
            (0.0, "0"),
            (1234.5, "1234"),
            (12.345, "12.3"),
            (0.012345, "0.0123"),
            (1.2e-5, "1.2e-5"),
            (42.0, "42.0"),
        ];
        for (value, text) in cases {
            assert_eq!(Digits::Significant(3).show(value), text);
        }
    }

    #[test]
    fn the_shortest_form_has_no_zeros_at_the_end() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (0.5, "0.5"),
            (123.456, "123"),
            (1e-9, "1e-9"),
            (1.5e-9, "1.5e-9"),
            (12345.0, "12345"),
            (100.0, "100"),
            (0.00123, "0.00123"),
            (-1e300, "-1e300"),
        ];
        for (value, text) in cases {
            assert_eq!(Digits::Shortest(3).show(value), text);
        }
        assert_eq!(Digits::Exact.show(0.1 + 0.2), "0.30000000000000004");
    }
}
