//! One table value in every format.

use super::made_up::{run, table, table_7, wide_table_7, with_holes};
use skinsplat::report::{self, TableResults};
use skinsplat_table::{csv, json, latex};

/// The table without what has tables of its own.
fn own_only(mut table: TableResults) -> TableResults {
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
    | anna | Matrices | **20.25** | **0.920** | **0.1797** | 100 |
    |  | Matrices, paper | 20.10 | 0.920 | 0.1800 | 90 |
    |  | Matrices − paper | +0.15 | 0.000 | −0.0003 | +10 |
    |  | Quaternions | **20.75** | **0.921** | **0.1793** | 100 |
    | bob | Matrices | **21.25** | **0.921** | **0.1787** | 100 |
    |  | Matrices, paper | **21.00** | 0.820 <sup>1</sup> | 0.1600 | 90 |
    |  | Matrices − paper | +0.25 | +0.101 | +0.0187 | +10 |
    |  | Quaternions | **21.75** | **0.922** | **0.1783** | 100 |
    | Mean | Matrices | 20.75 | 0.921 | 0.1792 | 100 |
    |  | Quaternions | **21.25** | **0.921** | **0.1788** | 100 |

    <sup>1</sup> bob, Matrices: ssim 0.820 looks like a slip

    A made-up table.

    Frame by frame: mean difference, its 95 % interval over what the column names, what that decides, and the share of frames won.

    | Sequence | Difference | Frames | Interval covers | Δ PSNR | Δ SSIM | Δ LPIPS |
    | :-- | :-- | --: | :-- | --: | --: | --: |
    | anna | Quaternions − Matrices | 6 | — | +0.500, too few frames, won 100 % | +0.0005, too few frames, won 100 % | −0.00050, too few frames, won 100 % |
    | bob | Quaternions − Matrices | 6 | — | +0.500, too few frames, won 100 % | +0.0005, too few frames, won 100 % | −0.00050, too few frames, won 100 % |
    | All | Quaternions − Matrices | 12 | 2 subjects | +0.500 [+0.500, +0.500], better, won 100 % | +0.0005 [+0.0005, +0.0005], better, won 100 % | −0.00050 [−0.00050, −0.00050], better, won 100 % |

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
    insta::assert_snapshot!(csv(&table(&table_7(), run).table), @r#"
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
    insta::assert_snapshot!(latex(&table(&table_7(), run).table), @r#"
    \begin{table}
    \centering
    \caption{Gymnasts, matrices against quaternions. Ran on: Gymnasts (gymnasts). Protocol: avatar-v1, version 1. Profile: standard, every frame at native resolution. Frames: 12 per variant, in 2 sequences (6 each). Mean: each sequence counts once.}
    \label{tab:table7}
    \begin{tabular}{llrrrr}
    \toprule
    Sequence & Variant & PSNR $\uparrow$ & SSIM $\uparrow$ & LPIPS* $\downarrow$ & Splats $\downarrow$ \\
    \midrule
    anna & Matrices & \textbf{20.25} & \textbf{0.920} & \textbf{0.1797} & 100 \\
     & Matrices, paper & 20.10 & 0.920 & 0.1800 & 90 \\
     & Matrices $-$ paper & +0.15 & 0.000 & $-$0.0003 & +10 \\
     & Quaternions & \textbf{20.75} & \textbf{0.921} & \textbf{0.1793} & 100 \\
    \midrule
    bob & Matrices & \textbf{21.25} & \textbf{0.921} & \textbf{0.1787} & 100 \\
     & Matrices, paper & \textbf{21.00} & 0.820$^{1}$ & 0.1600 & 90 \\
     & Matrices $-$ paper & +0.25 & +0.101 & +0.0187 & +10 \\
     & Quaternions & \textbf{21.75} & \textbf{0.922} & \textbf{0.1783} & 100 \\
    \midrule
    Mean & Matrices & 20.75 & 0.921 & 0.1792 & 100 \\
     & Quaternions & \textbf{21.25} & \textbf{0.921} & \textbf{0.1788} & 100 \\
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
    | Matrices | **20.25** | **0.920** | **0.1797** | 100 | **21.25** | **0.921** | **0.1787** | 100 | 20.75 | 0.921 | 0.1792 | 100 |
    | Matrices, paper | 20.10 | 0.920 | 0.1800 | 90 | **21.00** | 0.820 <sup>1</sup> | 0.1600 | 90 | — | — | — | — |
    | Matrices − paper | +0.15 | 0.000 | −0.0003 | +10 | +0.25 | +0.101 | +0.0187 | +10 | — | — | — | — |
    | Quaternions | **20.75** | **0.921** | **0.1793** | 100 | **21.75** | **0.922** | **0.1783** | 100 | **21.25** | **0.921** | **0.1788** | 100 |

    <sup>1</sup> bob, Matrices: ssim 0.820 looks like a slip

    A made-up table.
    "#);
    insta::assert_snapshot!(csv(&table.table), @r#"
    method,kind,frames,missing,anna psnr,anna ssim,anna lpips,anna splats,bob psnr,bob ssim,bob lpips,bob splats,All psnr,All ssim,All lpips,All splats,notes
    Matrices,measured,12,0,20.25,0.9202499999999999,0.17975,100,21.25,0.92125,0.17875,100,20.75,0.92075,0.17925,100,
    "Matrices, paper",paper,0,0,20.10,0.920,0.1800,90,21.00,0.820,0.1600,90,,,,,"bob, Matrices: ssim 0.820 looks like a slip"
    Matrices − paper,difference,12,0,0.14999999999999858,0.00024999999999986144,-0.0002500000000000002,10,0.25,0.10125000000000006,0.01874999999999999,10,,,,,
    Quaternions,measured,12,0,20.75,0.9207500000000001,0.17925000000000002,100,21.75,0.92175,0.17825000000000002,100,21.25,0.92125,0.17875000000000002,100,
    "#);
    insta::assert_snapshot!(latex(&table.table), @r#"
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
    Matrices & \textbf{20.25} & \textbf{0.920} & \textbf{0.1797} & 100 & \textbf{21.25} & \textbf{0.921} & \textbf{0.1787} & 100 & 20.75 & 0.921 & 0.1792 & 100 \\
    Matrices, paper & 20.10 & 0.920 & 0.1800 & 90 & \textbf{21.00} & 0.820$^{1}$ & 0.1600 & 90 & --- & --- & --- & --- \\
    Matrices $-$ paper & +0.15 & 0.000 & $-$0.0003 & +10 & +0.25 & +0.101 & +0.0187 & +10 & --- & --- & --- & --- \\
    Quaternions & \textbf{20.75} & \textbf{0.921} & \textbf{0.1793} & 100 & \textbf{21.75} & \textbf{0.922} & \textbf{0.1783} & 100 & \textbf{21.25} & \textbf{0.921} & \textbf{0.1788} & 100 \\
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
    | bob | Matrices | 21.00 | **0.500** | n/c <sup>2</sup> | 100 |
    |  | Matrices, paper | **21.00** | 0.820 <sup>3</sup> | 0.1600 | 90 |
    |  | Matrices − paper | 0.00 | −0.320 | — | +10 |
    |  | Quaternions | **∞** | **0.935** | 0.1485 | 100 |
    | Mean | Matrices | 20.65 <sup>4</sup> | 0.710 <sup>4</sup> | n/c <sup>4,2</sup> | 100 <sup>4</sup> |
    |  | Quaternions | ∞ | 0.928 | 0.1639 | 100 |

    <sup>1</sup> anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)

    <sup>2</sup> n/c: LPIPS\* was not computed for every frame (it needs the network's weights and images of its minimum size)

    <sup>3</sup> bob, Matrices: ssim 0.820 looks like a slip

    <sup>4</sup> Mean, Matrices: 2 frames missing in all

    A made-up table.
    "#);
    insta::assert_snapshot!(csv(&table.table), @r#"
    sequence,variant,kind,frames,missing,psnr,ssim,lpips,splats,notes
    anna,Matrices,measured,4,2,20.299999999999997,0.9203,0.1797,100,"anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)"
    anna,"Matrices, paper",paper,0,0,20.10,0.920,0.1800,90,
    anna,Matrices − paper,difference,4,2,0.19999999999999574,0.00029999999999996696,-0.0002999999999999947,10,
    anna,Quaternions,measured,6,0,20.75,0.9207500000000001,0.17925000000000002,100,
    bob,Matrices,measured,6,0,21,0.5,,100,n/c: LPIPS* was not computed for every frame (it needs the network's weights and images of its minimum size)
    bob,"Matrices, paper",paper,0,0,21.00,0.820,0.1600,90,"bob, Matrices: ssim 0.820 looks like a slip"
    bob,Matrices − paper,difference,6,0,0,-0.31999999999999995,,10,
    bob,Quaternions,measured,6,0,inf,0.9348166666666667,0.14851666666666669,100,
    Mean,Matrices,mean,10,2,20.65,0.7101500000000001,,100,"n/c: LPIPS* was not computed for every frame (it needs the network's weights and images of its minimum size); Mean, Matrices: 2 frames missing in all"
    Mean,Quaternions,mean,12,0,inf,0.9277833333333334,0.16388333333333335,100,
    "#);
}

#[test]
fn a_table_value_as_json() {
    let mut table = own_only(table(&table_7(), with_holes));
    table.table.rows.truncate(1);
    insta::assert_snapshot!(json(&table.table), @r#"
    {
      "id": "table7",
      "title": "Table 7",
      "sentences": [
        "Gymnasts, matrices against quaternions",
        "Ran on: Gymnasts (gymnasts)",
        "Protocol: avatar-v1, version 1",
        "Profile: standard, every frame at native resolution",
        "Frames: 12 per variant, in 2 sequences (6 each)",
        "Mean: each sequence counts once"
      ],
      "sample_unit": "frames",
      "labels": [
        {
          "key": "sequence",
          "title": "Sequence",
          "once": true
        },
        {
          "key": "variant",
          "title": "Variant"
        }
      ],
      "columns": [
        {
          "key": "psnr",
          "title": "PSNR",
          "better": "higher",
          "digits": {
            "decimals": 2
          },
          "align": "right"
        },
        {
          "key": "ssim",
          "title": "SSIM",
          "better": "higher",
          "digits": {
            "decimals": 3
          },
          "align": "right"
        },
        {
          "key": "lpips",
          "title": "LPIPS*",
          "better": "lower",
          "digits": {
            "decimals": 4
          },
          "align": "right"
        },
        {
          "key": "splats",
          "title": "Splats",
          "better": "lower",
          "digits": {
            "decimals": 0
          },
          "align": "right"
        }
      ],
      "rows": [
        {
          "id": "gymnasts/anna/anna-test/matrices",
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
              "missing": 2,
              "notes": [
                0
              ]
            }
          ],
          "sample": 4,
          "missing": 2
        }
      ],
      "notes": [
        "anna, Matrices: 2 of 6 frames missing: image_0001 (failed: truth: image_0001.png is truncated), image_0002 (not run)",
        "n/c: LPIPS* was not computed for every frame (it needs the network's weights and images of its minimum size)",
        "bob, Matrices: ssim 0.820 looks like a slip",
        "Mean, Matrices: 2 frames missing in all"
      ],
      "remarks": [
        "A made-up table."
      ]
    }
    "#);
}

#[test]
fn csv_reads_back_in_full_precision() {
    for experiment in [table_7(), wide_table_7()] {
        let table = table(&experiment, with_holes).table;
        let text = csv(&table);
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().unwrap().clone();
        let records: Vec<::csv::StringRecord> = reader.records().map(Result::unwrap).collect();
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
