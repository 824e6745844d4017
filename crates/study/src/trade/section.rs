//! Sweeps as data, and the tables that are made of them.

use super::{Degrees, Fidelity, Spread, pareto_front};
use skinsplat_table::{Cell, Column, Digits, Label, Row, Table};

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
    pub fn section(&self) -> Table {
        let measured = Measured::of(self);
        let mut table = Table::new(self.id, self.title);
        // A sentence of a table has no full stop.
        table.sentences = vec![self.about.trim_end_matches('.').to_owned()];
        table.labels = vec![Label::new("motion", "Motion")];
        table.labels.extend(self.axes.iter().map(|axis| Label::new(axis.to_lowercase(), *axis)));
        table.columns = measured.columns(self);
        table.rows =
            self.rows.iter().zip(self.front()).map(|(row, front)| measured.row(self, row, front)).collect();
        table
    }

    /// Where a row stands: `front`, `beaten`, or why it is not judged.
    fn standing(&self, row: &SweepRow, on_front: bool) -> &'static str {
        match (&row.outcome, self.criteria(row)) {
            (Err(_), _) => "not run",
            (Ok(_), None) => "not judged",
            (Ok(_), Some(_)) if on_front => "front",
            (Ok(_), Some(_)) => "beaten",
        }
    }
}

/// Which measurements a sweep has: those that any of its rows has.
struct Measured {
    times: bool,
    bytes: bool,
    degrees: bool,
    fidelity: bool,
}

impl Measured {
    fn of(sweep: &Sweep) -> Self {
        Self {
            times: sweep.has(|o| o.time.is_some()),
            bytes: sweep.has(|o| o.bytes.is_some()),
            degrees: sweep.has(|o| o.degrees.is_some()),
            fidelity: sweep.has(|o| o.fidelity.is_some()),
        }
    }

    fn columns(&self, sweep: &Sweep) -> Vec<Column> {
        let number = |key: &str, title: &str| Column::new(key, title).digits(DIGITS);
        let mut columns = Vec::new();
        if self.times {
            columns.push(number("time", sweep.unit.title()).timing());
            columns.push(number("time_low", "1st quartile").timing());
            columns.push(number("time_high", "3rd quartile").timing());
        }
        if self.bytes {
            columns.push(number("bytes", "bytes per Gaussian"));
        }
        if self.degrees {
            columns.push(number("degrees_median", "median °"));
            columns.push(number("degrees_p95", "95 % °"));
            columns.push(number("degrees_max", "max °"));
        }
        if self.fidelity {
            columns.push(number("psnr", "PSNR dB"));
        }
        let front = Column::text("front", "Front");
        columns.push(if sweep.by_bytes { front } else { front.timing() });
        columns.push(Column::text("note", "Note"));
        columns
    }

    fn row(&self, sweep: &Sweep, row: &SweepRow, on_front: bool) -> Row {
        let (none, mut cells) = (Outcome::default(), Vec::new());
        let (outcome, why) = match &row.outcome {
            Ok(outcome) => (outcome, "not measured"),
            Err(_) => (&none, "not run"),
        };
        let number = |value: Option<f64>| value.map_or_else(|| Cell::text(why), cell);
        if self.times {
            let time = |part: fn(Spread) -> f64| number(outcome.time.map(|t| part(t) * sweep.unit.factor()));
            cells.extend([time(|t| t.median), time(|t| t.low), time(|t| t.high)]);
        }
        if self.bytes {
            cells.push(number(outcome.bytes));
        }
        if self.degrees {
            let angle = |part: fn(Degrees) -> f64| number(outcome.degrees.map(part));
            cells.extend([angle(|d| d.median), angle(|d| d.p95), angle(|d| d.max)]);
        }
        if self.fidelity {
            cells.push(match outcome.fidelity {
                Some(Fidelity::Exact) => Cell::text("exact"),
                Some(Fidelity::Decibels(value)) => cell(value),
                None => number(None),
            });
        }
        cells.push(Cell::text(sweep.standing(row, on_front)));
        cells.push(Cell::text(match &row.outcome {
            Err(problem) => problem,
            Ok(_) if row.note.is_empty() => "none",
            Ok(_) => &row.note,
        }));
        let labels = [row.motion].into_iter().chain(row.choice.iter().map(String::as_str));
        Row::new(sweep.row_id(row), labels, cells)
    }
}

/// With how many digits numbers are printed.
const DIGITS: Digits = Digits::Significant(3);

/// A number, or what stands for one that is not finite.
pub(super) fn cell(value: f64) -> Cell {
    if value.is_nan() {
        Cell::text("undefined")
    } else if value.is_infinite() {
        Cell::text("unbounded")
    } else {
        Cell::number(value, DIGITS)
    }
}

/// Three significant digits.
pub(super) fn shown(value: f64) -> String {
    DIGITS.show(value)
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
        section.check().expect("a sound table");
        for row in &section.rows {
            assert!(row.cells.iter().all(|cell| !cell.text.is_empty()));
        }
        let last = &section.rows[4];
        assert_eq!(last.id, "solver/extreme/faces");
        assert_eq!(last.cells.last(), Some(&Cell::text("the body has no faces")));
        assert!(section.rows[0].cells.contains(&Cell::text("exact")));
    }

    #[test]
    fn what_is_no_number_has_a_word() {
        assert_eq!(cell(f64::NAN), Cell::text("undefined"));
        assert_eq!(cell(f64::INFINITY), Cell::text("unbounded"));
        assert_eq!(cell(12.345).text, "12.3");
    }
}
