//! What differences decide, in tables and in words.

use super::made_up::{TABLE_7, options, own_data, score, scored, table_7};
use skinsplat::experiment::{Experiment, Records, plan};
use skinsplat::report::{self, TableResults};
use skinsplat_metrics::MetricId;
use skinsplat_statistics::Verdict;
use skinsplat_table::RowKind;

/// PSNR of anna's quaternions is half a dB above her matrices', give or take 0.05; of bob's half a dB above or below by turns of
/// no period. SSIM differs by 1e-5 by such turns, LPIPS not at all.
fn wavering(experiment: &Experiment) -> TableResults {
    let experiments = [experiment.clone()];
    let plan = plan(&experiments, &[own_data(12)], &options()).unwrap();
    let mut records = Records::new();
    for job in &plan.jobs {
        let turn = [1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0][job.frame];
        let difference = if job.row == 0 { 0.5 + 0.05 * turn } else { 0.5 * turn };
        for (variant, share) in job.variants.iter().zip([0.0, 1.0]) {
            let psnr = 20.0 + share * difference;
            let score = score(&job.protocol.id, psnr, 0.9 + share * 1e-5 * turn, Some(0.1));
            records.insert(variant.key.clone(), scored(&variant.key, score));
        }
    }
    report::results(&plan, &experiments, &records).unwrap().tables.remove(0)
}

fn is_best(table: &TableResults, kind: RowKind, sequence: &str, variant: &str) -> Vec<bool> {
    let of = |row: &&skinsplat_table::Row| row.kind == kind && row.labels == [sequence, variant];
    table.table.rows.iter().find(of).unwrap().cells.iter().map(|cell| cell.best).collect()
}

#[test]
fn bold_follows_the_verdict() {
    let table = wavering(&table_7());
    let best = |kind, sequence, variant| is_best(&table, kind, sequence, variant);
    // PSNR, SSIM, LPIPS, and the count, which is no outcome.
    assert_eq!(best(RowKind::Measured, "anna", "Matrices"), [false, true, true, false]);
    assert_eq!(best(RowKind::Measured, "anna", "Quaternions"), [true, true, true, false]);
    assert_eq!(best(RowKind::Measured, "bob", "Matrices"), [true, true, true, false]);
    assert_eq!(best(RowKind::Mean, "Mean", "Matrices"), [true, true, true, false]);
}

#[test]
fn verdicts_are_in_words_and_follow_the_margin() {
    let table = wavering(&table_7());
    let verdicts = |table: &TableResults| -> Vec<Vec<Verdict>> {
        let of =
            |c: &report::Comparison| c.differences.iter().map(|d| d.judgement.unwrap().verdict).collect();
        table.comparisons.iter().map(of).collect()
    };
    let same = [Verdict::NoDifference; 2];
    let [anna, bob, all] = &verdicts(&table)[..] else { panic!("three comparisons") };
    assert_eq!((anna[0], bob[0], all[0]), (Verdict::Better, Verdict::Undecided, Verdict::Undecided));
    assert!([anna, bob, all].iter().all(|of| of[1..] == same), "{anna:?} {bob:?} {all:?}");
    let text = report::markdown(&table);
    assert!(text.contains(", better, won 100 %") && text.contains(", undecided, won"), "{text}");
    assert!(
        text.contains(", no difference above 0.0005, won 50 %") && text.contains("| 2 subjects |"),
        "{text}"
    );

    let wider = TABLE_7.replace("sequences = [", "equivalence = { psnr = 2.0 }\nsequences = [");
    let table = wavering(&Experiment::parse(&wider, "table7.toml").unwrap());
    assert_eq!(verdicts(&table)[1][0], Verdict::NoDifference);
    assert!(report::markdown(&table).contains("better, by at most 2, won 100 %"));
}

#[test]
fn a_count_is_bold_where_it_is_an_outcome() {
    let text = TABLE_7
        .replace("metric = \"splats\"", "metric = \"splats\"\noutcome = true")
        .replace("metric = \"psnr\"", "metric = \"psnr\"\noutcome = false");
    let table = wavering(&Experiment::parse(&text, "table7.toml").unwrap());
    assert_eq!(is_best(&table, RowKind::Measured, "anna", "Quaternions"), [false, true, true, true]);
}

#[test]
fn margins_are_checked() {
    let refused = |margin: &str| {
        let text = TABLE_7.replace("sequences = [", &format!("equivalence = {{ {margin} }}\nsequences = ["));
        Experiment::parse(&text, "table7.toml").unwrap_err().to_string()
    };
    for (margin, part) in [
        ("psnr = -0.1", "equivalence.psnr"),
        ("lpips = nan", "equivalence.lpips"),
        ("splats = 5", "equivalence.splats"),
        ("sharpness = 1", "sharpness"),
    ] {
        assert!(refused(margin).contains(part), "{}", refused(margin));
    }
    assert_eq!((table_7().margin(MetricId::PSNR), table_7().margin(MetricId::SPLATS)), (0.05, 0.0));
}
