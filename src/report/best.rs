//! Which numbers are bold: the best, with everything that is not decided to be worse.

use super::differences::Pair;
use super::layout::{Entry, direction};
use super::replicates::Group;
use super::results::SequenceResults;
use crate::experiment::{Column, Experiment};
use skinsplat_statistics::Verdict;
use skinsplat_table::{Cell, Direction, mark_best};

/// Marks the rows of one sequence or of the mean over sequences, one per group, in every column that is an outcome. What has no
/// frames, such as a count, is marked by its printed digits.
pub(super) fn mark(
    experiment: &Experiment,
    over: &[SequenceResults],
    groups: &[Group],
    entries: &mut [Entry],
) {
    let directions: Vec<Option<Direction>> =
        experiment.columns.iter().map(|column| column.is_outcome().then(|| direction(column))).collect();
    let mut rows: Vec<&mut Vec<Cell>> = entries.iter_mut().map(|entry| &mut entry.cells).collect();
    mark_best(&mut rows, &directions);
    for (c, column) in experiment.columns.iter().enumerate() {
        if column.metric.is_of_frames() && entries.iter().any(|entry| entry.cells[c].best) {
            mark_undecided(experiment, over, groups, entries, c, column);
        }
    }
}

/// Marks a column that has a best number: that one, and those whose frames do not decide that they are worse.
fn mark_undecided(
    experiment: &Experiment,
    over: &[SequenceResults],
    groups: &[Group],
    entries: &mut [Entry],
    c: usize,
    column: &Column,
) {
    let sign = if column.metric.higher_is_better() { 1.0 } else { -1.0 };
    let value = |entry: &Entry| entry.cells[c].content.value().map(|value| sign * value);
    let mut best: Option<(usize, f64)> = None;
    for (i, entry) in entries.iter().enumerate() {
        if let Some(value) = value(entry)
            && best.is_none_or(|(_, most)| value > most)
        {
            best = Some((i, value));
        }
    }
    let Some((best, _)) = best else { return };
    for (i, entry) in entries.iter_mut().enumerate() {
        let cell = &mut entry.cells[c];
        if i == best || cell.content.value().is_none() {
            cell.best = i == best;
            continue;
        }
        let pair = Pair { candidate: &groups[i], baseline: &groups[best] };
        // Without differences (an infinite number) the printed digits stay what decides.
        if let Some((_, judgement)) = pair.judged(experiment, over, column.shown()) {
            cell.best = judgement.verdict != Verdict::Worse;
        }
    }
}
