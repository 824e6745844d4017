//! Columns.

use super::Digits;
use serde::{Deserialize, Serialize};

/// Which values are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// More is better.
    Higher,
    /// Less is better.
    Lower,
}

impl Direction {
    /// `Higher` if so.
    pub fn higher_if(more_is_better: bool) -> Self {
        if more_is_better { Self::Higher } else { Self::Lower }
    }

    /// The arrow beside a heading.
    pub fn arrow(self) -> char {
        match self {
            Self::Higher => '↑',
            Self::Lower => '↓',
        }
    }
}

/// The side on which a column's texts line up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    /// For text.
    Left,
    /// For numbers.
    #[default]
    Right,
}

/// A column of cells.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// What programs call it: `psnr`. Unique in its group.
    pub key: String,
    /// Heading over neighbouring columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Heading, with its unit.
    pub title: String,
    /// What the column holds, if the title does not say it: a phrase without a full stop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    /// Which values are better; none where that makes no sense.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub better: Option<Direction>,
    /// With how many digits its numbers are printed; none for text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digits: Option<Digits>,
    /// True if values depend on a clock: all others are the same from run to run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub timing: bool,
    /// The side on which its texts line up.
    pub align: Align,
}

impl Column {
    /// A column of numbers, which line up on the right.
    pub fn new(key: impl Into<String>, title: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            group: None,
            title: title.into(),
            about: None,
            better: None,
            digits: None,
            timing: false,
            align: Align::Right,
        }
    }

    /// A column of text, which lines up on the left.
    pub fn text(key: impl Into<String>, title: impl Into<String>) -> Self {
        Self { align: Align::Left, ..Self::new(key, title) }
    }

    /// Under a common heading.
    pub fn group(self, group: impl Into<String>) -> Self {
        Self { group: Some(group.into()), ..self }
    }

    /// With an explanation.
    pub fn about(self, about: impl Into<String>) -> Self {
        Self { about: Some(about.into()), ..self }
    }

    /// With a direction towards better values.
    pub fn better(self, direction: Direction) -> Self {
        Self { better: Some(direction), ..self }
    }

    /// With so many digits.
    pub fn digits(self, digits: Digits) -> Self {
        Self { digits: Some(digits), ..self }
    }

    /// Depends on a clock.
    pub fn timing(self) -> Self {
        Self { timing: true, ..self }
    }

    /// The heading with an arrow towards better values, without the group's.
    pub fn heading(&self) -> String {
        match self.better {
            Some(direction) => format!("{} {}", self.title, direction.arrow()),
            None => self.title.clone(),
        }
    }

    /// A name that is unique in the table: `psnr`, in a group `lab psnr`.
    pub fn name(&self) -> String {
        match &self.group {
            Some(group) => format!("{group} {}", self.key),
            None => self.key.clone(),
        }
    }
}
