//! Cells: a content for programs, a text for people.

use super::Digits;
use super::row::is_zero;
use serde::{Deserialize, Serialize};

/// What a cell holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "state", content = "value")]
pub enum Content {
    /// A finite number.
    Number(f64),
    /// A finite number that the text says something about: `breaks at 133`.
    Phrase(f64),
    /// Infinity.
    Infinite,
    /// Yes or no.
    Flag(bool),
    /// The cell's text, which is no number.
    Text,
    /// There could be a number, but nobody computed it.
    NotComputed,
    /// The quantity does not exist.
    NotApplicable,
    /// There should be a number and is none.
    Missing,
}

impl Content {
    /// A number, finite or not. What is neither finite nor +inf is missing.
    pub fn number(value: f64) -> Self {
        match value {
            value if value.is_finite() => Self::Number(value),
            f64::INFINITY => Self::Infinite,
            _ => Self::Missing,
        }
    }

    /// The number, if there is one; +inf for [`Content::Infinite`].
    pub fn value(self) -> Option<f64> {
        match self {
            Self::Number(value) | Self::Phrase(value) => Some(value),
            Self::Infinite => Some(f64::INFINITY),
            Self::Flag(_) | Self::Text | Self::NotComputed | Self::NotApplicable | Self::Missing => None,
        }
    }
}

/// A cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// What it holds, in full precision.
    pub content: Content,
    /// Standard deviation over the repetitions that the content is the mean of; none from fewer than two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<f64>,
    /// As printed, before any markup: the rounded number (and `± spread`), `∞`, `n/c` (not computed), `—`, or the text.
    pub text: String,
    /// Whether it is bold: the best among rows that compare with it, or as good.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub best: bool,
    /// How many should be in the sample behind the number and are not.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub missing: usize,
    /// Footnotes: indices into the table's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<usize>,
}

impl Cell {
    /// A cell that prints its content with these digits.
    pub fn new(content: Content, digits: Digits) -> Self {
        let text = match content {
            Content::Number(value) | Content::Phrase(value) => digits.show(value),
            Content::Infinite => "∞".to_owned(),
            Content::Flag(flag) => if flag { "yes" } else { "no" }.to_owned(),
            Content::NotComputed => "n/c".to_owned(),
            Content::Text => String::new(),
            Content::NotApplicable | Content::Missing => "—".to_owned(),
        };
        Self { content, spread: None, text, best: false, missing: 0, notes: Vec::new() }
    }

    /// A number, infinite or not, with these digits.
    pub fn number(value: f64, digits: Digits) -> Self {
        Self::new(Content::number(value), digits)
    }

    /// A count.
    pub fn count(count: usize) -> Self {
        Self::number(count as f64, Digits::Decimals(0))
    }

    /// Text.
    pub fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), ..Self::new(Content::Text, Digits::Exact) }
    }

    /// Words that contain a number, which must be finite: `Cell::phrase(133.2, "breaks at 133")`. Text if it is not.
    pub fn phrase(value: f64, words: impl Into<String>) -> Self {
        let content = if value.is_finite() { Content::Phrase(value) } else { Content::Text };
        Self { text: words.into(), ..Self::new(content, Digits::Exact) }
    }

    /// Yes or no.
    pub fn flag(flag: bool) -> Self {
        Self::new(Content::Flag(flag), Digits::Exact)
    }

    /// A cell without a number, because the quantity does not exist.
    pub fn empty() -> Self {
        Self::new(Content::NotApplicable, Digits::Exact)
    }

    /// A mean over repetitions, printed with its spread.
    pub fn with_spread(content: Content, spread: Option<f64>, digits: Digits) -> Self {
        let cell = Self::new(content, digits);
        match spread {
            Some(sd) => Self { text: format!("{} ± {}", cell.text, digits.show(sd)), spread, ..cell },
            None => cell,
        }
    }

    /// A difference, printed with its sign.
    pub fn difference(value: f64, digits: Digits) -> Self {
        let cell = Self::number(value, digits);
        let signed = value > 0.0 && cell.printed() != Some(0.0);
        Self { text: if signed { format!("+{}", cell.text) } else { cell.text.clone() }, ..cell }
    }

    /// The numbers of its footnotes, from 1, separated by commas.
    pub fn footnotes(&self) -> Option<String> {
        let numbers: Vec<String> = self.notes.iter().map(|note| (note + 1).to_string()).collect();
        (!numbers.is_empty()).then(|| numbers.join(","))
    }

    /// The value of the printed digits; of words about a number, the number.
    pub fn printed(&self) -> Option<f64> {
        match self.content {
            Content::Number(_) => self.text.split(' ').next()?.parse().ok(),
            content => content.value(),
        }
    }
}
