//! Reports: what is missing, what is documented, what moved.

use super::made_up::{
    figures, fitted_table_7, options, results, run, score, scored, table, table_7, with_holes,
};
use skinsplat::experiment::{Experiment, Records, Source, Variant, plan};
use skinsplat::report::{self, Results, TableResults};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Content, Row, RowKind, csv, markdown};

#[test]
fn a_sequence_without_any_score_leaves_no_mean() {
    let table = table(&table_7(), |plan| {
        let mut records = run(plan);
        for job in &plan.jobs[..6] {
            records.remove(&job.variants[1].key);
        }
        records
    })
    .table;
    let row = |kind, variant: &str| {
        table.rows.iter().find(|row| row.kind == kind && row.labels[1] == variant).unwrap().clone()
    };
    assert!(row(RowKind::Measured, "Quaternions").cells.iter().all(|cell| cell.content == Content::Missing));
    let mean = row(RowKind::Mean, "Quaternions");
    assert!(mean.cells.iter().all(|cell| cell.content == Content::Missing && cell.text == "—"));
    assert_eq!(table.notes[mean.cells[0].notes[0]], "Mean, Quaternions: no mean, anna has no value");
    assert_eq!((mean.sample, mean.missing), (6, 6));
    assert!(!row(RowKind::Measured, "Matrices").cells[0].best, "nothing to compare with");
}

#[test]
fn every_cell_of_the_paper_s_tables_is_printed_with_its_digits_and_bold() {
    let experiments = Experiment::embedded();
    let plan = plan(&experiments, &[figures()], &options()).unwrap();
    let results = report::results(&plan, &experiments, &run(&plan)).unwrap();
    for (experiment, results) in experiments.iter().zip(&results.tables) {
        let printed = results.paper.as_ref().unwrap();
        let markdown = markdown(printed);
        let cells: Vec<_> = printed.rows.iter().flat_map(|row| &row.cells).collect();
        let paper = experiment.paper.as_ref().unwrap();
        let numbers = MetricId::all().flat_map(|m| paper.rows.iter().filter_map(move |row| row.value(m)));
        assert_eq!(cells.len(), numbers.count(), "{}", experiment.id);
        for row in &paper.rows {
            for column in &experiment.columns {
                let digits = row.value(column.metric).unwrap().as_str();
                let text = if row.bold.contains(&column.metric) {
                    format!("**{digits}**")
                } else {
                    digits.to_owned()
                };
                assert!(markdown.contains(&format!(" {text} ")), "{text} in {markdown}");
            }
        }
    }
    let wide = results.tables[5].paper.as_ref().unwrap();
    assert_eq!(
        wide.rows.iter().map(|row| row.labels[0].as_str()).collect::<Vec<_>>(),
        ["HAHA", "Pure skinned baseline"]
    );
    let groups: Vec<&str> = wide.columns.iter().step_by(3).map(|c| c.group.as_deref().unwrap()).collect();
    assert_eq!(groups, ["00016", "00019", "00018", "00027", "All"]);
    assert_eq!(wide.rows[0].cells[12].text, "27.70");
    assert!(results.tables[2].paper.as_ref().unwrap().notes[0].contains("0.9712 is the likely value"));
}

#[test]
fn results_do_not_depend_on_the_order_of_frames_or_on_time() {
    let plain = results(&table_7(), run).to_json();
    let slow = results(&table_7(), |plan| {
        let mut records = run(plan);
        for record in records.values_mut() {
            record.seconds.render = 5.0;
            record.label = "other".into();
        }
        records
    });
    assert_eq!(slow.to_json(), plain);
    assert!(!plain.contains("seconds"));
}

/// How a table is damaged, and the complaint.
type Damage = (fn(&mut TableResults), &'static str);

#[test]
fn results_read_back_and_other_versions_are_refused() {
    let results = results(&table_7(), with_holes);
    let text = results.to_json();
    let again = Results::from_json(&text).unwrap();
    assert_eq!(again, results);
    assert_eq!(again.to_json(), text);
    assert_eq!(report::page(&again), report::page(&results));
    let error = Results::from_json(&text.replacen("\"schema\": 4", "\"schema\": 9", 1)).unwrap_err();
    assert_eq!(error, "schema: 9; expected 3 to 4, which this program reads");
    assert!(Results::from_json("{}").unwrap_err().contains("missing field `schema`"));
    let damaged: [Damage; 7] = [
        (|t| t.table.rows[1].cells[0].notes.push(99), "table `table7`: rows[1]: note 99; expected below 4"),
        (
            |t| t.table.rows[0].cells.truncate(1),
            "rows[0]: 2 labels and 1 cells; expected 2 (at least 1) and 4",
        ),
        (|t| t.table.rows[0].labels.clear(), "rows[0]: 0 labels and 4 cells"),
        (|t| t.table.columns[1].key = "psnr".into(), "columns: `psnr` twice; expected each once"),
        (|t| t.table.rows[1].id = t.table.rows[0].id.clone(), "twice; expected each once"),
        (|t| t.paper.as_mut().unwrap().rows[0].labels.clear(), "table `table7-paper`: rows[0]: 0 labels"),
        (|t| t.comparisons[0].differences[0].decimals = usize::MAX, "expected at most 12"),
    ];
    for (damage, message) in damaged {
        let mut results = results.clone();
        damage(&mut results.tables[0]);
        let error = Results::from_json(&results.to_json()).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
}

/// `reports/SCHEMA.md` names every key that a document can have.
#[test]
fn every_key_of_the_document_is_documented() {
    fn keys(value: &serde_json::Value, found: &mut std::collections::BTreeSet<String>) {
        match value {
            serde_json::Value::Object(map) => {
                for (key, value) in map {
                    found.insert(key.clone());
                    keys(value, found);
                }
            }
            serde_json::Value::Array(items) => items.iter().for_each(|item| keys(item, found)),
            _ => {}
        }
    }
    let schema = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/reports/SCHEMA.md")).unwrap();
    let mut found = std::collections::BTreeSet::new();
    keys(&serde_json::to_value(results(&table_7(), with_holes)).unwrap(), &mut found);
    assert!(found.len() > 60, "{}", found.len());
    let undocumented: Vec<&String> =
        found.iter().filter(|key| !schema.contains(&format!("`{key}`"))).collect();
    assert!(undocumented.is_empty(), "{undocumented:?}");
}

#[test]
fn the_page_says_how_it_was_made_and_what_is_missing() {
    let experiments: Vec<Experiment> = [table_7()].map(|e| e.with_all_strategies()).into();
    let mut options = options();
    options.subset.limit = Some(2);
    let plan = plan(&experiments, &[figures()], &options).unwrap();
    let mut records = run(&plan);
    let page = |records: &Records| report::page(&report::results(&plan, &experiments, records).unwrap());
    let complete = page(&records);
    assert!(
        complete.contains("`reproduce run table7 --profile standard --all-strategies --limit 2`"),
        "{complete}"
    );
    assert!(complete.contains("Partial: at most 2 frames per sequence"), "{complete}");
    assert!(!complete.contains("Incomplete"));
    records.pop_first();
    assert!(page(&records).contains("**Incomplete: 1 score missing"));
}

#[test]
fn a_table_without_data_shows_the_paper_s_alone() {
    let experiments = Experiment::embedded();
    let plan = plan(&experiments, &[], &options()).unwrap();
    let results = report::results(&plan, &experiments, &Records::new()).unwrap();
    let table = &results.tables[0];
    assert_eq!((table.source, table.table.rows.len(), results.missing()), (Source::Absent, 0, 0));
    let text = report::markdown(table);
    assert!(text.contains("Not run: no data for this table.") && text.contains("19.70"), "{text}");
}

/// PSNR of `matrices` 30 and 32 dB with the two seeds, of `quaternions` 1 and 3 dB more.
#[test]
fn seeds_are_one_row_with_a_spread() {
    let table = table(&fitted_table_7("seeds = [0, 1]").unwrap(), |plan| {
        let mut records = Records::new();
        for job in &plan.jobs {
            for (variant, psnr) in job.variants.iter().zip([30.0, 31.0, 32.0, 35.0]) {
                let score = score(&job.protocol.id, psnr, 0.9, Some(0.1));
                records.insert(variant.key.clone(), scored(&variant.key, score));
            }
        }
        records
    });
    let cell = |kind, variant: &str| {
        let of = |row: &&Row| row.kind == kind && row.labels[1] == variant;
        table.table.rows.iter().find(of).unwrap().cells[0].clone()
    };
    for kind in [RowKind::Measured, RowKind::Mean] {
        assert_eq!(cell(kind, "Matrices").text, "31.00 ± 1.41");
        let quaternions = cell(kind, "Quaternions");
        assert_eq!((quaternions.text.as_str(), quaternions.best), ("33.00 ± 2.83", true));
    }
    let comparison = table.comparisons.last().unwrap();
    let psnr = &comparison.differences[0];
    assert_eq!((comparison.variant.as_str(), comparison.baseline.as_str()), ("Quaternions", "Matrices"));
    assert_eq!(psnr.estimate.unwrap().mean, 2.0);
    assert!((psnr.over_seeds.unwrap() - 2.0_f64.sqrt()).abs() < 1e-12);
    let markdown = report::markdown(&table);
    assert!(markdown.contains("+2.000 ± 1.414 over seeds"), "{markdown}");
    assert!(markdown.contains("over the seeds 0, 1"), "{markdown}");
    assert!(csv(&table.table).lines().next().unwrap().contains("psnr sd"));
}

/// PSNR 30, 31 and 33 dB of three variants, the third compared with the second too.
#[test]
fn a_variant_is_compared_with_what_it_asks_for() {
    let mut experiment = table_7();
    let third = Variant {
        id: "third".into(),
        label: "Third".into(),
        paper: None,
        strategy: Some("view-canonical".into()),
        against: vec!["quaternions".into(), "matrices".into(), "third".into()],
        ..experiment.variants[1].clone()
    };
    experiment.variants.push(third);
    let table = table(&experiment, |plan| {
        let mut records = Records::new();
        for job in &plan.jobs {
            for (variant, psnr) in job.variants.iter().zip([30.0, 31.0, 33.0]) {
                records.insert(
                    variant.key.clone(),
                    scored(&variant.key, score(&job.protocol.id, psnr, 0.9, None)),
                );
            }
        }
        records
    });
    let over_all = table.comparisons.iter().filter(|c| c.sequence.is_none());
    let psnr = |c: &skinsplat::report::Comparison| c.differences[0].estimate.unwrap().mean;
    let compared: Vec<_> = over_all.map(|c| (c.variant.as_str(), c.baseline.as_str(), psnr(c))).collect();
    let each_once =
        [("Quaternions", "Matrices", 1.0), ("Third", "Matrices", 3.0), ("Third", "Quaternions", 2.0)];
    assert_eq!(compared, each_once);
}

/// The command of a page is one that a shell reads, and names stay text in it.
#[test]
fn the_command_of_a_page_holds_any_name() {
    let mut results = results(&table_7(), run);
    results.options.subset.subjects = vec!["it's `a` <b>".to_owned()];
    let command = r"--subject 'it'\''s `a` <b>'";
    let page = skinsplat::report::page(&results);
    assert!(page.contains("Made by ``reproduce run table7") && page.contains(command), "{page}");
    assert!(page.contains(&format!("{command}``, on the data")), "{page}");
    let html = skinsplat::report::html::html(&results, &skinsplat::report::html::Extras::default());
    assert!(html.contains(r"--subject 'it'\''s `a` &lt;b&gt;'</code>. Bold"), "{html}");
}
