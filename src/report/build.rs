//! Results to a [`Table`] and comparisons.

use super::best;
use super::captions::{caption, count, ran_on};
use super::comparison::{Comparison, MetricDifference};
use super::differences::Pair;
use super::layout::{Entry, digits, shape};
use super::paper::beside;
use super::replicates::{Group, groups, spread};
use super::results::{FrameResult, SequenceResults, VariantResults};
use crate::experiment::{Column, Experiment, FittedOutcome, Options, PlannedTable, Source};
use skinsplat_table::{Cell, Content, RowKind, Table};

/// Failed or missing frames that a footnote names; the others are counted.
const NAMED_FRAMES: usize = 3;

/// What rows are means over.
pub(super) const SAMPLE_UNIT: &str = "frames";

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
    let groups = sequences.first().map_or_else(Vec::new, |first| groups(experiment, &first.variants));
    let mut add = |mut block: Vec<Entry>, over: &[SequenceResults], notes: &mut Notes| {
        best::mark(experiment, over, &groups, &mut block);
        for (entry, group) in block.into_iter().zip(&groups) {
            let id = &over[0].variants[group.members[0]].id;
            let compared = beside(experiment, planned.source, id, &entry, notes);
            entries.push(entry);
            entries.extend(compared);
        }
    };
    for sequence in sequences {
        let block = groups.iter().map(|group| measured(experiment, sequence, group, &mut notes)).collect();
        add(block, std::slice::from_ref(sequence), &mut notes);
    }
    if let Some(average) = &experiment.average
        && !sequences.is_empty()
    {
        let label = &average.label;
        let block =
            groups.iter().map(|group| mean(experiment, label, sequences, group, &mut notes)).collect();
        add(block, sequences, &mut notes);
    }
    let shape = shape(experiment.layout, &experiment.columns, entries);
    Table {
        sentences: [caption(experiment, planned.source)]
            .into_iter()
            .chain(ran_on(experiment, planned, options, sequences))
            .collect(),
        sample_unit: Some(SAMPLE_UNIT.to_owned()),
        labels: shape.labels,
        columns: shape.columns,
        rows: shape.rows,
        notes: notes.into_vec(),
        remarks: if planned.source == Source::Absent { Vec::new() } else { experiment.notes.clone() },
        ..Table::new(&experiment.id, &experiment.title)
    }
}

/// The numbers of a variant on a sequence: means over its seeds.
fn measured(experiment: &Experiment, sequence: &SequenceResults, group: &Group, notes: &mut Notes) -> Entry {
    let members = group.on(sequence);
    let missing = members.iter().map(|variant| variant.missing()).sum();
    let cell = |column: &Column| {
        let contents: Vec<Content> = members.iter().map(|variant| content(variant, column)).collect();
        let mut cell = over_seeds(&contents, column);
        cell.missing = missing;
        if let Some(reason) = &sequence.missing {
            // There is data, of which nothing can be scored.
            if sequence.data.is_some() {
                cell = Cell::new(Content::NotComputed, digits(column));
            }
            cell.notes.push(notes.index(format!("{}: {reason}", sequence.label)));
        } else if cell.content != Content::NotApplicable {
            for variant in members.iter().filter(|variant| variant.missing() > 0) {
                let at = format!("{}, {}", sequence.label, variant.label);
                cell.notes.push(notes.index(format!("{at}: {}", missing_frames(&variant.frames))));
            }
        }
        let scored = members.iter().all(|variant| variant.summary.is_some());
        if scored && cell.content == Content::NotComputed {
            let unfitted = members.iter().filter(|_| column.fitted).find_map(|variant| unfitted(variant));
            let note = match unfitted {
                Some(why) => format!("n/c: {}, {}: {why}", sequence.label, group.label),
                None => not_computed(column, &members),
            };
            cell.notes.push(notes.index(note));
        }
        cell
    };
    Entry {
        id: format!("{}/{}", sequence.id, sequence.variants[group.members[0]].id),
        sequence: sequence.label.clone(),
        variant: group.label.clone(),
        kind: RowKind::Measured,
        cells: experiment.columns.iter().map(cell).collect(),
        frames: members.iter().map(|variant| variant.scored()).sum(),
        missing,
    }
}

/// The mean of one number per seed, with its spread.
fn over_seeds(contents: &[Content], column: &Column) -> Cell {
    let values: Vec<f64> = contents.iter().filter_map(|content| content.value()).collect();
    let spread = if values.len() == contents.len() { spread(&values) } else { None };
    Cell::with_spread(mean_content(contents), spread, digits(column))
}

fn content(variant: &VariantResults, column: &Column) -> Content {
    match variant.value(column.shown()) {
        Some(value) => Content::number(value),
        // Tried and failed, or nobody tried.
        None if variant.summary.is_none() => match variant.frames.iter().any(|frame| frame.error.is_some()) {
            true => Content::NotComputed,
            false => Content::Missing,
        },
        None if column.metric.is_of_frames() => Content::NotComputed,
        None => Content::NotApplicable,
    }
}

/// Frames whose pose could not be fitted: how many, and why the first could not.
fn unfitted(variant: &VariantResults) -> Option<String> {
    let failed = |frame: &FrameResult| match &frame.fitted {
        Some(FittedOutcome::Failed(problem)) => Some(format!("{} ({problem})", frame.name)),
        Some(FittedOutcome::Scored { .. }) | None => None,
    };
    let failed: Vec<String> = variant.frames.iter().filter_map(failed).collect();
    let first = failed.first()?;
    Some(format!(
        "no pose was fitted in {} of {}: {first}",
        failed.len(),
        count(variant.frames.len(), "frame")
    ))
}

/// Why a column has no number: of a metric of motion what its frames say, else what the metric needs.
fn not_computed(column: &Column, variants: &[&VariantResults]) -> String {
    if column.metric.needs_before() {
        let frames = variants.iter().flat_map(|variant| &variant.frames);
        let scores = frames.filter_map(|f| if column.fitted { f.fitted_score() } else { f.score.as_ref() });
        let reasons: Vec<&String> =
            scores.filter_map(|score| score.not_computed.get(&column.metric)).collect();
        return format!("n/c: {} was computed for no frame ({})", column.title(), each_counted(&reasons));
    }
    let reason = match column.metric.metric().needs {
        "" => String::new(),
        needs => format!(" ({needs})"),
    };
    format!("n/c: {} was not computed for every frame{reason}", column.title())
}

/// Reasons, in order of first use, with how often where there are several: `the first frame (1), a gap before it (3)`.
fn each_counted(reasons: &[&String]) -> String {
    let mut counts: Vec<(&String, usize)> = Vec::new();
    for &reason in reasons {
        match counts.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => counts.push((reason, 1)),
        }
    }
    match counts.as_slice() {
        [] => "not asked for".to_owned(),
        [(reason, _)] => (*reason).clone(),
        _ => counts.iter().map(|(reason, n)| format!("{reason}: {n}")).collect::<Vec<_>>().join("; "),
    }
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
    group: &Group,
    notes: &mut Notes,
) -> Entry {
    let all = || sequences.iter().flat_map(|sequence| group.on(sequence));
    let missing: usize = all().map(|v| v.missing()).sum();
    let without = sequences.iter().find(|s| group.on(s).iter().any(|variant| variant.summary.is_none()));
    let cell = |column: &Column| {
        let of_seed = |&v: &usize| {
            let contents: Vec<Content> =
                sequences.iter().map(|sequence| content(&sequence.variants[v], column)).collect();
            mean_content(&contents)
        };
        let mut cell = over_seeds(&group.members.iter().map(of_seed).collect::<Vec<_>>(), column);
        cell.missing = missing;
        if let (Some(sequence), Content::Missing | Content::NotComputed) = (without, cell.content) {
            let note = format!("{label}, {}: no mean, {} has no value", group.label, sequence.label);
            cell.notes.push(notes.index(note));
        } else if missing > 0 && cell.content != Content::NotApplicable {
            let note = format!("{label}, {}: {} missing in all", group.label, count(missing, "frame"));
            cell.notes.push(notes.index(note));
        }
        if without.is_none() && cell.content == Content::NotComputed {
            let all: Vec<&VariantResults> = all().collect();
            cell.notes.push(notes.index(not_computed(column, &all)));
        }
        cell
    };
    Entry {
        id: format!("mean/{}", sequences[0].variants[group.members[0]].id),
        sequence: label.to_owned(),
        variant: group.label.clone(),
        kind: RowKind::Mean,
        cells: experiment.columns.iter().map(cell).collect(),
        frames: all().map(|v| v.scored()).sum(),
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

/// Every variant against the baseline, on each sequence and on all of them, and on all of them against what else it asks for.
pub(super) fn comparisons(experiment: &Experiment, sequences: &[SequenceResults]) -> Vec<Comparison> {
    let Some(first) = sequences.first() else { return Vec::new() };
    let groups = groups(experiment, &first.variants);
    let find = |id: &str| groups.iter().find(|group| group.is_called(id, experiment, &first.variants));
    let with_baseline: Vec<Pair<'_>> = find(&experiment.baseline).map_or_else(Vec::new, |baseline| {
        let others = groups.iter().filter(|group| group.label != baseline.label);
        others.map(|candidate| Pair { candidate, baseline }).collect()
    });
    let compare = |sequence: Option<String>, over: &[SequenceResults], pair: Pair<'_>| Comparison {
        sequence,
        variant: pair.candidate.label.clone(),
        baseline: pair.baseline.label.clone(),
        differences: differences(experiment, over, pair),
    };
    let mut all: Vec<Comparison> = Vec::new();
    for sequence in sequences {
        let one = std::slice::from_ref(sequence);
        all.extend(with_baseline.iter().map(|&pair| compare(Some(sequence.label.clone()), one, pair)));
    }
    let asked = groups.iter().flat_map(|candidate| {
        let variant = experiment.variant(&first.variants[candidate.members[0]].id);
        let against = variant.map_or(&[][..], |variant| variant.against.as_slice());
        let others = against.iter().filter_map(|id| find(id)).filter(|group| group.label != candidate.label);
        others.map(move |baseline| Pair { candidate, baseline })
    });
    let asked = asked.filter(|pair| !with_baseline.iter().any(|known| known.is(pair)));
    let whole = if sequences.len() > 1 { with_baseline.as_slice() } else { &[] };
    all.extend(whole.iter().copied().chain(asked).map(|pair| compare(None, sequences, pair)));
    all
}

fn differences(experiment: &Experiment, over: &[SequenceResults], pair: Pair<'_>) -> Vec<MetricDifference> {
    let columns = experiment.columns.iter().filter(|column| column.metric.is_of_frames());
    let difference = |column: &Column| {
        let (estimate, judgement) = pair.judged(experiment, over, column.shown()).unzip();
        MetricDifference {
            metric: column.metric,
            fitted: column.fitted,
            decimals: column.decimals(),
            estimate,
            judgement,
            over_seeds: pair.over_seeds(over, column.shown()),
        }
    };
    columns.map(difference).collect()
}

#[cfg(test)]
mod tests {
    use super::each_counted;

    #[test]
    fn reasons_are_counted_where_there_are_several() {
        let [first, gap] = ["the first frame", "a gap before it"].map(str::to_owned);
        assert_eq!(each_counted(&[]), "not asked for");
        assert_eq!(each_counted(&[&gap, &gap]), "a gap before it");
        assert_eq!(each_counted(&[&gap, &first, &gap]), "a gap before it: 2; the first frame: 1");
    }
}
