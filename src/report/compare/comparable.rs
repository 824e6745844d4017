//! Which parts of two documents compare, and why others do not.

use super::Note;
use super::series::{Pair, Series};
use crate::experiment::PoseNoise;
use crate::report::results::{Results, SequenceResults, TableResults, VariantResults};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// What is in both documents, and what is in one.
#[derive(Default)]
pub(super) struct Pairs<'a> {
    /// In both, of the same data and protocol, in the order of the baseline.
    pub(super) both: Vec<Pair<'a>>,
    /// Of the baseline alone.
    pub(super) missing: Vec<Series<'a>>,
    /// Of the current results alone.
    pub(super) new: Vec<Series<'a>>,
    /// Whether something in both was left out.
    left_out: bool,
}

/// Pairs the sequences and variants of two documents.
pub(super) fn comparable<'a>(
    baseline: &'a Results,
    current: &'a Results,
    notes: &mut Vec<Note>,
) -> Pairs<'a> {
    notes.extend(circumstances(baseline, current));
    let mut pairs = Pairs::default();
    for table in &baseline.tables {
        match current.tables.iter().find(|other| other.experiment == table.experiment) {
            None => pairs.missing.extend(all(table)),
            Some(other) => match otherwise_made(table, other) {
                None => pairs.sequences(table, other, notes),
                Some(text) => pairs.leave_out(text, notes),
            },
        }
    }
    let of_baseline =
        |table: &&TableResults| baseline.tables.iter().any(|t| t.experiment == table.experiment);
    pairs.new.extend(current.tables.iter().filter(|table| !of_baseline(table)).flat_map(all));
    pairs
}

impl<'a> Pairs<'a> {
    fn leave_out(&mut self, text: String, notes: &mut Vec<Note>) {
        self.left_out = true;
        notes.push(Note { left_out: true, text });
    }

    /// The sequences of a table that both have.
    fn sequences(&mut self, table: &'a TableResults, other: &'a TableResults, notes: &mut Vec<Note>) {
        notes.extend(other_ways(table, other).into_iter().map(|text| Note { left_out: false, text }));
        for sequence in &table.sequences {
            match other.sequences.iter().find(|of_other| of_other.id == sequence.id) {
                None => self.missing.extend(of_sequence(table, sequence)),
                Some(of_other) => match other_data(sequence, of_other) {
                    None => self.variants((table, sequence), (other, of_other), notes),
                    Some(what) => {
                        let at = format!("{}: {}", table.experiment, sequence.id);
                        self.leave_out(format!("{at}: {what} of the same name: not compared"), notes);
                    }
                },
            }
        }
        let of_baseline = |s: &&SequenceResults| table.sequences.iter().any(|own| own.id == s.id);
        let new = other.sequences.iter().filter(|sequence| !of_baseline(sequence));
        self.new.extend(new.flat_map(|sequence| of_sequence(other, sequence)));
    }

    /// The variants of a sequence that both have.
    fn variants(
        &mut self,
        (table, before): (&'a TableResults, &'a SequenceResults),
        (other, after): (&'a TableResults, &'a SequenceResults),
        notes: &mut Vec<Note>,
    ) {
        for series in of_sequence(table, before) {
            match of_sequence(other, after).find(|of_other| of_other.variant.id == series.variant.id) {
                Some(of_other) if of_other.variant.pose_noise != series.variant.pose_noise => {
                    let at = format!("{}: {}: {}", table.experiment, before.id, series.variant.id);
                    let [a, b] = [series, of_other].map(|series| noise(series.variant));
                    self.leave_out(format!("{at}: {a} in the baseline, {b} now: not compared"), notes);
                }
                Some(of_other) => self.both.push(Pair { before: series, after: of_other }),
                None => self.missing.push(series),
            }
        }
        // Also those that the baseline names and has no score of.
        let scored = |id: &str| of_sequence(table, before).any(|own| own.variant.id == id);
        self.new.extend(of_sequence(other, after).filter(|series| !scored(&series.variant.id)));
    }

    /// Why there was nothing to compare.
    pub(super) fn nothing_shared(&self, baseline: &Results, current: &Results) -> Note {
        let tables = |results: &Results| {
            let ids: Vec<&str> = results.tables.iter().map(|table| table.experiment.as_str()).collect();
            if ids.is_empty() { "no table".to_owned() } else { ids.join(", ") }
        };
        let what = if self.left_out { "nothing that compares" } else { "nothing with scores in common" };
        let text = format!(
            "{what}: the baseline has {}, the current results have {}",
            tables(baseline),
            tables(current)
        );
        Note { left_out: true, text }
    }
}

/// Every sequence and variant of a table that has scores.
fn all(table: &TableResults) -> impl Iterator<Item = Series<'_>> {
    table.sequences.iter().flat_map(move |sequence| of_sequence(table, sequence))
}

fn of_sequence<'a>(
    table: &'a TableResults,
    sequence: &'a SequenceResults,
) -> impl Iterator<Item = Series<'a>> {
    let series = move |variant| Series { table, sequence, variant };
    sequence.variants.iter().filter(|variant| variant.scored() > 0).map(series)
}

/// Why the numbers of two tables do not compare.
fn otherwise_made(before: &TableResults, after: &TableResults) -> Option<String> {
    let differs = |what: &str, a: String, b: String| {
        let at = &before.experiment;
        (a != b).then(|| format!("{at}: {what} {a} in the baseline, {b} now: not compared"))
    };
    differs("protocol", before.protocol.to_string(), after.protocol.to_string()).or_else(|| {
        differs("version of the experiment", before.version.to_string(), after.version.to_string())
    })
}

/// Which data of two sequences differs, as far as the documents say which it was.
fn other_data(before: &SequenceResults, after: &SequenceResults) -> Option<&'static str> {
    let (before, after) = (before.data.as_ref()?, after.data.as_ref()?);
    if before.test != after.test {
        return Some("other test data (images, cameras, poses or body)");
    }
    (before.train != after.train).then_some("other training data")
}

/// The noise on the poses of a variant, in words that tell two apart.
fn noise(variant: &VariantResults) -> String {
    match &variant.pose_noise {
        None => "poses without noise".to_owned(),
        Some(PoseNoise { degrees, seed, version }) => {
            format!("pose noise of {degrees} degrees (seed {seed}, version {version})")
        }
    }
}

/// What one id stands for in two versions of a table, where it is not the same: the numbers compare, and that may be why they moved.
fn other_ways(table: &TableResults, other: &TableResults) -> Vec<String> {
    let mut ways = Vec::new();
    let at = &table.experiment;
    if let (Some(before), Some(after)) = (&table.test_pose, &other.test_pose)
        && before != after
    {
        let differ = "test poses are fitted with other options than in the baseline (`test_pose`)";
        ways.push(format!("{at}: {differ}"));
    }
    if table.resolution != other.resolution {
        let [before, now] = [table, other].map(|of| match of.resolution {
            Some(side) => format!("of {side} pixels"),
            None => "as the profile has them".to_owned(),
        });
        ways.push(format!("{at}: images {before} in the baseline, {now} now"));
    }
    if table.antialiased != other.antialiased {
        let [before, now] = [table, other].map(|of| if of.antialiased { "antialiased" } else { "plain" });
        ways.push(format!("{at}: the {before} rasterizer drew in the baseline, the {now} one now"));
    }
    let now: BTreeMap<&str, &VariantResults> = other
        .sequences
        .iter()
        .flat_map(|s| &s.variants)
        .map(|variant| (variant.id.as_str(), variant))
        .collect();
    let mut seen = BTreeSet::new();
    for variant in table.sequences.iter().flat_map(|s| &s.variants).filter(|variant| seen.insert(&variant.id))
    {
        let Some(now) = now.get(variant.id.as_str()) else { continue };
        for (what, a, b) in [
            ("avatar", json(&variant.avatar), json(&now.avatar)),
            ("SH degree", json(&variant.sh_degree), json(&now.sh_degree)),
            ("strategy", json(&variant.strategy), json(&now.strategy)),
            ("takes", json(&variant.takes), json(&now.takes)),
        ] {
            if a != b {
                ways.push(format!("{at}: {}: {what} {a} in the baseline, {b} now", variant.id));
            }
        }
    }
    ways
}

/// A value as it stands in the documents.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// What differs between the runs, though their numbers compare.
fn circumstances(baseline: &Results, current: &Results) -> Vec<Note> {
    let mut notes = Vec::new();
    let mut say = |text: String| notes.push(Note { left_out: false, text });
    for (results, whose) in [(baseline, "baseline"), (current, "current results")] {
        if results.tables.iter().flat_map(|t| &t.sequences).any(|s| s.missing.is_none() && s.data.is_none()) {
            let schema = results.schema;
            say(format!(
                "{whose}: schema {schema} has no digests of the data: whether the data is the same was not checked"
            ));
        }
    }
    if baseline.options.profile != current.options.profile {
        let [a, b] = [baseline, current].map(profile);
        say(format!("profile: {a} in the baseline, {b} now"));
    }
    if baseline.options.lpips_weights != current.options.lpips_weights {
        say("the weights of LPIPS are others than the baseline's".to_owned());
    }
    let (a, b) = (baseline.code, current.code);
    for (what, a, b) in [
        ("fit", a.fit, b.fit),
        ("strategy", a.strategy, b.strategy),
        ("render", a.render, b.render),
        ("metrics", a.metrics, b.metrics),
    ] {
        if a != b {
            say(format!("code version of {what}: {a} in the baseline, {b} now"));
        }
    }
    notes
}

/// The profile in words that tell two apart.
fn profile(results: &Results) -> String {
    let profile = &results.options.profile;
    let bound = |bound: Option<u32>, what: &str| bound.map_or_else(String::new, |n| format!(", {n} {what}"));
    let (side, fits) = (bound(profile.resolution, "pixels"), bound(profile.fit_iterations, "iterations"));
    format!("{}{side}{fits}, edges of {} mm", profile.id, profile.avatar_edge_mm)
}
