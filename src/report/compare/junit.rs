//! A comparison as JUnit XML: a suite per table, a case per number.

use super::tables::finer;
use super::{Changes, Fate, Line};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use skinsplat_metrics::MetricId;
use skinsplat_table::Digits;

/// The suite of what was not compared.
const NOTES: &str = "not compared";

/// The XML. Regressions are failures, what is missing is an error; what was not compared is an error of a suite of its own.
pub fn junit(changes: &Changes) -> String {
    let mut report = Report::new("reproduce compare");
    let mut tables: Vec<&str> = Vec::new();
    for line in &changes.lines {
        if !tables.contains(&line.table.as_str()) {
            tables.push(&line.table);
        }
    }
    for table in tables {
        let mut suite = TestSuite::new(table);
        suite.add_test_cases(
            changes.lines.iter().filter(|line| line.table == *table).map(|line| case(changes, line)),
        );
        report.add_test_suite(suite);
    }
    let left_out: Vec<&str> = changes.notes.iter().filter(|n| n.left_out).map(|n| n.text.as_str()).collect();
    if !left_out.is_empty() {
        let mut suite = TestSuite::new(NOTES);
        let case = |text: &str| {
            let name = text.split(": ").next().unwrap_or(text);
            TestCase::new(name, failed(NonSuccessKind::Error, text.to_owned()))
        };
        suite.add_test_cases(left_out.into_iter().map(case));
        report.add_test_suite(suite);
    }
    // Writing to memory fails only if the crate cannot write what it was given.
    report.to_string().unwrap_or_default()
}

fn case(changes: &Changes, line: &Line) -> TestCase {
    let metric = line.metric.map_or("all", MetricId::id);
    let metric = if line.fitted { format!("{metric} fitted") } else { metric.to_owned() };
    let frames =
        if line.frames.is_empty() { String::new() } else { format!(" [{}]", line.frames.join(", ")) };
    let name = format!("{} {} {metric}{frames}", line.sequence, line.variant);
    let status = match line.fate {
        Fate::Missing => failed(NonSuccessKind::Error, format!("missing: the {} has it", changes.against())),
        _ if changes.is_bad(line) => failed(NonSuccessKind::Failure, numbers(line)),
        _ => TestCaseStatus::success(),
    };
    let mut case = TestCase::new(name, status);
    case.set_classname(line.table.as_str());
    case
}

fn failed(kind: NonSuccessKind, message: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(kind);
    status.set_message(message);
    status
}

fn numbers(line: &Line) -> String {
    let Some(metric) = line.metric else { return "none".to_owned() };
    let shown = |value: Option<f64>, digits: Digits| {
        value.map_or_else(|| "none".to_owned(), |value| digits.show(value))
    };
    let (before, after) = (line.digits_before(metric), finer(metric));
    let tolerance = line.tolerance.unwrap_or_default();
    let numbers = [shown(line.baseline, before), shown(line.current, after)].join(" -> ");
    format!("{numbers} (tolerance {tolerance}){}", line.behind())
}
