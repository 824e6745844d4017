//! What `check` found, for people and for programs.

use super::change::Change;
use super::judge::{Agreement, Judge, Model, Worst};
use super::sample::{Field, Fields, Sample, range};
use super::search::{Cause, Explanation, Findings, Found};
use super::wiring::Blend;
use serde::Serialize;
use serde_json::{Map, Value, json};
use skinsplat_core::math::rotation;
use std::fmt::Write;

/// Does the engine compute what it should?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Every field that was given agrees.
    Conforms,
    /// At least one does not.
    Differs,
}

/// How a field of the answer agrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Its name.
    pub field: &'static str,
    /// The largest error: metres for means, relative to the size for covariances and activated scales, else absolute.
    pub max_error: f64,
    /// Within the tolerance.
    pub agrees: bool,
}

/// What was found of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The verdict.
    pub verdict: Verdict,
    /// The bugs: `kind`, `summary`, `fields`, `alternatives` (1-based numbers of the explanations that it is part of) and
    /// what else is known of the kind. The kind `unknown` has the worst Gaussians.
    pub explanations: Vec<Value>,
    /// How many explanations are as simple as each other; bugs of one alternative hold together.
    pub alternatives: usize,
    /// How exactly fields have to agree.
    pub tolerance: f64,
    /// The convention that the answer was read in.
    pub convention: String,
    /// The poses that were answered.
    pub poses: Vec<usize>,
    /// Every field that was given.
    pub fields: Vec<Judged>,
    /// Fields that were not given and are not judged.
    pub not_judged: Vec<&'static str>,
    /// What has to be said of how the answer was read.
    pub notes: Vec<String>,
}

/// How many Gaussians an unknown error lists.
const WORST: usize = 5;

impl Report {
    pub(crate) fn new(judge: &Judge<'_>, right: &Agreement, findings: Option<&Findings>) -> Self {
        let verdict = if findings.is_some() { Verdict::Differs } else { Verdict::Conforms };
        let judged = |field: Field| Judged {
            field: field.name(),
            max_error: right.errors[field as usize],
            agrees: right.matches.contains(field),
        };
        Self {
            verdict,
            explanations: findings.map_or_else(Vec::new, |findings| explanations(judge, findings)),
            alternatives: findings.map_or(0, |findings| findings.explanations.len()),
            tolerance: judge.tolerance,
            convention: judge.pipeline.convention.to_string(),
            poses: judge.frames.clone(),
            fields: judge.answer.present.iter().map(judged).collect(),
            not_judged: judge.answer.absent(),
            notes: judge.answer.notes.clone(),
        }
    }

    /// The kinds of all explanations, in their order.
    pub fn kinds(&self) -> Vec<&str> {
        self.explanations.iter().filter_map(|e| e["kind"].as_str()).collect()
    }

    /// The report for people.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let count = self.poses.len();
        // Writing into a String cannot fail.
        let _ = match self.verdict {
            Verdict::Conforms => {
                let most = self.fields.iter().map(|f| f.max_error).fold(0.0, f64::max);
                let shown = figure(most);
                writeln!(text, "conforms within {shown} (tolerance {}, {count} pose(s))", self.tolerance)
            }
            Verdict::Differs => {
                writeln!(text, "differs (tolerance {}, {count} pose(s))", self.tolerance)
            }
        };
        for field in &self.fields {
            let agrees = if field.agrees { "agrees" } else { "DIFFERS" };
            let _ =
                writeln!(text, "  {:<12} {agrees}, largest error {}", field.field, figure(field.max_error));
        }
        if !self.not_judged.is_empty() {
            let _ = writeln!(text, "  not given, not judged: {}", self.not_judged.join(", "));
        }
        self.write_explanations(&mut text);
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        text
    }

    fn write_explanations(&self, text: &mut String) {
        for alternative in 1..=self.alternatives {
            if self.alternatives > 1 {
                let _ = writeln!(
                    text,
                    "explanation {alternative} of {}, which the data do not tell apart:",
                    self.alternatives
                );
            }
            let part = |e: &&Value| {
                e["alternatives"].as_array().is_some_and(|all| all.contains(&json!(alternative)))
            };
            self.explanations.iter().filter(part).for_each(|e| write_bug(text, e));
        }
        let unknown = |e: &&Value| e["kind"] == "unknown";
        for e in self.explanations.iter().filter(unknown) {
            write_bug(text, e);
            for worst in e["worst"].as_array().into_iter().flatten() {
                let _ = writeln!(
                    text,
                    "    Gaussian {} in pose {}, {}: off by {}, expected {}, got {}",
                    worst["index"],
                    worst["pose"],
                    worst["field"].as_str().unwrap_or_default(),
                    worst["error"],
                    worst["expected"],
                    worst["got"]
                );
            }
        }
    }
}

fn figure(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

fn write_bug(text: &mut String, e: &Value) {
    let known = ["kind", "summary", "fields", "alternatives", "worst", "residual"];
    let details = e.as_object().into_iter().flatten().filter(|(key, _)| !known.contains(&key.as_str()));
    let details: Vec<String> = details.map(|(key, value)| format!("{key} {value}")).collect();
    let details = if details.is_empty() { String::new() } else { format!(" [{}]", details.join(", ")) };
    let list = |value: &Value| {
        let names = value.as_array().into_iter().flatten().filter_map(Value::as_str);
        names.collect::<Vec<_>>().join(", ")
    };
    let word = |key: &str| e[key].as_str().unwrap_or_default().to_owned();
    let _ = writeln!(text, "{}: {}{details}; in {}", word("kind"), word("summary"), list(&e["fields"]));
}

/// Every bug once, with the numbers of the explanations that it is part of; what is left as `unknown`.
fn explanations(judge: &Judge<'_>, findings: &Findings) -> Vec<Value> {
    let mut bugs: Vec<(Value, Vec<usize>)> = Vec::new();
    for (number, Explanation { bugs: found, residual, .. }) in findings.explanations.iter().enumerate() {
        for bug in found {
            let value = bug_value(judge, bug, *residual);
            let same = |(known, _): &&mut (Value, Vec<usize>)| {
                known["kind"] == value["kind"] && known["fields"] == value["fields"]
            };
            match bugs.iter_mut().find(same) {
                Some((_, numbers)) => numbers.push(number + 1),
                None => bugs.push((value, vec![number + 1])),
            }
        }
    }
    let numbered = |(mut value, numbers): (Value, Vec<usize>)| {
        value["alternatives"] = json!(numbers);
        value
    };
    let mut all: Vec<Value> = bugs.into_iter().map(numbered).collect();
    if !findings.unexplained.is_empty() || findings.explanations.is_empty() {
        all.push(unknown(judge, findings));
    }
    all
}

fn names(fields: Fields) -> Vec<&'static str> {
    fields.iter().map(Field::name).collect()
}

fn bug_value(judge: &Judge<'_>, found: &Found, residual: f64) -> Value {
    let mut value = Map::new();
    value.insert("kind".to_owned(), json!(found.cause.kind()));
    value.insert("summary".to_owned(), json!(found.cause.summary()));
    value.insert("fields".to_owned(), json!(names(found.fields)));
    if let Value::Object(details) = &found.details {
        value.extend(details.clone());
    }
    if let Cause::Change(change @ Change::Blend(Blend::Power(..))) = &found.cause {
        value.insert("degrees_off".to_owned(), json!(degrees_off(judge, change)));
    }
    value.insert("residual".to_owned(), json!(residual));
    Value::Object(value)
}

/// By how much a change turns Gaussians, at most, to three digits.
fn degrees_off(judge: &Judge<'_>, change: &Change) -> f64 {
    let mut changed = Model::default();
    change.apply(&mut changed.wiring);
    let quaternion = |sample: &Sample| -> [f64; 4] {
        let at = range(Field::Quaternions).start;
        std::array::from_fn(|k| sample[at + k])
    };
    let (right, wrong) = (judge.predict(&Model::default()), judge.predict(&changed));
    let angles = right.iter().zip(&wrong).map(|(a, b)| rotation::angle_between(quaternion(a), quaternion(b)));
    let most = angles.fold(0.0, f64::max).to_degrees();
    format!("{most:.2e}").parse().unwrap_or(most)
}

fn unknown(judge: &Judge<'_>, findings: &Findings) -> Value {
    let worst = judge.worst(&judge.predict(&Model::default()), findings.unexplained, WORST);
    let value = |worst: &Worst| {
        json!({
            "index": worst.gaussian,
            "pose": worst.pose,
            "field": worst.field.name(),
            "error": worst.error,
            "expected": worst.expected,
            "got": worst.got,
        })
    };
    json!({
        "kind": "unknown",
        "summary": "no known bug, and no two of them, gives these numbers",
        "fields": names(findings.unexplained),
        "worst": worst.iter().map(value).collect::<Vec<_>>(),
    })
}
