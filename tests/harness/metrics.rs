//! Every registered metric, whatever it is called, reaches everything that shows metrics.

use super::made_up::{TABLE_7, results, run};
use skinsplat::experiment::{Experiment, Outcome, Plan, Records};
use skinsplat::report::Results;
use skinsplat::report::compare::{Fate, Tolerances, Verdict, compare};
use skinsplat_metrics::{METRICS, MetricId, Values};
use skinsplat_table::{Content, Digits, csv};

/// The seventh table with a column, and printed numbers, for every metric.
fn every_metric() -> Experiment {
    let (before, after) = TABLE_7.split_once("[[columns]]").unwrap();
    let (_, after) = after.split_once("[[variants]]").unwrap();
    let (after, _) = after.split_once("rows = [").unwrap();
    let columns: String = METRICS.iter().map(|m| format!("[[columns]]\nmetric = \"{}\"\n", m.id)).collect();
    let numbers: String = METRICS.iter().map(|m| format!(", {} = \"7.5\"", m.id)).collect();
    let bold: Vec<String> = METRICS.iter().map(|m| format!("\"{}\"", m.id)).collect();
    let bold = bold.join(", ");
    let row = format!("{{ sequence = \"anna\", variant = \"m\"{numbers}, bold = [{bold}] }}");
    let text = format!("{before}{columns}[[variants]]{after}rows = [{row}]\n");
    Experiment::parse(&text, "table7.toml").unwrap()
}

/// The made-up run, where metric k of every frame is `k + 1 + more`.
fn valued(plan: &Plan, more: impl Fn(MetricId) -> f64) -> Records {
    let mut records = run(plan);
    for record in records.values_mut() {
        let Outcome::Scored { score, .. } = &mut record.outcome else { unreachable!() };
        score.values = MetricId::all().zip(1..).map(|(id, k)| (id, f64::from(k) + more(id))).collect();
    }
    records
}

fn everywhere(more: impl Fn(MetricId) -> f64) -> Results {
    results(&every_metric(), |plan| valued(plan, &more))
}

#[test]
fn a_metric_has_a_column_a_summary_and_a_printed_number() {
    let results = everywhere(|_| 0.25);
    let sequence = &results.tables[0].sequences[0];
    let table = &results.tables[0].table;
    let csv = csv(table);
    for (id, k) in MetricId::all().zip(0..) {
        let column = &table.columns[k];
        assert_eq!(
            (column.title.as_str(), column.digits),
            (id.title(), Some(Digits::Decimals(id.decimals())))
        );
        let value = k as f64 + 1.25;
        assert_eq!(sequence.variants[0].value(id), Some(value), "{id:?}");
        assert_eq!(table.rows[0].cells[k].content, Content::number(value), "{id:?}");
        assert!(csv.lines().next().unwrap().split(',').any(|name| name == id.id()), "{csv}");
        assert_eq!(table.rows[1].cells[k].text, "7.5", "as the paper prints {id:?}");
        assert!(results.tables[0].paper.as_ref().unwrap().rows[0].cells[k].best, "{id:?}");
        let compared = results.tables[0].comparisons[0].differences.iter().any(|d| d.metric == id);
        assert_eq!((compared, sequence.variants[0].frames[0].value(id).is_some()), {
            let of_frames = id.is_of_frames();
            (of_frames, of_frames)
        });
    }
    assert_eq!(Results::from_json(&results.to_json()).unwrap(), results);
}

#[test]
fn a_metric_that_moves_is_found_within_its_own_tolerance() {
    let base = everywhere(|_| 0.0);
    for id in MetricId::all() {
        let worse = if id.higher_is_better() { -0.5 } else { 0.5 };
        let moved = |by: f64| everywhere(move |other| if other == id { by } else { 0.0 });
        let lost = compare(&base, &moved(worse), &Tolerances::default());
        assert_eq!(lost.verdict, Verdict::Regressed, "{id:?}");
        let mut regressed = lost.lines.iter().filter(|line| line.fate == Fate::Regressed);
        assert!(lost.counts.regressed > 0 && regressed.all(|line| line.metric == Some(id)), "{id:?}");
        let gained = compare(&base, &moved(-worse), &Tolerances::default());
        assert_eq!(gained.verdict, Verdict::Improved, "{id:?}");
        let allowed = Tolerances::each(|other| if other == id { 1.0 } else { 0.0 });
        assert_eq!(compare(&base, &moved(worse), &allowed).verdict, Verdict::Unchanged, "{id:?}");
    }
}

/// What no frame has is neither 0 nor left out.
#[test]
fn a_metric_that_is_not_there_is_not_a_number() {
    let results = results(&every_metric(), |plan| {
        let mut records = valued(plan, |_| 0.0);
        for record in records.values_mut() {
            let Outcome::Scored { score, .. } = &mut record.outcome else { unreachable!() };
            score.values = Values::default();
        }
        records
    });
    let cells = &results.tables[0].table.rows[0].cells;
    for (id, cell) in MetricId::all().zip(cells) {
        let expected = match id.is_of_frames() {
            true => Content::NotComputed,
            false => Content::NotApplicable,
        };
        assert_eq!(cell.content, expected, "{id:?}");
    }
}
