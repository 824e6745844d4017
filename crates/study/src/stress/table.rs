//! What was found, as data: one row per input, subject and precision, and where each subject breaks.

use serde::{Serialize, Serializer};
use skinsplat_core::math::portable;
use skinsplat_table::{Column, Digits, Label, Table};
use std::fmt;

/// A measured value, or the word that says why there is none. Never NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// A finite number.
    Number(f64),
    /// Yes or no.
    Flag(bool),
    /// Why there is no number.
    Word(&'static str),
}

impl Cell {
    /// A number, or "not finite".
    pub fn number(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::Word("not finite") }
    }

    /// The value, if it is a number.
    pub fn value(self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(value),
            Self::Flag(_) | Self::Word(_) => None,
        }
    }
}

impl From<Cell> for skinsplat_table::Cell {
    fn from(cell: Cell) -> Self {
        match cell {
            Cell::Number(value) => Self::number(value, DIGITS),
            Cell::Flag(flag) => Self::flag(flag),
            Cell::Word(word) => Self::text(word),
        }
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Number(value) => f.write_str(&shown(value)),
            Self::Flag(true) => f.write_str("yes"),
            Self::Flag(false) => f.write_str("no"),
            Self::Word(word) => f.write_str(word),
        }
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Number(value) => serializer.serialize_f64(value),
            Self::Flag(flag) => serializer.serialize_bool(flag),
            Self::Word(word) => serializer.serialize_str(word),
        }
    }
}

/// With how many digits numbers are printed.
const DIGITS: Digits = Digits::Shortest(3);

/// Three digits, with an exponent where zeros would say nothing.
pub(super) fn shown(value: f64) -> String {
    DIGITS.show(value)
}

/// A column of measured values. Its keys are its headings.
pub(super) fn column(title: impl Into<String>) -> Column {
    let title = title.into();
    Column::new(title.clone(), title).digits(DIGITS)
}

/// A column of words.
pub(super) fn words(title: &str) -> Column {
    Column::text(title, title)
}

/// A leading column, under its heading.
pub(super) fn label(title: &str) -> Label {
    Label::new(title, title)
}

/// A row that is named by its labels.
pub(super) fn line<const N: usize>(
    labels: [String; N],
    cells: Vec<skinsplat_table::Cell>,
) -> skinsplat_table::Row {
    skinsplat_table::Row::new(labels.join("/"), labels, cells)
}

/// An input, with every digit that it has.
pub(super) fn exactly(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

/// How a subject bears an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Within the limit of what counts as right.
    Holds,
    /// Off, but not visibly so.
    Degrades,
    /// Visibly wrong, not a rotation, not finite or without an answer.
    Breaks,
}

impl Verdict {
    /// By a value and the two limits that it must not exceed.
    pub(super) fn of(value: f64, [degrades, breaks]: [f64; 2]) -> Self {
        match value {
            v if v <= degrades => Self::Holds,
            v if v <= breaks => Self::Degrades,
            _ => Self::Breaks,
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::Degrades => "degrades",
            Self::Breaks => "breaks",
        })
    }
}

/// The limits between verdicts: what is called off, and what is called broken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Degrees off the exact answer, beyond what the precision of the input lets anyone know.
    pub degrees: [f64; 2],
    /// Largest entry of RᵀR − I, and |det R − 1|.
    pub rotation: [f64; 2],
    /// Largest difference of a channel from the exact image: half a level and four levels of 8 bits.
    pub image: [f64; 2],
    /// Relative error of what is neither an angle nor an image.
    pub relative: [f64; 2],
    /// Degrees per frame that are left of a jump when the step goes to 0.
    pub jump_degrees: [f64; 2],
}

/// The limits of every verdict.
pub const LIMITS: Limits = Limits {
    degrees: [0.01, 1.0],
    rotation: [1e-5, 1e-3],
    image: [0.5 / 255.0, 4.0 / 255.0],
    relative: [1e-4, 1e-2],
    jump_degrees: [0.1, 1.0],
};

/// How the note of a row begins whose input has no one answer.
pub(super) const UNDETERMINED: &str = "not determined by the input";

/// One input given to one subject in one precision.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The section's id.
    pub section: &'static str,
    /// The kind of input.
    pub family: String,
    /// The input as a person would say it: a value on the family's axis, or a name.
    pub input: String,
    /// The solver, strategy or part of the renderer.
    pub subject: String,
    /// "f32" or "f64".
    pub precision: &'static str,
    /// Every number of the answer is finite.
    pub finite: Cell,
    /// Largest entry of RᵀR − I or |det R − 1|.
    pub rotation_error: Cell,
    /// Distance from the exact answer, in the section's unit.
    pub error: Cell,
    /// Difference after a turn of the world, in the section's unit.
    pub equivariance: Cell,
    /// Largest change per frame, degrees.
    pub jump: Cell,
    /// The same bits again, and with another number of threads.
    pub deterministic: Cell,
    /// How it bears the input.
    pub verdict: Verdict,
    /// What else there is to say.
    pub note: String,
}

/// The first input on a continuous axis at which a subject breaks.
#[derive(Clone, Debug, Serialize)]
pub struct Threshold {
    /// The section's id.
    pub section: &'static str,
    /// The family of inputs.
    pub family: String,
    /// The solver, strategy or part of the renderer.
    pub subject: String,
    /// "f32" or "f64".
    pub precision: &'static str,
    /// The value.
    pub breaks_at: f64,
    /// What the axis counts.
    pub axis: String,
    /// What a person would say for the value: the angle itself where the axis counts from 180 degrees.
    pub said: f64,
}

/// A value on an axis as a person would say it: an angle near half a turn has a digit after the point.
pub(super) fn said(value: f64) -> String {
    let digits = if (100.0..1000.0).contains(&value) { Digits::Shortest(4) } else { DIGITS };
    digits.show(value)
}

/// What one section found.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Findings {
    /// The id.
    pub section: &'static str,
    /// A heading.
    pub title: &'static str,
    /// Summaries.
    pub tables: Vec<Table>,
    /// Everything that was measured.
    pub rows: Vec<Row>,
    /// Where subjects break.
    pub thresholds: Vec<Threshold>,
    /// A sentence per cause: what breaks, and why.
    pub causes: Vec<String>,
}

/// Bisects, on a logarithmic scale where both ends allow it, for the value nearest to `sound` at which `breaks` is true.
/// The end `broken` breaks.
pub(super) fn bisect(sound: f64, broken: f64, breaks: impl Fn(f64) -> bool) -> f64 {
    let logarithmic = sound > 0.0 && broken >= 0.0;
    let floor = 1e-40;
    let (mut sound, mut broken) = if logarithmic {
        (portable::log10(sound), portable::log10(broken.max(floor)))
    } else {
        (sound, broken)
    };
    let value = |x: f64| if logarithmic { portable::pow(10.0, x) } else { x };
    for _ in 0..30 {
        let middle = 0.5 * (sound + broken);
        if breaks(value(middle)) {
            broken = middle;
        } else {
            sound = middle;
        }
    }
    value(broken)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_never_nan() {
        assert_eq!(shown(0.00123), "0.00123");
        assert_eq!(Cell::number(1e-9).to_string(), "1e-9");
        assert_eq!(Cell::number(f64::NAN), Cell::Word("not finite"));
    }

    #[test]
    fn bisection_finds_the_edge_on_both_scales() {
        assert!((bisect(100.0, 0.0, |x| x < 1e-7) / 1e-7 - 1.0).abs() < 1e-6);
        assert!((bisect(-1.0, 1.0, |x| x > 0.25) - 0.25).abs() < 1e-6);
    }
}
