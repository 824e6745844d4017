//! Real data against the numbers that the paper prints.

use super::{Changes, Fate, Line, Note, Tolerances};
use crate::experiment::{Options, Source};
use crate::report::results::{Results, TableResults, VariantResults};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Row, RowKind, Table};
use std::collections::BTreeSet;

/// Standard deviations over our seeds by which a number may miss the printed one.
const SPREADS: f64 = 2.0;

/// Judges every number that has a printed one beside it. A number agrees if it is no farther from the printed one than half of that
/// one's last digit, or the tolerance that was given instead, and twice our standard deviation over seeds, where there are several.
/// Printed rows of which the results have nothing are missing. Numbers of stand-in data are not judged: they are of other people.
pub fn against_paper(results: &Results, tolerances: &Tolerances) -> Changes {
    let mut changes = Changes { paper: true, ..Changes::default() };
    tolerances.note_unknown(&[results], &mut changes.notes);
    for table in &results.tables {
        let Some(paper) = &table.paper else { continue };
        match table.source {
            Source::Own => judge(table, paper, tolerances, &mut changes),
            Source::StandIn => changes.notes.push(not_judged(table, "stand-in data, which does not compare")),
            Source::Absent => changes.notes.push(not_judged(table, "its data is not here")),
        }
    }
    if results.tables.iter().all(|table| table.paper.is_none()) {
        let text = "no table has printed numbers: not judged".to_owned();
        changes.notes.push(Note { left_out: true, text });
    }
    changes.notes.extend(less_than_printed(results));
    changes.finish()
}

/// What keeps the results from being of all that the paper's are of.
fn less_than_printed(results: &Results) -> Vec<Note> {
    let mut notes = Vec::new();
    let mut say = |text: String| notes.push(Note { left_out: true, text });
    let Options { profile, subset, .. } = &results.options;
    if !subset.is_everything() {
        say("partial: only a part of the data was asked for".to_owned());
    }
    let bounds = [
        profile.max_test_frames.map(|n| format!("at most {n} test frames per sequence")),
        profile.resolution.map(|side| format!("images of at most {side} pixels")),
    ];
    let bounds: Vec<String> = bounds.into_iter().flatten().collect();
    if !bounds.is_empty() {
        say(format!("profile {}: {}; the printed numbers are of all", profile.id, bounds.join(", ")));
    }
    for table in results.tables.iter().filter(|table| table.source == Source::Own && table.paper.is_some()) {
        let variants = table.sequences.iter().flat_map(|sequence| &sequence.variants);
        let missing: usize = variants.map(VariantResults::missing).sum();
        if missing > 0 {
            say(format!("{}: {missing} scores of frames are missing", table.experiment));
        }
    }
    notes
}

fn not_judged(table: &TableResults, why: &str) -> Note {
    Note { left_out: true, text: format!("{}: {why}: not judged", table.experiment) }
}

/// The rows of a table that have a printed one beside them, and the printed ones that stand beside none.
fn judge(results: &TableResults, paper: &Table, tolerances: &Tolerances, changes: &mut Changes) {
    let table = &results.table;
    let mut compared = BTreeSet::new();
    for (r, row) in table.rows.iter().enumerate().filter(|(_, row)| row.kind == RowKind::Paper) {
        let Some(ours) = table.rows[..r].iter().rfind(|own| stands_beside(row, own)) else { continue };
        for (column, (cell, printed)) in table.columns.iter().zip(ours.cells.iter().zip(&row.cells)) {
            let at = ids(results, place(table, column, ours));
            if let Some(line) = line(results, at.clone(), column, [cell, printed], tolerances) {
                compared.insert(at);
                changes.lines.push(line);
            }
        }
    }
    changes.compared += compared.len();
    if compared.is_empty() {
        changes.notes.push(Note { left_out: true, text: none_matches(results, paper) });
    }
    let missing = missing(table, paper).into_iter();
    changes.lines.extend(missing.map(|at| Line::new(&results.experiment, at, Fate::Missing)));
}

/// Whether a printed row is that of one of ours.
fn stands_beside(printed: &Row, ours: &Row) -> bool {
    let named = |(i, label): (usize, &String)| match i + 1 == ours.labels.len() {
        true => format!("{label}, paper"),
        false => label.clone(),
    };
    matches!(ours.kind, RowKind::Measured | RowKind::Mean)
        && ours.labels.iter().enumerate().map(named).eq(printed.labels.iter().cloned())
}

/// What a table calls sequence and variant of a cell.
fn place(table: &Table, column: &Column, row: &Row) -> [String; 2] {
    match (&column.group, row.labels.as_slice()) {
        (Some(sequence), [variant, ..]) => [sequence.clone(), variant.clone()],
        (None, [sequence, variant, ..]) => [sequence.clone(), variant.clone()],
        _ => [table.title.clone(), row.id.clone()],
    }
}

/// The ids of what a table calls so; a mean has none but its name.
fn ids(results: &TableResults, [sequence, variant]: [String; 2]) -> [String; 2] {
    let of_sequence = results.sequences.iter().find(|own| own.label == sequence);
    let mut variants = results.sequences.iter().flat_map(|sequence| &sequence.variants);
    [
        of_sequence.map_or(sequence, |own| own.id.clone()),
        variants.find_map(|own| id_of(own, &variant)).unwrap_or(variant),
    ]
}

/// The id of a variant, or of what it repeats with another seed, if that is called so.
fn id_of(variant: &VariantResults, label: &str) -> Option<String> {
    match variant.label.strip_prefix(label)? {
        "" => Some(variant.id.clone()),
        seed => {
            let seed = seed.strip_prefix(" (seed ")?.strip_suffix(')')?;
            variant.id.strip_suffix(&format!("-{seed}")).map(str::to_owned)
        }
    }
}

/// What a column shows, and whether of fitted poses.
fn shown(column: &Column) -> Option<(MetricId, bool)> {
    let (key, fitted) = column.key.strip_suffix("-fitted").map_or((&*column.key, false), |key| (key, true));
    Some((MetricId::from_id(key)?, fitted))
}

/// Sequence and variant of printed numbers, as the table calls them, and the numbers.
type Entry<'t> = ([String; 2], Vec<(MetricId, &'t str)>);

/// The printed numbers of a table, in its order.
fn printed(table: &Table) -> Vec<Entry<'_>> {
    let mut entries: Vec<Entry<'_>> = Vec::new();
    for row in table.rows.iter().filter(|row| row.kind == RowKind::Paper) {
        for (column, cell) in table.columns.iter().zip(&row.cells) {
            let (Some((metric, _)), Some(_)) = (shown(column), cell.content.value()) else { continue };
            let at = place(table, column, row);
            match entries.iter_mut().find(|(own, _)| *own == at) {
                Some((_, values)) => values.push((metric, &cell.text)),
                None => entries.push((at, vec![(metric, &cell.text)])),
            }
        }
    }
    entries
}

/// The printed sequences and variants that stand beside none of ours. Which printed variant one of ours is, its numbers tell.
fn missing(table: &Table, paper: &Table) -> Vec<[String; 2]> {
    let (ours, paper) = (printed(table), printed(paper));
    let mut known: Vec<(&String, &String)> = Vec::new();
    for ([_, variant], _) in &ours {
        if known.iter().any(|(own, _)| *own == variant) {
            continue;
        }
        let is = |candidate: &&String| {
            let of_variant = ours.iter().filter(|([_, own], _)| own == variant);
            of_variant.into_iter().all(|([sequence, _], values)| {
                paper.iter().any(|([s, v], printed)| [s, v] == [sequence, *candidate] && printed == values)
            })
        };
        let candidates: Vec<&String> = paper.iter().map(|([_, variant], _)| variant).filter(is).collect();
        let free = candidates.iter().find(|of| known.iter().all(|(_, taken)| taken != *of));
        known.extend(free.or(candidates.first()).map(|of| (variant, *of)));
    }
    let has = |[sequence, variant]: &[String; 2]| {
        let mut of_sequence = ours.iter().filter(|([own, _], _)| own == sequence);
        of_sequence.any(|([_, own], _)| known.contains(&(own, variant)))
    };
    paper.iter().map(|(at, _)| at).filter(|at| !has(at)).cloned().collect()
}

/// That nothing printed stands beside ours, and how the paper calls what it prints.
fn none_matches(results: &TableResults, paper: &Table) -> String {
    let called = |which: usize| {
        let mut names: Vec<String> = Vec::new();
        for (at, _) in printed(paper) {
            if !names.contains(&at[which]) {
                names.push(at[which].clone());
            }
        }
        names.join(", ")
    };
    format!(
        "{}: no row is one that the paper prints; its sequences are called {}, its variants {}",
        results.experiment,
        called(0),
        called(1)
    )
}

fn line(
    results: &TableResults,
    at: [String; 2],
    column: &Column,
    [ours, printed]: [&Cell; 2],
    tolerances: &Tolerances,
) -> Option<Line> {
    let (metric, fitted) = shown(column)?;
    let paper = printed.content.value()?;
    let decimals = printed.text.split_once('.').map_or(0, |(_, digits)| digits.len());
    let last_digit = || (0..decimals).fold(0.5, |digit, _| digit / 10.0);
    let given = tolerances.given(&results.experiment, metric);
    let tolerance = given.unwrap_or_else(last_digit) + SPREADS * ours.spread.unwrap_or(0.0);
    let current = ours.content.value();
    let fate = current.map_or(Fate::Missing, |value| Fate::of(metric, paper, value, tolerance));
    Some(Line {
        metric: Some(metric),
        fitted,
        baseline: Some(paper),
        current,
        tolerance: Some(tolerance),
        printed: Some(decimals),
        ..Line::new(&results.experiment, at, fate)
    })
}
