//! The simplest explanation: one bug, then two, then a bug per field.
//!
//! A field of the answer is explained by a set of bugs if it agrees with the right computation, or with the computation
//! that has some of the set: engines often hold a right and a wrong copy of a number (a quaternion that is written and one
//! that is used). Among explanations with as few bugs, those win that contradict the fewest fields.

use super::change::Change;
use super::fit::Fit;
use super::judge::{Agreement, Judge, Model};
use super::sample::{self, Field, Fields, Sample};
use super::wiring::{Blend, From};
use serde_json::Value;

/// One bug.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cause {
    Change(Change),
    Fit(Fit),
}

impl Cause {
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Change(change) => change.kind(),
            Self::Fit(fit) => fit.kind(),
        }
    }

    pub(crate) fn summary(&self) -> String {
        match self {
            Self::Change(change) => change.summary(),
            Self::Fit(fit) => fit.summary().to_owned(),
        }
    }

    /// The model with this bug too.
    fn applied(&self, judge: &Judge<'_>, model: &Model) -> Option<Model> {
        match self {
            Self::Change(change) => {
                let mut model = model.clone();
                change.apply(&mut model.wiring);
                Some(model)
            }
            Self::Fit(fit) => fit.fitted(judge, model),
        }
    }

    fn excludes(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Change(a), Self::Change(b)) => a.excludes(b),
            (Self::Fit(a), Self::Fit(b)) => a == b,
            // A factor of the weights is what this change leaves in.
            (Self::Change(Change::KeepsSum), Self::Fit(Fit::Sums))
            | (Self::Fit(Fit::Sums), Self::Change(Change::KeepsSum)) => true,
            _ => false,
        }
    }
}

/// A bug as it was found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) cause: Cause,
    pub(crate) details: Value,
    /// Fields that are wrong because of it.
    pub(crate) fields: Fields,
}

/// Bugs that together explain an answer.
#[derive(Clone, Debug)]
pub(crate) struct Explanation {
    pub(crate) bugs: Vec<Found>,
    /// Fields that should be wrong too if every stage were computed with these bugs.
    pub(crate) contradicted: usize,
    /// The largest error that is left.
    pub(crate) residual: f64,
}

impl Explanation {
    /// The names of its bugs, sorted.
    pub(crate) fn kinds(&self) -> Vec<&'static str> {
        let mut kinds: Vec<&'static str> = self.bugs.iter().map(|found| found.cause.kind()).collect();
        kinds.sort_unstable();
        kinds
    }
}

/// What was found of an answer that differs.
#[derive(Clone, Debug)]
pub(crate) struct Findings {
    /// The simplest explanations; several if they cannot be told apart.
    pub(crate) explanations: Vec<Explanation>,
    /// Fields that none of them explains.
    pub(crate) unexplained: Fields,
}

/// A single bug tried on the answer.
#[derive(Clone)]
struct Single {
    cause: Cause,
    model: Model,
    agreement: Agreement,
    /// Fields in which it differs from the right computation.
    affects: Fields,
}

/// Looks for the simplest explanation of `wrong` fields; `right` is how the right computation agrees.
pub(crate) fn explain(judge: &Judge<'_>, right: &Agreement) -> Findings {
    let wrong = judge.answer.present.without(right.matches);
    let singles = singles(judge, wrong);
    let alone = alone(judge, &singles, wrong);
    if !alone.is_empty() {
        return Findings { explanations: simplest(judge, alone), unexplained: Fields::default() };
    }
    let pairs = pairs(judge, &singles, wrong);
    if !pairs.is_empty() {
        return Findings { explanations: simplest(judge, pairs), unexplained: Fields::default() };
    }
    by_field(judge, &singles, wrong)
}

/// One bug that explains everything; none if there is no such one.
pub(crate) fn explain_by_one(judge: &Judge<'_>, right: &Agreement) -> Vec<Explanation> {
    let wrong = judge.answer.present.without(right.matches);
    simplest(judge, alone(judge, &singles(judge, wrong), wrong))
}

fn singles(judge: &Judge<'_>, wrong: Fields) -> Vec<Single> {
    let reference = judge.probe(&Model::default());
    let halves = !judge.answer.halves.is_empty();
    let fits = Fit::ALL.into_iter().filter(|fit| halves || *fit != Fit::Half);
    let changes = Change::all(&judge.pipeline.vectors).into_iter().map(Cause::Change);
    let causes = changes.chain(fits.map(Cause::Fit));
    causes.map(|cause| single(judge, cause, &reference, wrong)).collect()
}

/// Tries a bug: on a few Gaussians, then on all if it may explain a field.
fn single(judge: &Judge<'_>, cause: Cause, reference: &[Sample], wrong: Fields) -> Single {
    // What cannot be read from the answer alone may be read with another bug in place.
    let model = cause.applied(judge, &Model::default()).unwrap_or_default();
    let agreement =
        if judge.plausible(&model, wrong).is_empty() { Agreement::none() } else { judge.agreement(&model) };
    let affects = match cause {
        // Seen only together with another.
        Cause::Change(Change::KeepsSum) => judge.answer.present,
        Cause::Fit(fit) => fit.affects(judge),
        Cause::Change(_) => differing(judge, reference, &judge.probe(&model)),
    };
    Single { cause, model, agreement, affects }
}

/// Given fields in which two predictions differ by more than rounding.
fn differing(judge: &Judge<'_>, a: &[Sample], b: &[Sample]) -> Fields {
    const ROUNDING: f64 = 1e-9;
    let units = judge.pipeline.convention.units;
    let storage = judge.answer.storage;
    let differs = |field: &Field| {
        let range = sample::range(*field);
        let off = |(a, b): (&Sample, &Sample)| {
            sample::error(*field, storage, units, &a[range.clone()], &b[range.clone()]) > ROUNDING
        };
        a.iter().zip(b).any(off)
    };
    judge.answer.present.iter().filter(differs).collect()
}

fn largest_error(errors: &[f64; 10], fields: Fields) -> f64 {
    fields.iter().map(|field| errors[field as usize]).fold(0.0, f64::max)
}

fn found(judge: &Judge<'_>, cause: Cause, model: &Model, fields: Fields) -> Found {
    let details = match cause {
        Cause::Change(change) => change.details(&judge.pipeline),
        Cause::Fit(fit) => fit.details(judge, model),
    };
    Found { cause, details, fields }
}

fn alone(judge: &Judge<'_>, singles: &[Single], wrong: Fields) -> Vec<Explanation> {
    let explains = |single: &&Single| wrong.without(single.agreement.matches).is_empty();
    let explanation = |single: &Single| Explanation {
        bugs: vec![found(judge, single.cause, &single.model, wrong)],
        contradicted: judge.answer.present.without(single.agreement.matches).len(),
        residual: largest_error(&single.agreement.errors, wrong),
    };
    singles.iter().filter(explains).map(explanation).collect()
}

fn pairs(judge: &Judge<'_>, singles: &[Single], wrong: Fields) -> Vec<Explanation> {
    let common = |single: &&Single| {
        // Rare starts of power iteration are looked for alone only.
        !matches!(single.cause, Cause::Change(Change::Blend(Blend::Power(_, From::Ones | From::Identity))))
    };
    let singles: Vec<&Single> = singles.iter().filter(common).collect();
    let mut explanations = Vec::new();
    for (i, a) in singles.iter().enumerate() {
        for b in &singles[i + 1..] {
            if !a.cause.excludes(&b.cause) {
                explanations.extend(pair(judge, a, b, wrong));
            }
        }
    }
    explanations
}

fn pair(judge: &Judge<'_>, a: &Single, b: &Single, wrong: Fields) -> Option<Explanation> {
    // A bug that was fitted is read from the answer with the other in place.
    let (first, second) = if matches!(a.cause, Cause::Fit(_)) { (b, a) } else { (a, b) };
    let (both, second) = &together(judge, first, second, wrong)?;
    let apart = first.agreement.matches.union(second.agreement.matches).and(wrong);
    let rest = wrong.without(apart);
    if !judge.is_plausible(both, rest) {
        return None;
    }
    let agreement = judge.agreement(both);
    if !rest.without(agreement.matches).is_empty() {
        return None;
    }
    let explained = |single: &Single| {
        let own = wrong.and(single.affects.union(single.agreement.matches));
        own.without(apart.without(single.agreement.matches).without(agreement.matches))
    };
    let errors: [f64; 10] = std::array::from_fn(|k| {
        first.agreement.errors[k].min(second.agreement.errors[k]).min(agreement.errors[k])
    });
    Some(Explanation {
        bugs: vec![
            found(judge, first.cause, both, explained(first)),
            found(judge, second.cause, both, explained(second)),
        ],
        contradicted: judge.answer.present.without(agreement.matches).len(),
        residual: largest_error(&errors, wrong),
    })
}

/// The model with two bugs, and the second by itself; `None` if they cannot explain all that is wrong.
fn together(judge: &Judge<'_>, first: &Single, second: &Single, wrong: Fields) -> Option<(Model, Single)> {
    let left = wrong.without(first.agreement.matches);
    match second.cause {
        Cause::Change(_) => {
            // What only one of them changes looks the same with both.
            let left = left.without(second.agreement.matches);
            let changed = first.affects.and(second.affects);
            if !left.without(changed).is_empty() {
                return None;
            }
            Some((second.cause.applied(judge, &first.model)?, second.clone()))
        }
        Cause::Fit(fit) => {
            if !left.without(second.affects).is_empty() || first.affects.and(wrong).is_empty() {
                return None;
            }
            let both = fit.fitted(judge, &first.model)?;
            let read = alone_as_in(judge, fit, &both, (first, second), wrong);
            Some((both, read))
        }
    }
}

/// What was read from the answer with another bug in place, without that bug: its numbers are others than those that are
/// read without it.
fn alone_as_in(
    judge: &Judge<'_>,
    fit: Fit,
    both: &Model,
    (first, single): (&Single, &Single),
    wrong: Fields,
) -> Single {
    let model = fit.alone(both);
    let same = model.sums == single.model.sums && model.signs == single.model.signs;
    let agreement = if same {
        single.agreement.clone()
    } else if judge.plausible(&model, wrong).is_empty() {
        Agreement::none()
    } else {
        judge.agreement(&model)
    };
    // Of the fields that it may change, those that it does.
    let affects = match fit {
        Fit::Sums => differing(judge, &judge.probe(&first.model), &judge.probe(both)),
        _ => single.affects,
    };
    Single { cause: single.cause, model, agreement, affects }
}

/// Those that contradict the fewest fields, one per set of names: that with the smallest error.
fn simplest(judge: &Judge<'_>, mut explanations: Vec<Explanation>) -> Vec<Explanation> {
    let least = explanations.iter().map(|e| e.contradicted).min().unwrap_or(0);
    explanations.retain(|e| e.contradicted == least);
    // Differences far below the tolerance are rounding: then the order of the catalogue holds.
    let rounded = |e: &Explanation| (e.residual / judge.tolerance * 1e3).round() as u64;
    explanations.sort_by_key(rounded);
    let mut seen: Vec<Vec<&'static str>> = Vec::new();
    explanations.retain(|e| {
        let kinds = e.kinds();
        let fresh = !seen.contains(&kinds);
        seen.push(kinds);
        fresh
    });
    explanations
}

/// Bugs that each explain a field of their own, the most useful first; the rest stays unexplained.
fn by_field(judge: &Judge<'_>, singles: &[Single], wrong: Fields) -> Findings {
    let mut left = wrong;
    let mut bugs: Vec<Found> = Vec::new();
    let mut residual: f64 = 0.0;
    while !left.is_empty() {
        let rank = |single: &&Single| {
            let explained = left.and(single.agreement.matches);
            let contradicted = single.affects.without(single.agreement.matches).len();
            (explained.len(), std::cmp::Reverse(contradicted))
        };
        let best = singles.iter().filter(|s| !left.and(s.agreement.matches).is_empty()).max_by_key(rank);
        let Some(best) = best else { break };
        let explained = left.and(best.agreement.matches);
        residual = residual.max(largest_error(&best.agreement.errors, explained));
        bugs.push(found(judge, best.cause, &best.model, explained));
        left = left.without(explained);
    }
    let explanations =
        if bugs.is_empty() { Vec::new() } else { vec![Explanation { bugs, contradicted: 0, residual }] };
    Findings { explanations, unexplained: left }
}
