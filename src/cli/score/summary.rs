//! Scores of frames as a table: a row per variant, under its frame.

use super::{Means, Scored};
use serde_json::{Map, Value};
use skinsplat_metrics::{FrameScore, MetricId, ProtocolId, Summary, Values};
use skinsplat_table::{Cell, Column, Content, Digits, Direction, Label, Row, RowKind, Table};
use std::collections::BTreeMap;

/// As printed.
const DIGITS: Digits = Digits::Decimals(6);

/// The frames, and under several their means.
pub(super) fn table(scored: &[Scored], means: Option<&Means>, summary: Option<&Summary>) -> Table {
    let mut table = Table {
        labels: vec![Label::new("frame", "Frame").once(), Label::new("metric", "Metric")],
        columns: vec![Column::new("value", "Value").digits(DIGITS)],
        ..Table::new("scores", "Scores")
    };
    for frame in scored {
        Frame { name: &frame.name, kind: RowKind::Measured, table: &mut table }.add(frame);
    }
    if let Some(means) = means {
        let name = format!("mean of {} frames", scored.len());
        let mut mean = Frame { name: &name, kind: RowKind::Mean, table: &mut table };
        mean.values(&means.variants);
        mean.missing(&means.not_computed);
        if let Some(Summary { protocol, values, not_computed, .. }) = summary {
            mean.protocol(protocol, values, not_computed);
        }
    }
    table
}

/// The frames and the protocol's aggregate of them: a column per metric.
pub(super) fn under_protocol(protocol: &ProtocolId, scored: &[Scored], summary: Option<&Summary>) -> Table {
    let digits = |metric: MetricId| Digits::Decimals(metric.decimals() + 1);
    let column = |metric: MetricId| {
        let better = Direction::higher_if(metric.higher_is_better());
        Column::new(metric.id(), metric.title()).digits(digits(metric)).better(better)
    };
    let mut table = Table {
        sentences: vec![format!("Protocol {protocol}")],
        labels: vec![Label::new("frame", "Frame")],
        columns: MetricId::of_images().map(column).collect(),
        ..Table::new("scores", "Scores")
    };
    let mut add = |name: &str, kind: RowKind, value: &dyn Fn(MetricId) -> Result<f64, String>| {
        let notes = &mut table.notes;
        let cell = |metric: MetricId| match value(metric) {
            Ok(value) => Cell::number(value, digits(metric)),
            Err(note) => {
                Cell { notes: vec![index(notes, &note)], ..Cell::new(Content::NotComputed, digits(metric)) }
            }
        };
        let row = Row::new(name, [name], MetricId::of_images().map(cell).collect());
        table.rows.push(Row { kind, ..row });
    };
    for frame in scored {
        add(&frame.name, RowKind::Measured, &|metric| match &frame.protocol {
            Some(score) => score.values.get(metric).ok_or_else(|| without(&score.not_computed, metric)),
            None => {
                Err(format!("not computed: {}", frame.protocol_not_computed.as_deref().unwrap_or_default()))
            }
        });
    }
    if let Some(summary) = summary {
        let name = match summary.frames {
            all if all == scored.len() as u64 => format!("mean of {all}"),
            some => format!("mean of {some} of {}", scored.len()),
        };
        add(&name, RowKind::Mean, &|metric| {
            summary.value(metric).ok_or_else(|| without(&summary.not_computed, metric))
        });
    }
    table
}

/// What is said where a metric has no value.
fn without(missing: &BTreeMap<MetricId, String>, metric: MetricId) -> String {
    format!("{} not computed: {}", metric.title(), reason(missing, metric))
}

/// Why a metric was not computed.
fn reason(missing: &BTreeMap<MetricId, String>, metric: MetricId) -> String {
    missing.get(&metric).map_or("no reason given", String::as_str).to_owned()
}

/// The index of a note, which is added if it is new.
fn index(notes: &mut Vec<String>, note: &str) -> usize {
    let index = notes.iter().position(|known| known == note).unwrap_or(notes.len());
    if index == notes.len() {
        notes.push(note.to_owned());
    }
    index
}

/// The rows of one frame, or of the mean.
struct Frame<'a> {
    name: &'a str,
    kind: RowKind,
    table: &'a mut Table,
}

impl Frame<'_> {
    fn add(&mut self, frame: &Scored) {
        self.values(&frame.variants);
        self.missing(&frame.not_computed);
        if let Some(FrameScore { protocol, values, not_computed, .. }) = &frame.protocol {
            self.protocol(protocol, values, not_computed);
        }
    }

    fn missing(&mut self, reasons: &Map<String, Value>) {
        for (id, reason) in reasons {
            self.none(id, &format!("{id} not computed: {}", reason.as_str().unwrap_or_default()));
        }
    }

    fn values(&mut self, values: &Map<String, Value>) {
        for (id, value) in values {
            // JSON has no infinity.
            self.push(id, Cell::number(value.as_f64().unwrap_or(f64::INFINITY), DIGITS));
        }
    }

    /// Every metric of frames under a protocol.
    fn protocol(&mut self, protocol: &ProtocolId, values: &Values, missing: &BTreeMap<MetricId, String>) {
        for metric in MetricId::of_images() {
            let id = format!("protocol {protocol}: {}", metric.id());
            match values.get(metric) {
                Some(value) => self.push(&id, Cell::number(value, DIGITS)),
                None => {
                    self.none(&id, &format!("{id} not computed ({})", reason(missing, metric)));
                }
            }
        }
    }

    /// A row without a number, and the note that says why.
    fn none(&mut self, id: &str, note: &str) {
        let index = index(&mut self.table.notes, note);
        self.push(id, Cell { notes: vec![index], ..Cell::new(Content::NotComputed, DIGITS) });
    }

    fn push(&mut self, id: &str, cell: Cell) {
        let row = Row::new(format!("{}/{id}", self.name), [self.name, id], vec![cell]);
        self.table.rows.push(Row { kind: self.kind, ..row });
    }
}
