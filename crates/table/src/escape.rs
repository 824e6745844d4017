//! What every writer does to text before its own format's escapes.

use std::borrow::Cow;

/// The text on one line, with nothing that moves a cursor or turns the direction of writing: spaces for line ends and tabs,
/// `\u{1b}` for other control characters.
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\r' | '\t' => shown.push(' '),
            c if is_hidden(c) => shown.extend(c.escape_unicode()),
            c => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// Control characters, line and paragraph separators, marks that turn the direction of writing, and what has no width (but the
/// joiners, which scripts are written with).
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
        )
}

/// A number's text with a true minus sign; also that of a number among words, where a hyphen stays one.
pub(crate) fn minus(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let sign = |i: usize| {
        let before = i.checked_sub(1).map(|b| chars[b]);
        let exponent = before == Some('e') && i >= 2 && chars[i - 2].is_ascii_digit();
        let starts = before.is_none_or(|c| !c.is_alphanumeric()) || exponent;
        starts && chars.get(i + 1).is_some_and(char::is_ascii_digit)
    };
    chars.iter().enumerate().map(|(i, &c)| if c == '-' && sign(i) { '−' } else { c }).collect()
}

/// A part of a sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Span<'a> {
    /// Words.
    Words(&'a str),
    /// What was between a pair of backticks.
    Code(&'a str),
}

/// The parts of a sentence. A backtick without a partner is a character like any other.
pub(crate) fn spans(text: &str) -> Vec<Span<'_>> {
    let mut spans = Vec::new();
    let mut rest = text;
    while let Some((before, code, after)) = pair(rest) {
        spans.extend([Span::Words(before), Span::Code(code)]);
        rest = after;
    }
    spans.push(Span::Words(rest));
    spans
}

/// What is before, between and after the first pair of backticks with something between them.
fn pair(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('`')?;
    let (code, after) = rest.split_once('`')?;
    (!code.is_empty()).then_some((before, code, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_hidden_stays() {
        assert_eq!(visible("plain ü −"), "plain ü −");
        assert_eq!(visible("a\nb\tc\u{1b}[31m\u{202e}"), "a b c\\u{1b}[31m\\u{202e}");
        assert_eq!(visible("\u{200b}\u{2066}\u{e0041}"), "\\u{200b}\\u{2066}\\u{e0041}");
        assert_eq!(visible("क्\u{200d}ष"), "क्\u{200d}ष");
    }

    #[test]
    fn signs_are_told_from_hyphens() {
        for (text, shown) in [
            ("-0.5", "−0.5"),
            ("1.3e-14", "1.3e−14"),
            ("+0.1 [-0.2, -3]", "+0.1 [−0.2, −3]"),
            ("breaks at 1e-9", "breaks at 1e−9"),
            ("power-15 at -1", "power-15 at −1"),
            ("16-bit", "16-bit"),
            ("-", "-"),
        ] {
            assert_eq!(minus(text), shown);
        }
    }

    #[test]
    fn backticks_come_in_pairs() {
        assert_eq!(spans("no code"), [Span::Words("no code")]);
        assert_eq!(spans("a `b` c"), [Span::Words("a "), Span::Code("b"), Span::Words(" c")]);
        assert_eq!(spans("a ` b"), [Span::Words("a ` b")]);
        assert_eq!(spans("``"), [Span::Words("``")]);
    }
}
