//! Tables: shapes, formats, what is best, what is missing, what moved.

use super::made_up::{figures, options, own_data, record, run, score, scored, table_7, wide_table_7};
use skinsplat::experiment::{Experiment, Outcome, Plan, Records, Source, plan};
use skinsplat::metrics::MetricKind;
use skinsplat::report::compare::{Tolerances, Verdict, compare};
use skinsplat::report::{self, Content, Results, RowKind, Table};

fn results(experiment: &Experiment, records: impl Fn(&Plan) -> Records) -> Results {
    let experiments = [experiment.clone()];
    let plan = plan(&experiments, &[own_data(6)], &options()).unwrap();
    report::results(&plan, &experiments, &records(&plan)).unwrap()
}

fn table(experiment: &Experiment, records: impl Fn(&Plan) -> Records) -> Table {
    results(experiment, records).tables.remove(0).table
}

/// The made-up scores with a hole: of anna's frames, one failed and one was not run; bob's matrices have no LPIPS and
/// his quaternions hit one frame exactly.
fn with_holes(plan: &Plan) -> Records {
    let mut records = run(plan);
    let key = |job: usize, variant: usize| plan.jobs[job].variants[variant].key.clone();
    records
        .insert(key(1, 0), record(&key(1, 0), Outcome::Error("truth: image_0001.png is truncated".into())));
    records.remove(&key(2, 0));
    for job in 6..12 {
        records.insert(key(job, 0), scored(&key(job, 0), score("avatar-v1", 21.0, 0.5, None)));
    }
    records.insert(key(7, 1), scored(&key(7, 1), score("avatar-v1", f64::INFINITY, 1.0, Some(0.0))));
    records
}

fn own_only(mut table: Table) -> Table {
    table.paper = None;
    table.comparisons.clear();
    table
}

#[test]
fn a_table_of_rows() {
    insta::assert_snapshot!(report::markdown(&table(&table_7(), run)), @r#"
    ## Table 7

    Gymnasts, matrices against quaternions.
    Ran on: Gymnasts (gymnasts).
    Protocol: avatar-v1, version 1.
    Profile: standard, every frame at native resolution.
    Frames: 12 per variant, in 2 sequences (6 each).
    Mean: each sequence counts once.

    | Sequence | Variant | PSNR ↑ | SSIM ↑ | LPIPS\* ↓ | Splats ↓ |
    | :-- | :-- | --: | --: | --: | --: |
    | anna | Matrices | 20.25 | 0.920 | 0.1797 | **100** |
    |  | Matrices, paper | 20.10 | 0.920 | 0.1800 | 90 |
    |  | Matrices − paper | +0.15 | 0.000 | −0.0003 | +10 |
    |  | Quaternions | **20.75** | **0.921** | **0.1793** | **100** |
    | bob | Matrices | 21.25 | 0.921 | 0.1787 | **100** |
    |  | Matrices, paper | **21.00** | 0.820 <sup>1</sup> | 0.1600 | 90 |
    |  | Matrices − paper | +0.25 | +0.101 | +0.0187 | +10 |
    |  | Quaternions | **21.75** | **0.922** | **0.1783** | **100** |
    | Mean | Matrices | 20.75 | **0.921** | 0.1792 | **100** |
    |  | Quaternions | **21.25** | **0.921** | **0.1788** | **100** |

    <sup>1</sup> bob, Matrices: ssim 0.820 looks like a slip

    A made-up table.

    Frame by frame: mean difference, its 95 % interval (paired block bootstrap, seeded), and the share of frames won.

    | Sequence | Difference | Frames | Δ PSNR | Δ SSIM | Δ LPIPS |
    | :-- | :-- | --: | --: | --: | --: |
    | anna | Quaternions − Matrices | 6 | +0.500 [+0.500, +0.500], won 100 % | +0.0005 [+0.0005, +0.0005], won 100 % | −0.00050 [−0.00050, −0.00050], won 100 % |
    | bob | Quaternions − Matrices | 6 | +0.500 [+0.500, +0.500], won 100 % | +0.0005 [+0.0005, +0.0005], won 100 % | −0.00050 [−0.00050, −0.00050], won 100 % |
    | All | Quaternions − Matrices | 12 | +0.500 [+0.500, +0.500], won 100 % | +0.0005 [+0.0005, +0.0005], won 100 % | −0.00050 [−0.00050, −0.00050], won 100 % |

    <details>
    <summary>Table 7 of a paper, as printed: the paper's values on its data and avatars (not comparable with a stand-in's)</summary>

    Gymnasts as printed.
    The paper's values, on its data and avatars.

    | Sequence | Variant | PSNR ↑ | SSIM ↑ | LPIPS\* ↓ | Splats ↓ |
    | :-- | :-- | --: | --: | --: | --: |
    | anna | Matrix | 20.10 | 0.920 | 0.1800 | 90 |
    |  | Quaternion | **20.30** | **0.930** | **0.1700** | **80** |
    | bob | Matrix | **21.00** | 0.820 <sup>1</sup> | 0.1600 | 90 |

    <sup>1</sup> bob, Matrix: ssim 0.820 looks like a slip

    </details>
    "#);
    insta::assert_snapshot!(report::csv(&table(&table_7(), run)), @r#"
    sequence,variant,kind,frames,missing,psnr,ssim,lpips,splats,notes
    anna,Matrices,measured,6,0,20.25,0.9202499999999999,0.17975,100,
    anna,"Matrices, paper",paper,0,0,20.10,0.920,0.1800,90,
    anna,Matrices − paper,difference,6,0,0.14999999999999858,0.00024999999999986144,-0.0002500000000000002,10,
    anna,Quaternions,measured,6,0,20.75,0.9207500000000001,0.17925000000000002,100,
    bob,Matrices,measured,6,0,21.25,0.92125,0.17875,100,
    bob,"Matrices, paper",paper,0,0,21.00,0.820,0.1600,90,"bob, Matrices: ssim 0.820 looks like a slip"
    bob,Matrices − paper,difference,6,0,0.25,0.10125000000000006,0.01874999999999999,10,
    bob,Quaternions,measured,6,0,21.75,0.92175,0.17825000000000002,100,
    Mean,Matrices,mean,12,0,20.75,0.92075,0.17925,100,
    Mean,Quaternions,mean,12,0,21.25,0.92125,0.17875000000000002,100,
    "#);
    insta::assert_snapshot!(report::latex(&table(&table_7(), run)), @r#"
    \begin{table}
    \centering
    \caption{Gymnasts, matrices against quaternions. Ran on: Gymnasts (gymnasts). Protocol: avatar-v1, version 1. Profile: standard, every frame at native resolution. Frames: 12 per variant, in 2 sequences (6 each). Mean: each sequence counts once.}
    \label{tab:table7}
    \begin{tabular}{llrrrr}
    \toprule
    Sequence & Variant & PSNR $\uparrow$ & SSIM $\uparrow$ & LPIPS* $\downarrow$ & Splats $\downarrow$ \\
    \midrule
    anna & Matrices & 20.25 & 0.920 & 0.1797 & \textbf{100} \\
     & Matrices, paper & 20.10 & 0.920 & 0.1800 & 90 \\
     & Matrices $-$ paper & +0.15 & 0.000 & $-$0.0003 & +10 \\
     & Quaternions & \textbf{20.75} & \textbf{0.921} & \textbf{0.1793} & \textbf{100} \\
    \midrule
    bob & Matrices & 21.25 & 0.921 & 0.1787 & \textbf{100} \\
     & Matrices, paper & \textbf{21.00} & 0.820$^{1}$ & 0.1600 & 90 \\
     & Matrices $-$ paper & +0.25 & +0.101 & +0.0187 & +10 \\
     & Quaternions & \textbf{21.75} & \textbf{0.922} & \textbf{0.1783} & \textbf{100} \\
    \midrule
    Mean & Matrices & 20.75 & \textbf{0.921} & 0.1792 & \textbf{100} \\
     & Quaternions & \textbf{21.25} & \textbf{0.921} & \textbf{0.1788} & \textbf{100} \\
    \bottomrule
    \end{tabular}
    \\ {\footnotesize $^{1}$ bob, Matrices: ssim 0.820 looks like a slip}
    \end{table}
    "#);
}

#[test]
fn a_wide_table() {
    let table = own_only(table(&wide_table_7(), run));
    insta::assert_snapshot!(report::markdown(&table), @r#"
    ## Table 7

    Gymnasts, matrices against quaternions.
    Ran on: Gymnasts (gymnasts).
    Protocol: avatar-v1, version 1.
    Profile: standard, every frame at native resolution.
    Frames: 12 per variant, in 2 sequences (6 each).
    All: each sequence counts once.

    | Method | anna PSNR ↑ | anna SSIM ↑ | anna LPIPS\* ↓ | anna Splats ↓ | bob PSNR ↑ | bob SSIM ↑ | bob LPIPS\* ↓ | bob Splats ↓ | All PSNR ↑ | All SSIM ↑ | All LPIPS\* ↓ | All Splats ↓ |
    | :-- | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: |
    | Matrices | 20.25 | 0.920 | 0.1797 | **100** | 21.25 | 0.921 | 0.1787 | **100** | 20.75 | **0.921** | 0.1792 | **100** |
    | Matrices, paper | 20.10 | 0.920 | 0.1800 | 90 | **21.00** | 0.820 <sup>1</sup> | 0.1600 | 90 | — | — | — | — |
    | Matrices − paper | +0.15 | 0.000 | −0.0003 | +10 | +0.25 | +0.101 | +0.0187 | +10 | — | — | — | — |
    | Quaternions | **20.75** | **0.921** | **0.1793** | **100** | **21.75** | **0.922** | **0.1783** | **100** | **21.25** | **0.921** | **0.1788** | **100** |

    <sup>1</sup> bob, Matrices: ssim 0.820 looks like a slip

    A made-up table.
    "#);
    insta::assert_snapshot!(report::csv(&table), @r#"
    method,kind,frames,missing,anna psnr,anna ssim,anna lpips,anna splats,bob psnr,bob ssim,bob lpips,bob splats,All psnr,All ssim,All lpips,All splats,notes
    Matrices,measured,12,0,20.25,0.9202499999999999,0.17975,100,21.25,0.92125,0.17875,100,20.75,0.92075,0.17925,100,
    "Matrices, paper",paper,0,0,20.10,0.920,0.1800,90,21.00,0.820,0.1600,90,,,,,"bob, Matrices: ssim 0.820 looks like a slip"
    Matrices − paper,difference,12,0,0.14999999999999858,0.00024999999999986144,-0.0002500000000000002,10,0.25,0.10125000000000006,0.01874999999999999,10,,,,,
    Quaternions,measured,12,0,20.75,0.9207500000000001,0.17925000000000002,100,21.75,0.92175,0.17825000000000002,100,21.25,0.92125,0.17875000000000002,100,
    "#);
    insta::assert_snapshot!(report::latex(&table), @r#"
    \begin{table}
    \centering
    \caption{Gymnasts, matrices against quaternions. Ran on: Gymnasts (gymnasts). Protocol: avatar-v1, version 1. Profile: standard, every frame at native resolution. Frames: 12 per variant, in 2 sequences (6 each). All: each sequence counts once.}
    \label{tab:table7}
    \begin{tabular}{lrrrrrrrrrrrr}
    \toprule
     & \multicolumn{4}{c}{anna} & \multicolumn{4}{c}{bob} & \multicolumn{4}{c}{All} \\
    \cmidrule(lr){2-5}
    \cmidrule(lr){6-9}
    \cmidrule(lr){10-13}
    Method & PSNR $\uparrow$ & SSIM $\uparrow$ & LPIPS* $\downarrow$ & Splats $\downarrow$ & PSNR $\uparrow$ & SSIM $\uparrow$ & LPIPS* $\downarrow$ & Splats $\downarrow$ & PSNR $\uparrow$ & SSIM $\uparrow$ & LPIPS* $\downarrow$ & Splats $\downarrow$ \\
    \midrule
    Matrices & 20.25 & 0.920 & 0.1797 & \textbf{100} & 21.25 & 0.921 & 0.1787 & \textbf{100} & 20.75 & \textbf{0.921} & 0.1792 & \textbf{100} \\
    Matrices, paper & 20.10 & 0.920 & 0.1800 & 90 & \textbf{21.00} & 0.820$^{1}$ & 0.1600 & 90 & --- & --- & --- & --- \\
    Matrices $-$ paper & +0.15 & 0.000 & $-$0.0003 & +10 & +0.25 & +0.101 & +0.0187 & +10 & --- & --- & --- & --- \\
    Quaternions & \textbf{20.75} & \textbf{0.921} & \textbf{0.1793} & \textbf{100} & \textbf{21.75} & \textbf{0.922} & \textbf{0.1783} & \textbf{100} & \textbf{21.25} & \textbf{0.921} & \textbf{0.1788} & \textbf{100} \\
    \bottomrule
    \end{tabular}
    \\ {\footnotesize $^{1}$ bob, Matrices: ssim 0.820 looks like a slip}
    \end{table}
    "#);
}

#[test]
fn holes_are_shown_not_averaged_away() {
    let table = own_only(table(&table_7(), with_holes));
    insta::assert_snapshot!(report::markdown(&table), @r#"
    ## Table 7

    Gymnasts, matrices against quaternions.
    Ran on: Gymnasts (gymnasts).
    Protocol: avatar-v1, version 1.
    Profile: standard, every frame at native resolution.
    Frames: 12 per variant, in 2 sequences (6 each).
    Mean: each sequence counts once.

    | Sequence | Variant | PSNR ↑ | SSIM ↑ | LPIPS\* ↓ | Splats ↓ |
    | :-- | :-- | --: | --: | --: | --: |
    | anna | Matrices | 20.30 <sup>1</sup> | 0.920 <sup>1</sup> | 0.1797 <sup>1</sup> | 100 <sup>1</sup> |
    |  | Matrices, paper | 20.10 | 0.920 | 0.1800 | 90 |
    |  | Matrices − paper | +0.20 | 0.000 | −0.0003 | +10 |
    |  | Quaternions | 20.75 | 0.921 | 0.1793 | 100 |
    | bob | Matrices | 21.00 | 0.500 | n/c <sup>2</sup> | **100** |
    |  | Matrices, paper | **21.00** | 0.820 <sup>3</sup> | 0.1600 | 90 |
    |  | Matrices − paper | 0.00 | −0.320 | — | +10 |
    |  | Quaternions | **∞** | **0.935** | 0.1485 | **100** |
    | Mean | Matrices | 20.65 <sup>4</sup> | 0.710 <sup>4</sup> | n/c <sup>4,2</sup> | 100 <sup>4</sup> |
    |  | Quaternions | ∞ | 0.928 | 0.1639 | 100 |

    <sup>1</sup> anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)

    <sup>2</sup> n/c: LPIPS\* was not computed for every frame (it needs network weights)

    <sup>3</sup> bob, Matrices: ssim 0.820 looks like a slip

    <sup>4</sup> Mean, Matrices: 2 frames missing in all

    A made-up table.
    "#);
    insta::assert_snapshot!(report::csv(&table), @r#"
    sequence,variant,kind,frames,missing,psnr,ssim,lpips,splats,notes
    anna,Matrices,measured,4,2,20.299999999999997,0.9203,0.1797,100,"anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)"
    anna,"Matrices, paper",paper,0,0,20.10,0.920,0.1800,90,
    anna,Matrices − paper,difference,4,2,0.19999999999999574,0.00029999999999996696,-0.0002999999999999947,10,
    anna,Quaternions,measured,6,0,20.75,0.9207500000000001,0.17925000000000002,100,
    bob,Matrices,measured,6,0,21,0.5,,100,n/c: LPIPS* was not computed for every frame (it needs network weights)
    bob,"Matrices, paper",paper,0,0,21.00,0.820,0.1600,90,"bob, Matrices: ssim 0.820 looks like a slip"
    bob,Matrices − paper,difference,6,0,0,-0.31999999999999995,,10,
    bob,Quaternions,measured,6,0,inf,0.9348166666666667,0.14851666666666669,100,
    Mean,Matrices,mean,10,2,20.65,0.7101500000000001,,100,"n/c: LPIPS* was not computed for every frame (it needs network weights); Mean, Matrices: 2 frames missing in all"
    Mean,Quaternions,mean,12,0,inf,0.9277833333333334,0.16388333333333335,100,
    "#);
}

#[test]
fn a_table_value_as_json() {
    let mut table = own_only(table(&table_7(), with_holes));
    table.rows.truncate(1);
    insta::assert_snapshot!(table.to_json(), @r#"
    {
      "id": "table7",
      "title": "Table 7",
      "caption": "Gymnasts, matrices against quaternions",
      "ran_on": [
        "Ran on: Gymnasts (gymnasts)",
        "Protocol: avatar-v1, version 1",
        "Profile: standard, every frame at native resolution",
        "Frames: 12 per variant, in 2 sequences (6 each)",
        "Mean: each sequence counts once"
      ],
      "source": "own",
      "labels": [
        "Sequence",
        "Variant"
      ],
      "columns": [
        {
          "group": null,
          "title": "PSNR",
          "metric": "psnr",
          "decimals": 2
        },
        {
          "group": null,
          "title": "SSIM",
          "metric": "ssim",
          "decimals": 3
        },
        {
          "group": null,
          "title": "LPIPS*",
          "metric": "lpips",
          "decimals": 4
        },
        {
          "group": null,
          "title": "Splats",
          "metric": "splats",
          "decimals": 0
        }
      ],
      "rows": [
        {
          "kind": "measured",
          "labels": [
            "anna",
            "Matrices"
          ],
          "cells": [
            {
              "content": {
                "state": "number",
                "value": 20.299999999999997
              },
              "text": "20.30",
              "best": false,
              "missing": 2,
              "notes": [
                0
              ]
            },
            {
              "content": {
                "state": "number",
                "value": 0.9203
              },
              "text": "0.920",
              "best": false,
              "missing": 2,
              "notes": [
                0
              ]
            },
            {
              "content": {
                "state": "number",
                "value": 0.1797
              },
              "text": "0.1797",
              "best": false,
              "missing": 2,
              "notes": [
                0
              ]
            },
            {
              "content": {
                "state": "number",
                "value": 100.0
              },
              "text": "100",
              "best": false,
              "missing": 2,
              "notes": [
                0
              ]
            }
          ],
          "frames": 4,
          "missing": 2
        }
      ],
      "notes": [
        "anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)",
        "n/c: LPIPS* was not computed for every frame (it needs network weights)",
        "bob, Matrices: ssim 0.820 looks like a slip",
        "Mean, Matrices: 2 frames missing in all"
      ],
      "remarks": [
        "A made-up table."
      ],
      "comparisons": [],
      "paper": null
    }
    "#);
}

#[test]
fn a_sequence_without_any_score_leaves_no_mean() {
    let table = table(&table_7(), |plan| {
        let mut records = run(plan);
        for job in &plan.jobs[..6] {
            records.remove(&job.variants[1].key);
        }
        records
    });
    let row = |kind, variant: &str| {
        table.rows.iter().find(|row| row.kind == kind && row.labels[1] == variant).unwrap().clone()
    };
    assert!(row(RowKind::Measured, "Quaternions").cells.iter().all(|cell| cell.content == Content::Missing));
    let mean = row(RowKind::Mean, "Quaternions");
    assert!(mean.cells.iter().all(|cell| cell.content == Content::Missing && cell.text == "—"));
    assert_eq!(table.notes[mean.cells[0].notes[0]], "Mean, Quaternions: no mean, anna has no value");
    assert_eq!((mean.frames, mean.missing), (6, 6));
    assert!(!row(RowKind::Measured, "Matrices").cells[0].best, "nothing to compare with");
}

#[test]
fn csv_reads_back_in_full_precision() {
    for experiment in [table_7(), wide_table_7()] {
        let table = table(&experiment, with_holes);
        let text = report::csv(&table);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().unwrap().clone();
        let records: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(records.len(), table.rows.len());
        for (record, row) in records.iter().zip(&table.rows) {
            let labels: Vec<&str> = record.iter().take(row.labels.len()).collect();
            assert_eq!(labels, row.labels);
            for (column, cell) in table.columns.iter().zip(&row.cells) {
                let position = header.iter().position(|name| name == column.name()).unwrap();
                let field = &record[position];
                assert_eq!(field.parse::<f64>().ok(), cell.content.value(), "{} {field}", column.name());
            }
        }
    }
}

#[test]
fn every_cell_of_the_paper_s_tables_is_printed_with_its_digits_and_bold() {
    let experiments = Experiment::embedded();
    let plan = plan(&experiments, &[figures()], &options()).unwrap();
    let results = report::results(&plan, &experiments, &run(&plan)).unwrap();
    for (experiment, results) in experiments.iter().zip(&results.tables) {
        let printed = results.table.paper.as_deref().unwrap();
        let markdown = report::markdown(printed);
        let cells: Vec<_> = printed.rows.iter().flat_map(|row| &row.cells).collect();
        let paper = experiment.paper.as_ref().unwrap();
        let numbers =
            MetricKind::ALL.iter().flat_map(|&m| paper.rows.iter().filter_map(move |row| row.value(m)));
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
    let wide = results.tables[5].table.paper.as_deref().unwrap();
    assert_eq!(
        wide.rows.iter().map(|row| row.labels[0].as_str()).collect::<Vec<_>>(),
        ["HAHA", "Pure skinned baseline"]
    );
    let groups: Vec<&str> = wide.columns.iter().step_by(3).map(|c| c.group.as_deref().unwrap()).collect();
    assert_eq!(groups, ["00016", "00019", "00018", "00027", "All"]);
    assert_eq!(wide.rows[0].cells[12].text, "27.70");
    assert!(results.tables[2].table.paper.as_ref().unwrap().notes[0].contains("0.9712 is the likely value"));
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
type Damage = (fn(&mut Table), &'static str);

#[test]
fn results_read_back_and_other_versions_are_refused() {
    let results = results(&table_7(), with_holes);
    let text = results.to_json();
    let again = Results::from_json(&text).unwrap();
    assert_eq!(again, results);
    assert_eq!(again.to_json(), text);
    assert_eq!(report::page(&again), report::page(&results));
    let error = Results::from_json(&text.replacen("\"schema\": 1", "\"schema\": 9", 1)).unwrap_err();
    assert_eq!(error, "schema: 9; expected 1, which this program reads");
    assert!(Results::from_json("{}").unwrap_err().contains("missing field `schema`"));
    let damaged: [Damage; 4] = [
        (|t| t.rows[1].cells[0].notes.push(99), "table `table7`: rows[1]: note 99; expected below 4"),
        (|t| t.rows[0].cells.truncate(1), "rows[0]: 2 labels and 1 cells; expected 2 (at least 1) and 4"),
        (|t| t.rows[0].labels.clear(), "rows[0]: 0 labels and 4 cells"),
        (|t| t.comparisons[0].differences[0].decimals = usize::MAX, "expected at most 12"),
    ];
    for (damage, message) in damaged {
        let mut results = results.clone();
        damage(&mut results.tables[0].table);
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
    let table = &results.tables[0].table;
    assert_eq!((table.source, table.rows.len(), results.missing()), (Source::Absent, 0, 0));
    let text = report::markdown(table);
    assert!(text.contains("Not run: no data for this table.") && text.contains("19.70"), "{text}");
}

#[test]
fn comparisons_find_what_moved() {
    let base = results(&table_7(), run);
    assert_eq!(compare(&base, &base, &Tolerances::NONE).verdict, Verdict::Identical);
    let moved = |by: f64| {
        results(&table_7(), |plan| {
            let mut records = run(plan);
            let key = &plan.jobs[3].variants[1].key;
            let Outcome::Scored { score, .. } = &mut records.get_mut(key).unwrap().outcome else {
                unreachable!()
            };
            score.psnr += by;
            records
        })
    };
    let within = compare(&base, &moved(-0.01), &Tolerances::default());
    assert_eq!((within.verdict, within.sequences.len(), within.frames.len()), (Verdict::Within, 0, 1));
    assert_eq!(compare(&base, &moved(-0.01), &Tolerances::NONE).verdict, Verdict::Worse);
    let better = compare(&base, &moved(0.6), &Tolerances::default());
    assert_eq!((better.verdict, better.verdict.is_good()), (Verdict::Better, true));
    let worse = compare(&base, &moved(-0.6), &Tolerances::default());
    assert_eq!((worse.verdict, worse.verdict.is_good()), (Verdict::Worse, false));
    assert_eq!(worse.frames[0].at, "table7 / gymnasts/anna/anna-test / quaternions / image_0003");
    let (change, expected) = (worse.sequences[0].candidate - worse.sequences[0].baseline, -0.1);
    assert!((change - expected).abs() < 1e-12, "{change}");
    insta::assert_snapshot!(worse.markdown(5), @r#"
    # Comparison: worse

    4 sequences and variants compared.

    ## Sequences beyond the tolerance

    | where | metric | baseline | candidate | change |
    |:--|:--|--:|--:|--:|
    | table7 / gymnasts/anna/anna-test / quaternions | PSNR | 20.750000 | 20.650000 | -1.000e-1 (worse) |

    ## Frames that moved most

    | where | metric | baseline | candidate | change |
    |:--|:--|--:|--:|--:|
    | table7 / gymnasts/anna/anna-test / quaternions / image_0003 | PSNR | 20.800000 | 20.200000 | -6.000e-1 (worse) |
    "#);
}

#[test]
fn lost_frames_are_worse_and_new_ones_are_not() {
    let (full, holes) = (results(&table_7(), run), results(&table_7(), with_holes));
    let lost = compare(&full, &holes, &Tolerances { psnr: 1e9, ssim: 1e9, lpips: 1e9, splats: 1e9 });
    assert_eq!(lost.verdict, Verdict::Worse);
    assert!(lost.lost.iter().any(|at| at.ends_with("anna-test / matrices / image_0002")), "{:?}", lost.lost);
    assert!(lost.lost.iter().any(|at| at.ends_with("bob-test / matrices lpips")), "{:?}", lost.lost);
    let empty = results(&table_7(), |_| Records::new());
    assert_eq!(compare(&empty, &full, &Tolerances::NONE).lost.len(), 0);
    let mut other = full.clone();
    other.tables[0].experiment = "table8".into();
    assert_eq!(compare(&empty, &other, &Tolerances::NONE).verdict, Verdict::NothingCompared);
}
