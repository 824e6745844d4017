//! What to choose for a use: read off the rows by rules that are printed with the answer.

use super::section::shown;
use super::{Sweep, SweepRow};
use serde::Serialize;

/// What is recommended for a use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recommendation {
    /// Such as `offline scoring`.
    pub purpose: String,
    /// One per sweep that the use has a rule for.
    pub picks: Vec<Pick>,
}

/// One choice, the rule that made it, and the rows that it is read off.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pick {
    /// Id of the sweep.
    pub sweep: String,
    /// The rule in words.
    pub rule: String,
    /// The choice; where no row satisfies the rule, the one that comes nearest.
    pub choice: String,
    /// False where no row satisfies the rule.
    pub satisfied: bool,
    /// What the rows say.
    pub evidence: String,
    /// Ids of the rows.
    pub rows: Vec<String>,
}

/// What a row must keep within.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Limit {
    /// Degrees: 95 % and all of the Gaussians.
    Degrees { p95: f64, max: f64 },
    /// At least so many dB.
    Decibels(f64),
    /// At most so many dB below the best row.
    BelowBest(f64),
}

impl Limit {
    fn words(self) -> String {
        match self {
            Self::Degrees { p95, max } if p95 == max => format!("every error at most {max}°"),
            Self::Degrees { p95, max } => format!("95 % of errors at most {p95}°, every one at most {max}°"),
            Self::Decibels(least) => format!("at least {least} dB"),
            Self::BelowBest(most) => format!("at most {most} dB below the best row"),
        }
    }

    /// How far a row is within the limit: negative if it is not, none if it has no such measurement.
    fn margin(self, row: &SweepRow, best: f64) -> Option<f64> {
        let outcome = row.outcome.as_ref().ok()?;
        match self {
            Self::Degrees { p95, max } => {
                let degrees = outcome.degrees?;
                Some((max - degrees.max).min(p95 - degrees.p95))
            }
            Self::Decibels(least) => Some(outcome.fidelity?.decibels() - least),
            Self::BelowBest(most) => {
                let decibels = outcome.fidelity?.decibels();
                // Infinity less infinity is nothing: an exact row is the best.
                Some(if decibels == best { most } else { decibels - best + most })
            }
        }
    }
}

/// One rule of a use.
struct Rule {
    sweep: &'static str,
    limit: Limit,
    /// The motions in which it must hold.
    motions: &'static [&'static str],
    /// Only rows with this word among their choice.
    only: Option<&'static str>,
}

const TEST: &[&str] = &["test"];
const BOTH: &[&str] = &["test", "extreme"];

/// How many influences are enough is asked of the exact solver.
const EXACT: Option<&str> = Some("closed-form");

const fn rule(sweep: &'static str, limit: Limit, motions: &'static [&'static str]) -> Rule {
    Rule { sweep, limit, motions, only: None }
}

const fn within(degrees: f64) -> Limit {
    Limit::Degrees { p95: degrees, max: degrees }
}

/// Numbers that tables are made of: nothing may be visible, in any pose.
const OFFLINE: [Rule; 9] = [
    rule("solver", within(0.001), BOTH),
    Rule { sweep: "influences", limit: within(0.001), motions: BOTH, only: EXACT },
    rule("precision", within(0.001), BOTH),
    rule("strategy", within(0.001), BOTH),
    rule("colour", Limit::Decibels(80.0), BOTH),
    rule("storage", Limit::Decibels(70.0), BOTH),
    rule("splats", Limit::Decibels(60.0), BOTH),
    rule("cutoffs", Limit::Decibels(50.0), TEST),
    rule("resolution", Limit::BelowBest(0.5), TEST),
];

/// Motions that bodies make, errors that nobody sees: 40 dB is an 8-bit image off by two and a half steps.
const REAL_TIME: [Rule; 10] = [
    rule("solver", Limit::Degrees { p95: 0.1, max: 2.0 }, TEST),
    Rule { sweep: "influences", limit: Limit::Degrees { p95: 1.0, max: 10.0 }, motions: TEST, only: EXACT },
    rule("precision", Limit::Degrees { p95: 0.1, max: 2.0 }, TEST),
    rule("strategy", Limit::Degrees { p95: 0.1, max: 2.0 }, TEST),
    rule("colour", Limit::Decibels(40.0), TEST),
    rule("storage", Limit::Decibels(50.0), TEST),
    rule("splats", Limit::Decibels(40.0), TEST),
    rule("cutoffs", Limit::Decibels(45.0), TEST),
    rule("resolution", Limit::BelowBest(3.0), TEST),
    Rule { sweep: "avatars", limit: Limit::Decibels(35.0), motions: TEST, only: Some("6") },
];

/// Small downloads and old devices: errors that one has to look for.
const BROWSER: [Rule; 9] = [
    rule("solver", Limit::Degrees { p95: 1.0, max: 10.0 }, TEST),
    Rule { sweep: "influences", limit: Limit::Degrees { p95: 2.0, max: 20.0 }, motions: TEST, only: EXACT },
    rule("precision", Limit::Degrees { p95: 1.0, max: 10.0 }, TEST),
    rule("colour", Limit::Decibels(35.0), TEST),
    rule("storage", Limit::Decibels(40.0), TEST),
    rule("splats", Limit::Decibels(30.0), TEST),
    rule("cutoffs", Limit::Decibels(40.0), TEST),
    rule("resolution", Limit::BelowBest(6.0), TEST),
    Rule { sweep: "avatars", limit: Limit::Decibels(30.0), motions: TEST, only: Some("6") },
];

/// The recommendations for three uses. A rule whose sweep was not measured is left out.
pub fn recommend(sweeps: &[Sweep]) -> Vec<Recommendation> {
    let for_use = |purpose: &str, rules: &[Rule]| {
        let of = |rule: &Rule| {
            let sweep = sweeps.iter().find(|sweep| sweep.id == rule.sweep)?;
            pick(sweep, rule)
        };
        Recommendation { purpose: purpose.to_owned(), picks: rules.iter().filter_map(of).collect() }
    };
    vec![
        for_use("offline scoring", &OFFLINE),
        for_use("real-time engine", &REAL_TIME),
        for_use("browser", &BROWSER),
    ]
}

/// A choice with its rows in the motions of a rule.
struct Contender<'a> {
    rows: Vec<&'a SweepRow>,
    cost: f64,
    margin: f64,
}

/// The cheapest choice that satisfies the rule in all its motions; else the one that misses it least. None if no choice
/// was measured in all of them.
fn pick(sweep: &Sweep, rule: &Rule) -> Option<Pick> {
    let mut options: Vec<Contender> = Vec::new();
    let first = rule.motions[0];
    for row in sweep.rows.iter().filter(|row| row.motion == first) {
        if rule.only.is_some_and(|only| !row.choice.iter().any(|word| word == only)) {
            continue;
        }
        let twin = |motion: &&str| sweep.rows.iter().find(|r| r.motion == *motion && r.choice == row.choice);
        let Some(rows) = rule.motions.iter().map(twin).collect::<Option<Vec<_>>>() else { continue };
        let (mut cost, mut margin) = (0.0, f64::INFINITY);
        let mut measured = true;
        for row in &rows {
            let best = best(sweep, row.motion);
            match (sweep.cost(row), rule.limit.margin(row, best)) {
                (Some(of), Some(within)) => {
                    cost += of;
                    margin = within.min(margin);
                }
                _ => measured = false,
            }
        }
        if measured {
            options.push(Contender { rows, cost, margin });
        }
    }
    let satisfied = options.iter().any(|option| option.margin >= 0.0);
    let chosen = if satisfied {
        let within = options.iter().filter(|option| option.margin >= 0.0);
        within.min_by(|a, b| a.cost.total_cmp(&b.cost))
    } else {
        options.iter().max_by(|a, b| a.margin.total_cmp(&b.margin))
    }?;
    let only = rule.only.map_or_else(String::new, |only| format!(" of `{only}`"));
    let what = if sweep.by_bytes { "smallest" } else { "cheapest" };
    Some(Pick {
        sweep: sweep.id.to_owned(),
        rule: format!("the {what} row{only} with {} in {}", rule.limit.words(), places(rule.motions)),
        choice: chosen.rows[0].name(),
        satisfied,
        evidence: chosen.rows.iter().map(|row| said(sweep, row)).collect::<Vec<_>>().join("; "),
        rows: chosen.rows.iter().map(|row| sweep.row_id(row)).collect(),
    })
}

fn places(motions: &[&str]) -> String {
    if motions.len() > 1 { "both motions".to_owned() } else { format!("the {} motion", motions[0]) }
}

/// The best dB of a motion.
fn best(sweep: &Sweep, motion: &str) -> f64 {
    let of = |row: &SweepRow| row.outcome.as_ref().ok()?.fidelity.map(super::Fidelity::decibels);
    let rows = sweep.rows.iter().filter(|row| row.motion == motion);
    rows.filter_map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// `test: 12.1 ns per Gaussian, at most 0.02°, 61 dB`.
fn said(sweep: &Sweep, row: &SweepRow) -> String {
    let Ok(outcome) = &row.outcome else { return format!("{}: not run", row.motion) };
    let mut parts = Vec::new();
    if let Some(bytes) = outcome.bytes {
        parts.push(format!("{} bytes per Gaussian", shown(bytes)));
    }
    if let Some(time) = outcome.time {
        parts.push(format!("{} {}", shown(time.median * sweep.unit.factor()), sweep.unit.title()));
    }
    if let Some(degrees) = outcome.degrees {
        parts.push(format!("95 % within {}°, all within {}°", shown(degrees.p95), shown(degrees.max)));
    }
    match outcome.fidelity.map(super::Fidelity::decibels) {
        Some(f64::INFINITY) => parts.push("exact images".to_owned()),
        Some(value) => parts.push(format!("{} dB", shown(value))),
        None => {}
    }
    format!("{}: {}", row.motion, parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::{Degrees, Outcome, Spread, Unit};
    use super::*;

    fn sweep(rows: &[(&'static str, &str, f64, f64)]) -> Sweep {
        let row = |&(motion, name, time, max): &(&'static str, &str, f64, f64)| SweepRow {
            motion,
            choice: vec![name.to_owned()],
            outcome: Ok(Outcome {
                time: Some(Spread { median: time, low: time, high: time, repeats: 1 }),
                degrees: Some(Degrees { median: 0.0, p95: max, max }),
                ..Outcome::default()
            }),
            note: String::new(),
        };
        Sweep {
            id: "solver",
            title: "Solvers",
            about: String::new(),
            axes: vec!["Solver"],
            unit: Unit::PerGaussian,
            by_bytes: false,
            rows: rows.iter().map(row).collect(),
        }
    }

    #[test]
    fn the_cheapest_within_the_limit_in_every_motion() {
        let rows = [
            ("test", "cheap", 1.0, 0.05),
            ("extreme", "cheap", 1.0, 40.0),
            ("test", "fair", 2.0, 1e-6),
            ("extreme", "fair", 2.0, 1e-6),
            ("test", "slow", 9.0, 0.0),
            ("extreme", "slow", 9.0, 0.0),
        ];
        let [offline, real_time, _] = &recommend(&[sweep(&rows)])[..] else { panic!("three uses") };
        assert_eq!((offline.picks[0].choice.as_str(), offline.picks[0].satisfied), ("fair", true));
        assert_eq!(offline.picks[0].rows, ["solver/test/fair", "solver/extreme/fair"]);
        assert_eq!(real_time.picks[0].choice, "cheap");
        assert_eq!(real_time.picks.len(), 1, "no rule without its sweep");
    }

    #[test]
    fn where_nothing_is_good_enough_the_nearest_is_named_and_marked() {
        let rows = [("test", "bad", 1.0, 80.0), ("test", "worse", 0.5, 90.0)];
        let picks = &recommend(&[sweep(&rows)])[1].picks;
        assert_eq!((picks[0].choice.as_str(), picks[0].satisfied), ("bad", false));
        assert!(recommend(&[sweep(&rows)])[0].picks.is_empty(), "not measured in the extreme motion");
    }
}
