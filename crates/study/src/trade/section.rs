//! Sweeps as data, and the tables that are made of them.

use super::{Degrees, Fidelity, Spread, pareto_front};
use serde::Serialize;
use skinsplat_core::math::portable;

/// Errors below this, degrees, count as equal: quaternions are drawn from f32, which holds no more.
pub(super) const EQUAL_BELOW: f64 = 1e-5;
/// Images beyond this, dB, count as equal: f32 images hold no more.
pub(super) const EQUAL_BEYOND: f64 = 120.0;

/// What a time is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Nanoseconds per Gaussian.
    PerGaussian,
    /// Milliseconds per frame.
    PerFrame,
}

impl Unit {
    /// Seconds to the unit.
    pub(super) fn factor(self) -> f64 {
        match self {
            Self::PerGaussian => 1e9,
            Self::PerFrame => 1e3,
        }
    }

    /// As a heading.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::PerGaussian => "ns per Gaussian",
            Self::PerFrame => "ms per frame",
        }
    }
}

/// What was measured of a choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Seconds per Gaussian or frame.
    pub time: Option<Spread>,
    /// Bytes per Gaussian.
    pub bytes: Option<f64>,
    /// Angles to the exact rotations.
    pub degrees: Option<Degrees>,
    /// Likeness of the images to the exact ones.
    pub fidelity: Option<Fidelity>,
}

/// One choice in one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepRow {
    /// `test`, `extreme`, or `both` where the sweep looks at one kind only.
    pub motion: &'static str,
    /// One per axis of the sweep.
    pub choice: Vec<String>,
    /// What was measured, or why nothing could be.
    pub outcome: Result<Outcome, String>,
    /// A remark.
    pub note: String,
}

/// One table's worth of measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Id: `solver`.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// What is compared with what. Sentences.
    pub about: String,
    /// Names of the axes.
    pub axes: Vec<&'static str>,
    /// Of the times.
    pub unit: Unit,
    /// The front is judged by bytes instead of time.
    pub by_bytes: bool,
    /// The rows.
    pub rows: Vec<SweepRow>,
}

impl SweepRow {
    /// The choice as one word: `power-15 × 4`.
    pub fn name(&self) -> String {
        self.choice.join(" × ")
    }
}

impl Sweep {
    /// The id of a row: `solver/extreme/power-15`.
    pub fn row_id(&self, row: &SweepRow) -> String {
        format!("{}/{}/{}", self.id, row.motion, row.choice.join("/"))
    }

    /// What a row costs: bytes, or time in the sweep's unit; none if that was not measured.
    pub fn cost(&self, row: &SweepRow) -> Option<f64> {
        let outcome = row.outcome.as_ref().ok()?;
        if self.by_bytes { outcome.bytes } else { Some(outcome.time?.median * self.unit.factor()) }
    }

    /// What a row is judged by, smaller being better: cost, then 95 % and all of the angles, or else twice the negative
    /// PSNR. None if one was not measured, or if the sweep has angles and the row has none.
    fn criteria(&self, row: &SweepRow) -> Option<[f64; 3]> {
        let outcome = row.outcome.as_ref().ok()?;
        let cost = self.cost(row)?;
        let by_angle = self.has(|o| o.degrees.is_some());
        match (outcome.degrees, outcome.fidelity) {
            (Some(degrees), _) => Some([cost, degrees.p95.max(EQUAL_BELOW), degrees.max.max(EQUAL_BELOW)]),
            (None, Some(fidelity)) if !by_angle => {
                let error = -fidelity.decibels().min(EQUAL_BEYOND);
                Some([cost, error, error])
            }
            _ => None,
        }
    }

    /// Per row, whether no other row of the same motion is at least as good in cost and errors and better in one.
    pub fn front(&self) -> Vec<bool> {
        let mut on_front = vec![false; self.rows.len()];
        let mut motions: Vec<&str> = self.rows.iter().map(|row| row.motion).collect();
        motions.sort_unstable();
        motions.dedup();
        for motion in motions {
            let members: Vec<(usize, [f64; 3])> = (0..self.rows.len())
                .filter(|&i| self.rows[i].motion == motion)
                .filter_map(|i| Some((i, self.criteria(&self.rows[i])?)))
                .collect();
            let points: Vec<[f64; 3]> = members.iter().map(|&(_, point)| point).collect();
            for ((i, _), front) in members.iter().zip(pareto_front(&points)) {
                on_front[*i] = front;
            }
        }
        on_front
    }

    /// Whether any row has such a measurement.
    fn has(&self, part: impl Fn(&Outcome) -> bool) -> bool {
        self.rows.iter().filter_map(|row| row.outcome.as_ref().ok()).any(part)
    }

    /// The table.
    pub fn section(&self) -> Section {
        let (times, bytes) = (self.has(|o| o.time.is_some()), self.has(|o| o.bytes.is_some()));
        let (degrees, fidelity) = (self.has(|o| o.degrees.is_some()), self.has(|o| o.fidelity.is_some()));
        let column = |id: &str, title: &str, timing| Column { id: id.into(), title: title.into(), timing };
        let mut columns = vec![column("motion", "Motion", false)];
        columns.extend(self.axes.iter().map(|axis| column(&axis.to_lowercase(), axis, false)));
        if times {
            columns.push(column("time", self.unit.title(), true));
            columns.push(column("time_low", "1st quartile", true));
            columns.push(column("time_high", "3rd quartile", true));
        }
        if bytes {
            columns.push(column("bytes", "bytes per Gaussian", false));
        }
        if degrees {
            columns.push(column("degrees_median", "median °", false));
            columns.push(column("degrees_p95", "95 % °", false));
            columns.push(column("degrees_max", "max °", false));
        }
        if fidelity {
            columns.push(column("psnr", "PSNR dB", false));
        }
        columns.push(column("front", "Front", !self.by_bytes));
        columns.push(column("note", "Note", false));
        let row = |(row, on_front): (&SweepRow, bool)| {
            let mut cells = vec![Cell::text(row.motion)];
            cells.extend(row.choice.iter().map(|choice| Cell::text(choice)));
            let none = Outcome::default();
            let (outcome, why) = match &row.outcome {
                Ok(outcome) => (outcome, "not measured"),
                Err(_) => (&none, "not run"),
            };
            let number = |value: Option<f64>| value.map_or_else(|| Cell::Word(why.to_owned()), Cell::number);
            if times {
                let time =
                    |part: fn(Spread) -> f64| number(outcome.time.map(|t| part(t) * self.unit.factor()));
                cells.extend([time(|t| t.median), time(|t| t.low), time(|t| t.high)]);
            }
            if bytes {
                cells.push(number(outcome.bytes));
            }
            if degrees {
                let angle = |part: fn(Degrees) -> f64| number(outcome.degrees.map(part));
                cells.extend([angle(|d| d.median), angle(|d| d.p95), angle(|d| d.max)]);
            }
            if fidelity {
                cells.push(match outcome.fidelity {
                    Some(Fidelity::Exact) => Cell::Word("exact".to_owned()),
                    Some(Fidelity::Decibels(value)) => Cell::number(value),
                    None => number(None),
                });
            }
            cells.push(Cell::text(match (&row.outcome, self.criteria(row)) {
                (Err(_), _) => "not run",
                (Ok(_), None) => "not judged",
                (Ok(_), Some(_)) if on_front => "front",
                (Ok(_), Some(_)) => "beaten",
            }));
            let note = match &row.outcome {
                Err(problem) => problem,
                Ok(_) if row.note.is_empty() => "none",
                Ok(_) => &row.note,
            };
            cells.push(Cell::text(note));
            Row { id: self.row_id(row), cells }
        };
        Section {
            id: self.id.to_owned(),
            title: self.title.to_owned(),
            about: self.about.clone(),
            columns,
            rows: self.rows.iter().zip(self.front()).map(row).collect(),
        }
    }
}

/// A table of any shape.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Section {
    /// Id, unique in a result.
    pub id: String,
    /// Heading.
    pub title: String,
    /// What is compared with what. Sentences.
    pub about: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Row>,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Column {
    /// Id, unique in its section.
    pub id: String,
    /// Heading.
    pub title: String,
    /// True if values depend on a clock: all others are the same from run to run.
    pub timing: bool,
}

/// A row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Unique in a result; evidence is cited by it.
    pub id: String,
    /// One per column.
    pub cells: Vec<Cell>,
}

/// A cell: a finite number or a word, never nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// A name, or why there is no number.
    Word(String),
}

impl Cell {
    /// A number, or what stands for one that is not finite.
    pub fn number(value: f64) -> Self {
        if value.is_nan() {
            Self::Word("undefined".to_owned())
        } else if value.is_infinite() {
            Self::Word("unbounded".to_owned())
        } else {
            Self::Number(value)
        }
    }

    /// A word.
    pub fn text(text: &str) -> Self {
        Self::Word(text.to_owned())
    }

    /// As people read it: three significant digits, whole numbers from 1000 on.
    pub fn shown(&self) -> String {
        match self {
            Self::Word(word) => word.clone(),
            Self::Number(value) => shown(*value),
        }
    }
}

/// Three significant digits.
pub(super) fn shown(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 {
        format!("{value:.1e}")
    } else {
        let digits = (2.0 - portable::log10(size).floor()).clamp(0.0, 5.0) as usize;
        format!("{value:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> Sweep {
        let outcome = |time: f64, max: f64| {
            let degrees = Degrees { median: 0.0, p95: 0.1, max };
            Ok(Outcome {
                time: Some(Spread { median: time, low: time, high: time, repeats: 1 }),
                degrees: Some(degrees),
                fidelity: Some(Fidelity::Exact),
                bytes: None,
            })
        };
        let row = |motion, name: &str, outcome| SweepRow {
            motion,
            choice: vec![name.to_owned()],
            outcome,
            note: String::new(),
        };
        Sweep {
            id: "solver",
            title: "Solvers",
            about: String::new(),
            axes: vec!["Solver"],
            unit: Unit::PerGaussian,
            by_bytes: false,
            rows: vec![
                row("test", "slow", outcome(2e-9, 0.0)),
                row("test", "fast", outcome(1e-9, 1e-7)),
                row("extreme", "slow", outcome(2e-9, 0.0)),
                row("extreme", "fast", outcome(1e-9, 5.0)),
                row("extreme", "faces", Err("the body has no faces".to_owned())),
            ],
        }
    }

    #[test]
    fn the_front_is_per_motion_and_rounding_is_no_merit() {
        assert_eq!(sweep().front(), [false, true, true, true, false]);
    }

    #[test]
    fn a_table_has_a_word_or_a_number_in_every_cell() {
        let section = sweep().section();
        for row in &section.rows {
            assert_eq!(row.cells.len(), section.columns.len());
            assert!(row.cells.iter().all(|cell| !cell.shown().is_empty()));
        }
        let last = &section.rows[4];
        assert_eq!(last.id, "solver/extreme/faces");
        assert_eq!(last.cells.last(), Some(&Cell::text("the body has no faces")));
        assert!(section.rows[0].cells.contains(&Cell::text("exact")));
    }

    #[test]
    fn numbers_are_shown_with_three_digits() {
        let cases =
            [(0.0, "0"), (1234.5, "1234"), (12.345, "12.3"), (0.012345, "0.0123"), (1.2e-5, "1.2e-5")];
        for (value, text) in cases {
            assert_eq!(shown(value), text);
        }
        assert_eq!(Cell::number(f64::NAN), Cell::text("undefined"));
    }
}
