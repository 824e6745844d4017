//! A comparison as tables, which every format of `skinsplat_table` writes.

use super::{Changes, Fate, Line, Move, titled};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Digits, Label, Row, Table};

/// Names of frames that a cell lists; the others are counted.
const NAMED: usize = 5;

fn labels(more: &[(&str, &str)]) -> Vec<Label> {
    let common = [("table", "Table"), ("sequence", "Sequence"), ("variant", "Variant")];
    common.iter().chain(more).map(|&(key, title)| Label::new(key, title)).collect()
}

/// A row per number, of the fates that `wanted` holds: those that need attention first, else in the order of the baseline.
pub fn verdicts(changes: &Changes, wanted: impl Fn(Fate) -> bool) -> Table {
    let lines: Vec<&Line> = (Fate::ALL.into_iter().filter(|&fate| wanted(fate)))
        .flat_map(|fate| changes.lines.iter().filter(move |line| line.fate == fate))
        .collect();
    Table {
        labels: labels(&[("metric", "Metric")]),
        columns: vec![
            Column::text("verdict", "Verdict"),
            Column::new("baseline", if changes.paper { "Paper" } else { "Baseline" }).digits(Digits::Exact),
            Column::new("current", "Current").digits(Digits::Exact),
            Column::new("change", "Change").digits(Digits::Exact),
            Column::new("tolerance", "Tolerance").digits(Digits::Exact),
            Column::text("frames", "Frames"),
        ],
        rows: lines.iter().enumerate().map(|(r, line)| verdict(r, line)).collect(),
        sentences: vec!["What became of every number; changes beyond the tolerance count".to_owned()],
        ..Table::new("verdicts", "What moved")
    }
}

fn verdict(index: usize, line: &Line) -> Row {
    let metric = line.title();
    let labels = [line.table.as_str(), &line.sequence, &line.variant, &metric];
    let number = |value: Option<f64>, digits: &dyn Fn(MetricId) -> Digits| match (line.metric, value) {
        (Some(metric), Some(value)) => Cell::number(value, digits(metric)),
        _ => Cell::empty(),
    };
    let change = line.metric.zip(line.baseline.zip(line.current));
    let tolerance = line.tolerance.filter(|_| line.fate != Fate::Missing && line.fate != Fate::New);
    let cells = vec![
        Cell::text(line.fate.id()),
        number(line.baseline, &|metric| line.digits_before(metric)),
        number(line.current, &finer),
        change.map_or_else(Cell::empty, |(metric, (a, b))| difference(metric, a, b)),
        tolerance.map_or_else(Cell::empty, |t| Cell::number(t, Digits::Shortest(4))),
        if line.frames.is_empty() { Cell::text("") } else { Cell::text(named(&line.frames)) },
    ];
    Row::new(index.to_string(), labels, cells)
}

/// The frames that moved most.
pub fn moved(changes: &Changes) -> Table {
    let pictures = changes.frames.iter().any(|frame| frame.pictures.is_some());
    let mut columns = vec![
        Column::new("baseline", "Baseline").digits(Digits::Exact),
        Column::new("current", "Current").digits(Digits::Exact),
        Column::new("change", "Change").digits(Digits::Exact),
        Column::text("verdict", "Verdict"),
    ];
    if pictures {
        columns.extend([Column::text("before", "Picture before"), Column::text("after", "Picture after")]);
    }
    let row = |(r, m): (usize, &Move)| {
        let metric = titled(m.metric.title(), m.fitted);
        let labels = [m.table.as_str(), &m.sequence, &m.variant, &m.frame, &metric];
        let mut cells = vec![
            Cell::number(m.baseline, finer(m.metric)),
            Cell::number(m.current, finer(m.metric)),
            difference(m.metric, m.baseline, m.current),
            Cell::text(if m.worse { "worse" } else { "better" }),
        ];
        if pictures {
            let kept = m.pictures.clone().unwrap_or_default();
            cells.extend(kept.map(Cell::text));
        }
        Row::new(r.to_string(), labels, cells)
    };
    let count = changes.frames_moved;
    Table {
        sentences: match count > changes.frames.len() {
            true => {
                vec![format!("The first {} of {count} numbers of frames that moved", changes.frames.len())]
            }
            false => Vec::new(),
        },
        labels: labels(&[("frame", "Frame"), ("metric", "Metric")]),
        columns,
        rows: changes.frames.iter().enumerate().map(row).collect(),
        ..Table::new("frames", "Frames that moved most")
    }
}

/// Two digits more than tables print: what moved is smaller than what it is a movement of.
pub(super) fn finer(metric: MetricId) -> Digits {
    match metric.decimals() {
        0 => Digits::Decimals(0),
        decimals => Digits::Decimals(decimals + 2),
    }
}

fn difference(metric: MetricId, before: f64, after: f64) -> Cell {
    match after - before {
        change if change.is_finite() => Cell::difference(change, finer(metric)),
        // An infinite PSNR that stays one.
        _ if before == after => Cell::number(0.0, finer(metric)),
        change => Cell::text(if change > 0.0 { "+∞" } else { "−∞" }),
    }
}

fn named(frames: &[String]) -> String {
    let names = frames[..frames.len().min(NAMED)].join(", ");
    match frames.len().saturating_sub(NAMED) {
        0 => names,
        more => format!("{names} and {more} more"),
    }
}
