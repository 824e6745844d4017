//! One table that has everything, in every format.

use proptest::prelude::*;
use skinsplat_table::{
    Cell, Column, Content, Digits, Direction, FORMATS, Format, Label, Row, RowKind, Table, csv, csv_by_cell,
    json, latex, mark_best, markdown, text,
};

/// Every kind of cell, row, note and column, and names that each format would obey.
fn everything() -> Table {
    let mut table = Table {
        sentences: vec!["Names such as `a|b_*c` are shown & 100 % safe".into(), "A second sentence".into()],
        sample_unit: Some("frames".into()),
        labels: vec![Label::new("sequence", "Sequence").once(), Label::new("variant", "Variant")],
        columns: vec![
            Column::new("psnr", "PSNR").group("lab_1").better(Direction::Higher).digits(Digits::Decimals(2)),
            Column::new("time", "ms")
                .group("lab_1")
                .better(Direction::Lower)
                .digits(Digits::Significant(3))
                .timing(),
            Column::new("limit", "Limit").group("=lab|2").about("where it *breaks*, by `axis|2`"),
            Column::text("word", "A <word>").group("=lab|2"),
        ],
        notes: vec!["n/c: no weights\nfor `vgg`".into(), "one | two".into()],
        remarks: vec!["A remark on `code_1` and <all>.".into()],
        ..Table::new("every_thing", "Table #1: a|b\u{1b}[31m")
    };
    let row =
        |id: &str, kind, labels: [&str; 2], cells| Row { kind, sample: 6, ..Row::new(id, labels, cells) };
    let number = |value: f64| Cell::number(value, Digits::Decimals(2));
    let noted = |cell: Cell, notes: &[usize]| Cell { notes: notes.to_vec(), ..cell };
    table.rows = vec![
        row(
            "anna/spread",
            RowKind::Measured,
            ["anna", "=SUM(A1)"],
            vec![
                Cell::with_spread(Content::Number(20.125), Some(0.25), Digits::Decimals(2)),
                Cell::number(1.5e-5, Digits::Significant(3)),
                Cell::phrase(-1e-9, "breaks at -1e-9"),
                Cell::text("@home, or `not`"),
            ],
        ),
        row(
            "anna/infinite",
            RowKind::Measured,
            ["anna", "a*b_"],
            vec![
                number(f64::INFINITY),
                Cell::number(42.0, Digits::Significant(3)),
                Cell::text("holds"),
                Cell::flag(true),
            ],
        ),
        Row {
            missing: 2,
            ..row(
                "bob/none",
                RowKind::Measured,
                ["bob\t\u{202e}", "plain"],
                vec![
                    noted(Cell::new(Content::NotComputed, Digits::Exact), &[1, 0]),
                    Cell { missing: 2, ..Cell::new(Content::Missing, Digits::Exact) },
                    Cell::empty(),
                    Cell::flag(false),
                ],
            )
        },
        row(
            "bob/paper",
            RowKind::Paper,
            ["bob\t\u{202e}", "paper"],
            vec![number(20.1), Cell::number(1234.4, Digits::Significant(3)), Cell::empty(), Cell::text("-x")],
        ),
        row(
            "bob/difference",
            RowKind::Difference,
            ["bob\t\u{202e}", "− paper"],
            vec![
                Cell::difference(0.125, Digits::Decimals(2)),
                Cell::difference(-1.0, Digits::Decimals(0)),
                Cell::difference(-0.001, Digits::Decimals(2)),
                Cell::text("-"),
            ],
        ),
        row(
            "mean",
            RowKind::Mean,
            ["Mean", "all"],
            vec![number(-0.5), Cell::count(7), Cell::empty(), Cell::text("")],
        ),
    ];
    let directions: Vec<_> = table.columns.iter().map(|column| column.better).collect();
    let mut anna: Vec<&mut Vec<Cell>> = table.rows[..2].iter_mut().map(|row| &mut row.cells).collect();
    mark_best(&mut anna, &directions);
    table
}

#[test]
fn the_table_is_sound() {
    everything().check().unwrap();
}

#[test]
fn as_markdown() {
    insta::assert_snapshot!(markdown(&everything()), @r#"
    ## Table #1: a\|b\\u{1b}[31m

    Names such as `a|b_*c` are shown & 100 % safe.
    A second sentence.

    | Sequence | Variant | lab_1 PSNR ↑ | lab_1 ms ↓ | =lab\|2 Limit | =lab\|2 A &lt;word> |
    | :-- | :-- | --: | --: | --: | :-- |
    | anna | =SUM(A1) | 20.12 ± 0.25 | **1.5e−5** | breaks at −1e−9 | @home, or \`not\` |
    |  | a\*b\_ | **∞** | 42.0 | holds | yes |
    | bob \\u{202e} | plain | n/c <sup>2,1</sup> | — | — | no |
    |  | paper | 20.10 | 1234 | — | -x |
    |  | − paper | +0.12 | −1 | 0.00 | - |
    | Mean | all | −0.50 | 7 | — |  |

    <sup>1</sup> n/c: no weights for \`vgg\`

    <sup>2</sup> one \| two

    - Limit: where it \*breaks\*, by `axis|2`

    A remark on `code_1` and &lt;all>.
    "#);
}

#[test]
fn as_csv() {
    insta::assert_snapshot!(csv(&everything()), @r#"
    sequence,variant,kind,frames,missing,lab_1 psnr,lab_1 time,'=lab|2 limit,'=lab|2 word,lab_1 psnr sd,'=lab|2 limit number,notes
    anna,'=SUM(A1),measured,6,0,20.125,0.000015,breaks at -1e-9,"'@home, or `not`",0.25,-0.000000001,
    anna,a*b_,measured,6,0,inf,42,holds,true,,,
    bob \u{202e},plain,measured,6,2,,,,false,,,n/c: no weights for `vgg`; one | two
    bob \u{202e},paper,paper,6,0,20.10,1234,,'-x,,,
    bob \u{202e},− paper,difference,6,0,0.125,-1,-0.001,-,,,
    Mean,all,mean,6,0,-0.5,7,,,,,
    "#);
}

#[test]
fn as_csv_by_cell() {
    let mut table = everything();
    table.rows.truncate(1);
    insta::assert_snapshot!(csv_by_cell([&table]), @r#"
    section,row,column,timing,value
    every_thing,anna/spread,sequence,no,anna
    every_thing,anna/spread,variant,no,'=SUM(A1)
    every_thing,anna/spread,lab_1 psnr,no,20.125
    every_thing,anna/spread,lab_1 psnr sd,no,0.25
    every_thing,anna/spread,lab_1 time,yes,0.000015
    every_thing,anna/spread,'=lab|2 limit,no,breaks at -1e-9
    every_thing,anna/spread,'=lab|2 limit number,no,-0.000000001
    every_thing,anna/spread,'=lab|2 word,no,"'@home, or `not`"
    "#);
}

#[test]
fn as_latex() {
    insta::assert_snapshot!(latex(&everything()), @r#"
    \begin{table}
    \centering
    \caption{Names such as \texttt{a|b\_*c} are shown \& 100 \% safe. A second sentence.}
    \label{tab:every_thing}
    \begin{tabular}{llrrrl}
    \toprule
     &  & \multicolumn{2}{c}{lab\_1} & \multicolumn{2}{c}{=lab|2} \\
    \cmidrule(lr){3-4}
    \cmidrule(lr){5-6}
    Sequence & Variant & PSNR $\uparrow$ & ms $\downarrow$ & Limit & A $<$word$>$ \\
    \midrule
    anna & =SUM(A1) & 20.12 ± 0.25 & \textbf{1.5e$-$5} & breaks at $-$1e$-$9 & @home, or `not` \\
     & a*b\_ & \textbf{$\infty$} & 42.0 & holds & yes \\
    \midrule
    bob \textbackslash{}u\{202e\} & plain & n/c$^{2,1}$ & --- & --- & no \\
     & paper & 20.10 & 1234 & --- & -x \\
     & $-$ paper & +0.12 & $-$1 & 0.00 & - \\
    \midrule
    Mean & all & $-$0.50 & 7 & --- &  \\
    \bottomrule
    \end{tabular}
    \\ {\footnotesize $^{1}$ n/c: no weights for `vgg`}
    \\ {\footnotesize $^{2}$ one | two}
    \end{table}
    "#);
}

#[test]
fn as_text() {
    insta::assert_snapshot!(text(&everything()), @r#"
    Table #1: a|b\u{1b}[31m
    Names such as `a|b_*c` are shown & 100 % safe.
    A second sentence.

      Variant   lab_1 PSNR ↑       lab_1 ms ↓      =lab|2 Limit  =lab|2 A <word>
    anna
      =SUM(A1)  20.12 ± 0.25           1.5e−5*  breaks at −1e−9  @home, or `not`
      a*b_                 ∞*            42.0             holds  yes
    bob \u{202e}
      plain              n/c[2,1]           —                 —  no
      paper            20.10             1234                 —  -x
      − paper          +0.12               −1              0.00  -
    Mean
      all              −0.50                7                 —

    [1] n/c: no weights for `vgg`
    [2] one | two

    Limit: where it *breaks*, by `axis|2`

    A remark on `code_1` and <all>.
    "#);
}

#[test]
fn as_rows_of_text() {
    let mut list = Table::new("list", "A list");
    list.labels = vec![Label::new("id", "Id")];
    list.columns = vec![Column::new("count", "Count"), Column::text("about", "About")];
    for (id, count, about) in [("one", 1, "a"), ("three", 333, "b")] {
        list.rows.push(Row::new(id, [id], vec![Cell::count(count), Cell::text(about)]));
    }
    insta::assert_snapshot!(skinsplat_table::text::rows(&list), @r#"
    one      1  a
    three  333  b
    "#);
}

#[test]
fn as_json() {
    let mut table = everything();
    table.rows.truncate(3);
    table.rows.remove(1);
    insta::assert_snapshot!(json(&table), @r#"
    {
      "id": "every_thing",
      "title": "Table #1: a|b\u001b[31m",
      "sentences": [
        "Names such as `a|b_*c` are shown & 100 % safe",
        "A second sentence"
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
          "group": "lab_1",
          "title": "PSNR",
          "better": "higher",
          "digits": {
            "decimals": 2
          },
          "align": "right"
        },
        {
          "key": "time",
          "group": "lab_1",
          "title": "ms",
          "better": "lower",
          "digits": {
            "significant": 3
          },
          "timing": true,
          "align": "right"
        },
        {
          "key": "limit",
          "group": "=lab|2",
          "title": "Limit",
          "about": "where it *breaks*, by `axis|2`",
          "align": "right"
        },
        {
          "key": "word",
          "group": "=lab|2",
          "title": "A <word>",
          "align": "left"
        }
      ],
      "rows": [
        {
          "id": "anna/spread",
          "kind": "measured",
          "labels": [
            "anna",
            "=SUM(A1)"
          ],
          "cells": [
            {
              "content": {
                "state": "number",
                "value": 20.125
              },
              "spread": 0.25,
              "text": "20.12 ± 0.25"
            },
            {
              "content": {
                "state": "number",
                "value": 0.000015
              },
              "text": "1.5e-5",
              "best": true
            },
            {
              "content": {
                "state": "phrase",
                "value": -1e-9
              },
              "text": "breaks at -1e-9"
            },
            {
              "content": {
                "state": "text"
              },
              "text": "@home, or `not`"
            }
          ],
          "sample": 6
        },
        {
          "id": "bob/none",
          "kind": "measured",
          "labels": [
            "bob\t\u202e",
            "plain"
          ],
          "cells": [
            {
              "content": {
                "state": "not-computed"
              },
              "text": "n/c",
              "notes": [
                1,
                0
              ]
            },
            {
              "content": {
                "state": "missing"
              },
              "text": "—",
              "missing": 2
            },
            {
              "content": {
                "state": "not-applicable"
              },
              "text": "—"
            },
            {
              "content": {
                "state": "flag",
                "value": false
              },
              "text": "no"
            }
          ],
          "sample": 6,
          "missing": 2
        }
      ],
      "notes": [
        "n/c: no weights\nfor `vgg`",
        "one | two"
      ],
      "remarks": [
        "A remark on `code_1` and <all>."
      ]
    }
    "#);
}

#[test]
fn json_reads_back() {
    let table = everything();
    let again: Table = serde_json::from_str(&json(&table)).unwrap();
    assert_eq!(again, table);
}

#[test]
fn formats_have_names_and_extensions_of_their_own() {
    for (i, format) in FORMATS.iter().enumerate() {
        assert_eq!(Format::named(format.id).unwrap().extension, format.extension);
        assert!(
            FORMATS[..i].iter().all(|other| other.id != format.id && other.extension != format.extension)
        );
    }
    assert!(Format::named("word").is_none());
}

#[test]
fn a_table_without_rows_or_columns_has_every_format() {
    let mut bare = Table::new("bare", "Bare");
    for format in FORMATS {
        assert!((format.write)(&bare).lines().count() >= 1 || format.id == "csv", "{}", format.id);
    }
    bare.labels = vec![Label::new("id", "Id")];
    bare.rows = vec![Row::new("a", ["a"], Vec::new())];
    bare.check().unwrap();
    for format in FORMATS {
        assert!((format.write)(&bare).contains('a'), "{}", format.id);
    }
}

/// How a table is damaged, and the complaint.
type Damage = (fn(&mut Table), &'static str);

#[test]
fn unsound_tables_are_refused_in_one_line() {
    let damages: [Damage; 6] = [
        (
            |t| t.columns[0].digits = Some(Digits::Decimals(usize::MAX)),
            "digits: 18446744073709551615; expected at most 12",
        ),
        (|t| t.columns[1].key = "psnr".into(), "columns: `lab_1 psnr` twice; expected each once"),
        (|t| t.rows[1].id = "mean".into(), "rows: `mean` twice; expected each once"),
        (|t| t.rows[1].labels.clear(), "rows[1]: 0 labels and 4 cells; expected 2 (at least 1) and 4"),
        (|t| t.rows[1].cells.truncate(1), "rows[1]: 2 labels and 1 cells; expected 2 (at least 1) and 4"),
        (|t| t.rows[1].cells[0].notes.push(2), "rows[1]: note 2; expected below 2"),
    ];
    for (damage, complaint) in damages {
        let mut table = everything();
        damage(&mut table);
        assert_eq!(table.check().unwrap_err(), format!("table `every_thing`: {complaint}"));
    }
}

proptest! {
    /// Whatever a text holds, it stays in its cell: no line more, no field more, nothing that a terminal obeys.
    #[test]
    fn texts_stay_in_their_cells(name in "\\PC*|[\\x00-\\xff]*") {
        let mut table = Table::new("t", "T");
        table.labels = vec![Label::new("id", "Id")];
        table.columns = vec![Column::text("name", "Name"), Column::new("value", "Value")];
        let cells = |name: &str| vec![Cell::text(name), Cell::number(1.0, Digits::Exact)];
        table.rows.push(Row::new("a", ["plain"], cells("plain")));
        let plain = FORMATS.iter().map(|format| (format.write)(&table).lines().count()).collect::<Vec<_>>();
        table.rows[0] = Row::new("a", [name.clone()], cells(&name));
        for (format, lines) in FORMATS.iter().zip(plain) {
            let written = (format.write)(&table);
            prop_assert_eq!(written.lines().count(), lines, "{}: {}", format.id, written);
            prop_assert!(!written.chars().any(|c| c != '\n' && c.is_control()), "{}", format.id);
        }
        let written = csv(&table);
        let mut reader = ::csv::Reader::from_reader(written.as_bytes());
        let record = reader.records().next().unwrap().unwrap();
        prop_assert_eq!((record.len(), &record[2]), (3, "1"));
        let grid = markdown(&table);
        let row = grid.lines().last().unwrap();
        let bars = row.replace("\\\\", "").replace("\\|", "").matches('|').count();
        prop_assert_eq!(bars, 4, "{}", row);
    }
}
