//! Results to a [`Table`].

use super::captions::{caption, count, ran_on};
use super::layout::{Entry, mark_best_per_sequence, shape};
use super::paper::{beside, printed_table};
use super::results::{FrameResult, SequenceResults, VariantResults};
use super::stats::paired;
use super::table::{Cell, Comparison, Content, MetricDifference, RowKind, Table};
use crate::experiment::{Column, Experiment, Options, PlannedTable, Source};
use crate::metrics::MetricKind;

/// Failed or missing frames that a footnote names; the others are counted.
const NAMED_FRAMES: usize = 3;

/// Footnotes in order of first use.
#[derive(Default)]
pub(super) struct Notes(Vec<String>);

impl Notes {
    /// The index of the note, which is added if it is new.
    pub(super) fn index(&mut self, note: String) -> usize {
        if let Some(known) = self.0.iter().position(|n| *n == note) {
            return known;
        }
        self.0.push(note);
        self.0.len() - 1
    }

    /// The notes, in order.
    pub(super) fn into_vec(self) -> Vec<String> {
        self.0
    }
}

/// The table of an experiment.
pub(super) fn table(
    experiment: &Experiment,
    planned: &PlannedTable,
    options: &Options,
    sequences: &[SequenceResults],
) -> Table {
    let mut notes = Notes::default();
    let mut entries: Vec<Entry> = Vec::new();
    for sequence in sequences {
        for variant in &sequence.variants {
            let entry = measured(experiment, sequence, variant, &mut notes);
            let compared = beside(experiment, planned.source, &variant.id, &entry, &mut notes);
            entries.push(entry);
            entries.extend(compared);
        }
    }
    if let Some(average) = &experiment.average
        && !sequences.is_empty()
    {
        for (v, variant) in sequences[0].variants.iter().enumerate() {
            let entry = mean(experiment, &average.label, sequences, v, &mut notes);
            let compared = beside(experiment, planned.source, &variant.id, &entry, &mut notes);
            entries.push(entry);
            entries.extend(compared);
        }
    }
    mark_best_per_sequence(&mut entries, &experiment.columns);
    let shape = shape(experiment.layout, &experiment.columns, entries);
    Table {
        id: experiment.id.clone(),
        title: experiment.title.clone(),
        caption: caption(experiment, planned.source),
        ran_on: ran_on(experiment, planned, options, sequences),
        source: planned.source,
        labels: shape.labels,
        columns: shape.columns,
        rows: shape.rows,
        notes: notes.into_vec(),
        remarks: if planned.source == Source::Absent { Vec::new() } else { experiment.notes.clone() },
        comparisons: comparisons(experiment, sequences),
        paper: experiment.paper.as_ref().map(|paper| Box::new(printed_table(experiment, paper))),
    }
}

/// The numbers of a variant on a sequence.
fn measured(
    experiment: &Experiment,
    sequence: &SequenceResults,
    variant: &VariantResults,
    notes: &mut Notes,
) -> Entry {
    let at = format!("{}, {}", sequence.label, variant.label);
    let missing = variant.missing();
    let cell = |column: &Column| {
        let content = content(variant, column.metric);
        let mut cell = Cell { missing, ..Cell::new(content, column.decimals()) };
        if let Some(reason) = &sequence.missing {
            cell.notes.push(notes.index(format!("{}: {reason}", sequence.label)));
        } else if missing > 0 && content != Content::NotApplicable {
            cell.notes.push(notes.index(format!("{at}: {}", missing_frames(&variant.frames))));
        }
        if content == Content::NotComputed {
            cell.notes.push(notes.index(not_computed(column)));
        }
        cell
    };
    Entry {
        sequence: sequence.label.clone(),
        variant: variant.label.clone(),
        kind: RowKind::Measured,
        cells: experiment.columns.iter().map(cell).collect(),
        frames: variant.scored(),
        missing,
    }
}

fn content(variant: &VariantResults, metric: MetricKind) -> Content {
    match variant.value(metric) {
        Some(value) => Content::number(value),
        None if variant.summary.is_none() => Content::Missing,
        None if metric == MetricKind::Lpips => Content::NotComputed,
        None => Content::NotApplicable,
    }
}

fn not_computed(column: &Column) -> String {
    format!(
        "n/c: {} was not computed for every frame (it needs the network's weights and images of its minimum size)",
        column.title()
    )
}

/// `3 of 12 frames missing: a (error), b (not run), ...`.
fn missing_frames(frames: &[FrameResult]) -> String {
    let missing: Vec<&FrameResult> = frames.iter().filter(|frame| frame.score.is_none()).collect();
    let name = |frame: &&FrameResult| match &frame.error {
        Some(error) => format!("{} (failed: {error})", frame.name),
        None => format!("{} (not run)", frame.name),
    };
    let mut named: Vec<String> = missing.iter().take(NAMED_FRAMES).map(name).collect();
    if missing.len() > NAMED_FRAMES {
        named.push(format!("{} more", missing.len() - NAMED_FRAMES));
    }
    format!("{} of {} missing: {}", missing.len(), count(frames.len(), "frame"), named.join(", "))
}

/// The mean over sequences of a variant. There is none if a sequence has no value at all.
fn mean(
    experiment: &Experiment,
    label: &str,
    sequences: &[SequenceResults],
    variant: usize,
    notes: &mut Notes,
) -> Entry {
    let all: Vec<&VariantResults> = sequences.iter().map(|sequence| &sequence.variants[variant]).collect();
    let missing: usize = all.iter().map(|v| v.missing()).sum();
    let without = sequences.iter().find(|sequence| sequence.variants[variant].summary.is_none());
    let cell = |column: &Column| {
        let contents: Vec<Content> = all.iter().map(|v| content(v, column.metric)).collect();
        let mean = mean_content(&contents);
        let mut cell = Cell { missing, ..Cell::new(mean, column.decimals()) };
        if let (Some(sequence), Content::Missing) = (without, mean) {
            let note = format!("{label}, {}: no mean, {} has no value", all[0].label, sequence.label);
            cell.notes.push(notes.index(note));
        } else if missing > 0 && mean != Content::NotApplicable {
            let note = format!("{label}, {}: {} missing in all", all[0].label, count(missing, "frame"));
            cell.notes.push(notes.index(note));
        }
        if mean == Content::NotComputed {
            cell.notes.push(notes.index(not_computed(column)));
        }
        cell
    };
    Entry {
        sequence: label.to_owned(),
        variant: all[0].label.clone(),
        kind: RowKind::Mean,
        cells: experiment.columns.iter().map(cell).collect(),
        frames: all.iter().map(|v| v.scored()).sum(),
        missing,
    }
}

/// The mean, or why there is none.
fn mean_content(contents: &[Content]) -> Content {
    for none in [Content::Missing, Content::NotComputed, Content::NotApplicable] {
        if contents.contains(&none) {
            return none;
        }
    }
    let values = contents.iter().filter_map(|content| content.value());
    Content::number(values.sum::<f64>() / contents.len() as f64)
}

/// Every variant against the baseline, on each sequence and on all of them.
fn comparisons(experiment: &Experiment, sequences: &[SequenceResults]) -> Vec<Comparison> {
    let Some(first) = sequences.first() else { return Vec::new() };
    let Some(b) = first.variants.iter().position(|v| v.id == experiment.baseline) else { return Vec::new() };
    let others: Vec<usize> = (0..first.variants.len()).filter(|&v| v != b).collect();
    let compare = |sequence: Option<String>, over: &[SequenceResults], v: usize| Comparison {
        sequence,
        variant: first.variants[v].label.clone(),
        baseline: first.variants[b].label.clone(),
        differences: differences(experiment, over, b, v),
    };
    let mut all: Vec<Comparison> = Vec::new();
    for sequence in sequences {
        let one = std::slice::from_ref(sequence);
        all.extend(others.iter().map(|&v| compare(Some(sequence.label.clone()), one, v)));
    }
    if sequences.len() > 1 {
        all.extend(others.iter().map(|&v| compare(None, sequences, v)));
    }
    all
}

fn differences(
    experiment: &Experiment,
    sequences: &[SequenceResults],
    baseline: usize,
    variant: usize,
) -> Vec<MetricDifference> {
    let columns = experiment.columns.iter().filter(|column| column.metric != MetricKind::Splats);
    let difference = |column: &Column| {
        let of_sequence = |sequence: &SequenceResults| -> Vec<f64> {
            let pairs = sequence.variants[variant].frames.iter().zip(&sequence.variants[baseline].frames);
            pairs
                .filter_map(|(ours, theirs)| Some(ours.value(column.metric)? - theirs.value(column.metric)?))
                .collect()
        };
        let sequences: Vec<Vec<f64>> = sequences.iter().map(of_sequence).collect();
        MetricDifference {
            metric: column.metric,
            decimals: column.decimals(),
            paired: paired(&sequences, column.metric.higher_is_better()),
        }
    };
    columns.map(difference).collect()
}
