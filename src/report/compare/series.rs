//! One variant on one sequence, before and after.

use super::{Changes, Fate, Line, Move, Tolerances};
use crate::experiment::Shown;
use crate::report::results::{FrameResult, SequenceResults, TableResults, VariantResults};
use skinsplat_metrics::{FrameScore, MetricId, Protocol, Summary};
use std::collections::BTreeMap;

/// A variant on a sequence of a table.
#[derive(Clone, Copy)]
pub(super) struct Series<'a> {
    pub(super) table: &'a TableResults,
    pub(super) sequence: &'a SequenceResults,
    pub(super) variant: &'a VariantResults,
}

/// The same in two documents.
pub(super) struct Pair<'a> {
    pub(super) before: Series<'a>,
    pub(super) after: Series<'a>,
}

impl<'a> Series<'a> {
    /// A line on all of it, without a number.
    pub(super) fn line(&self, fate: Fate) -> Line {
        Line::new(&self.table.experiment, [self.sequence.id.clone(), self.variant.id.clone()], fate)
    }

    /// The scored frames by name; of frames of one name (of several cameras, say) the second is `NAME (2)`.
    fn frames(&self) -> BTreeMap<String, &'a FrameResult> {
        let mut named: BTreeMap<&str, usize> = BTreeMap::new();
        let of_all = self.variant.frames.iter().map(|frame| {
            let nth = named.entry(&frame.name).or_default();
            *nth += 1;
            (if *nth == 1 { frame.name.clone() } else { format!("{} ({nth})", frame.name) }, frame)
        });
        of_all.filter(|(_, frame)| frame.score.is_some()).collect()
    }

    /// The aggregate over some of its frames, of poses as they are given or `fitted`; none if the protocol's code is not at hand, or
    /// not every pose was fitted.
    fn over(&self, frames: &[&FrameResult], fitted: bool) -> Option<Summary> {
        let protocol = Protocol::parse(&self.table.protocol.id).ok()?;
        let score =
            |frame: &&FrameResult| if fitted { frame.fitted_score() } else { frame.score.as_ref() }.cloned();
        let scores: Option<Vec<FrameScore>> = frames.iter().map(score).collect();
        protocol.aggregate(&scores?).ok()
    }
}

impl Pair<'_> {
    /// Adds what moved.
    pub(super) fn compare(&self, tolerances: &Tolerances, changes: &mut Changes) {
        changes.compared += 1;
        let (before, after) = (self.before.frames(), self.after.frames());
        let only = |a: &BTreeMap<String, &FrameResult>, b: &BTreeMap<String, &FrameResult>| -> Vec<String> {
            a.keys().filter(|name| !b.contains_key(*name)).cloned().collect()
        };
        let (lost, gained) = (only(&before, &after), only(&after, &before));
        let shared: Vec<&String> = before.keys().filter(|name| after.contains_key(*name)).collect();
        let whole = lost.is_empty() && gained.is_empty();
        for (frames, fate) in [(lost, Fate::Missing), (gained, Fate::New)] {
            if !frames.is_empty() {
                changes.lines.push(Line { frames, ..self.before.line(fate) });
            }
        }
        if shared.is_empty() {
            changes.compared -= 1;
            return;
        }
        for fitted in [false, true] {
            let of = |frames: &BTreeMap<String, &FrameResult>, series: &Series<'_>| match (whole, fitted) {
                (true, false) => series.variant.summary.clone(),
                (true, true) => series.variant.fitted.clone(),
                (false, _) => {
                    let shared = shared.iter().filter_map(|name| frames.get(*name).copied());
                    series.over(&shared.collect::<Vec<_>>(), fitted)
                }
            };
            let summaries = [of(&before, &self.before), of(&after, &self.after)];
            self.numbers(summaries, fitted, tolerances, changes);
        }
        for name in shared {
            for metric in MetricId::all() {
                for fitted in [false, true] {
                    let shown = Shown { metric, fitted };
                    self.frame(name, [before[name], after[name]], shown, tolerances, changes);
                }
            }
        }
    }

    /// The aggregates, of poses as they are given or `fitted`.
    fn numbers(
        &self,
        [before, after]: [Option<Summary>; 2],
        fitted: bool,
        tolerances: &Tolerances,
        changes: &mut Changes,
    ) {
        let value = |summary: &Option<Summary>, metric| summary.as_ref().and_then(|s| s.value(metric));
        for metric in MetricId::all() {
            let (baseline, current) = (value(&before, metric), value(&after, metric));
            let tolerance = tolerances.of(&self.before.table.experiment, metric);
            let fate = match (baseline, current) {
                (Some(a), Some(b)) => Fate::of(metric, a, b, tolerance),
                (Some(_), None) => Fate::Missing,
                (None, Some(_)) => Fate::New,
                (None, None) => continue,
            };
            let (metric, tolerance) = (Some(metric), Some(tolerance));
            let line = Line { metric, fitted, baseline, current, tolerance, ..self.before.line(fate) };
            changes.lines.push(line);
        }
    }

    /// A number of a frame: it shows where a movement comes from, and counts by itself where that was asked for.
    fn frame(
        &self,
        name: &str,
        [before, after]: [&FrameResult; 2],
        shown: Shown,
        tolerances: &Tolerances,
        changes: &mut Changes,
    ) {
        let Shown { metric, fitted } = shown;
        let (Some(a), Some(b)) = (before.value(shown), after.value(shown)) else { return };
        if a == b {
            return;
        }
        let table = &self.before.table.experiment;
        changes.frames.push(Move {
            table: table.clone(),
            sequence: self.before.sequence.id.clone(),
            label: self.before.sequence.label.clone(),
            variant: self.before.variant.id.clone(),
            frame: name.to_owned(),
            metric,
            fitted,
            baseline: a,
            current: b,
            tolerances: (b - a).abs() / tolerances.of(table, metric),
            worse: (b < a) == metric.higher_is_better(),
            pictures: None,
        });
        if let Some(tolerance) = tolerances.of_frame(metric)
            && Fate::of(metric, a, b, tolerance) == Fate::Regressed
        {
            changes.lines.push(Line {
                metric: Some(metric),
                fitted,
                baseline: Some(a),
                current: Some(b),
                tolerance: Some(tolerance),
                frames: vec![name.to_owned()],
                ..self.before.line(Fate::Regressed)
            });
        }
    }
}
