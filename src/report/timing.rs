//! What frames cost, and where the time of a run went.

use super::results::{Results, VariantResults};
use crate::experiment::{Records, Seconds};
use crate::run::provenance::Phases;
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Digits, Direction, Label, Row, Table};

/// A row per table and variant: Gaussians, and the time of a frame. None without a record that knows its time.
pub fn costs(results: &Results, records: &Records) -> Option<Table> {
    let mut table = Table {
        sentences: vec![
            "Means over the frames of all sequences, quality beside them".to_owned(),
            "Times were taken once per frame, while other frames were drawn on the other threads: `reproduce trade` measures with \
             repeats in alternating order"
                .to_owned(),
        ],
        labels: vec![Label::new("table", "Table").once(), Label::new("variant", "Variant")],
        columns: vec![
            Column::new("psnr", "PSNR").better(Direction::Higher).digits(Digits::Decimals(2)),
            Column::new("splats", "Splats").better(Direction::Lower).digits(Digits::Decimals(0)),
            Column::new("visible", "Visible").digits(Digits::Decimals(0)).about("those that reach the image"),
            time("pose", "Pose, ms"),
            time("render", "Draw, ms"),
            time("score", "Score, ms"),
        ],
        ..Table::new("costs", "Cost of a frame")
    };
    for of in &results.tables {
        let Some(first) = of.sequences.first() else { continue };
        for (v, variant) in first.variants.iter().enumerate() {
            let all: Vec<&VariantResults> = of.sequences.iter().filter_map(|s| s.variants.get(v)).collect();
            let Some(cells) = cells(&all, records) else { continue };
            let id = format!("{}/{}", of.experiment, variant.id);
            table.rows.push(Row::new(id, [of.table.title.as_str(), &variant.label], cells));
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

fn time(key: &str, title: &str) -> Column {
    Column::new(key, title).better(Direction::Lower).digits(Digits::Significant(3)).timing()
}

fn cells(variants: &[&VariantResults], records: &Records) -> Option<Vec<Cell>> {
    let frames = || variants.iter().flat_map(|variant| &variant.frames).filter(|f| f.score.is_some());
    let seconds: Vec<&Seconds> =
        frames().filter_map(|frame| Some(&records.get(&frame.key)?.seconds)).collect();
    if seconds.is_empty() {
        return None;
    }
    let means: Vec<f64> = variants.iter().filter_map(|variant| variant.value(MetricId::PSNR)).collect();
    let splats: Vec<f64> = variants.iter().filter_map(|variant| variant.value(MetricId::SPLATS)).collect();
    let visible: Vec<f64> = frames().filter_map(|frame| frame.visible_splats).map(|n| n as f64).collect();
    let number = |values: &[f64], digits| match values {
        [] => Cell::empty(),
        values => Cell::number(values.iter().sum::<f64>() / values.len() as f64, digits),
    };
    let ms = |of: fn(&Seconds) -> f64| {
        let values: Vec<f64> = seconds.iter().map(|s| 1000.0 * of(s)).collect();
        number(&values, Digits::Significant(3))
    };
    Some(vec![
        number(&means, Digits::Decimals(2)),
        number(&splats, Digits::Decimals(0)),
        number(&visible, Digits::Decimals(0)),
        ms(|s| s.pose),
        ms(|s| s.render),
        ms(|s| s.score),
    ])
}

/// Where the time of the last call went: planning, every avatar, the frames; wall-clock seconds.
pub fn calls(phases: &Phases) -> Table {
    let avatars = phases.avatars.iter().map(|(avatar, seconds)| (format!("avatar {avatar}"), *seconds));
    let parts = std::iter::once(("data and plan".to_owned(), phases.plan)).chain(avatars);
    let parts = parts.chain(std::iter::once(("frames".to_owned(), phases.frames)));
    let row = |(i, (part, seconds)): (usize, (String, f64))| {
        Row::new(i.to_string(), [part], vec![Cell::number(seconds, Digits::Significant(3))])
    };
    Table {
        sentences: vec![
            "Wall-clock seconds of the last call of `run` on this folder; what it found done took none"
                .to_owned(),
        ],
        labels: vec![Label::new("part", "Part")],
        columns: vec![time("seconds", "Time, s")],
        rows: parts.enumerate().map(row).collect(),
        ..Table::new("calls", "The last call")
    }
}

/// Where the time of the frames went, per table: seconds of posing, drawing and scoring, added over threads. None without a
/// record of the results.
pub fn phases(results: &Results, records: &Records) -> Option<Table> {
    let mut table = Table {
        sentences: vec!["Seconds, added over the threads".to_owned()],
        labels: vec![Label::new("table", "Table").once(), Label::new("variant", "Variant")],
        columns: vec![
            Column::new("frames", "Frames").digits(Digits::Decimals(0)),
            time("pose", "Pose, s"),
            time("render", "Draw, s"),
            time("score", "Score, s"),
        ],
        ..Table::new("timing", "Where the time went")
    };
    let mut recorded = 0;
    for of in &results.tables {
        let Some(first) = of.sequences.first() else { continue };
        for (v, variant) in first.variants.iter().enumerate() {
            let frames =
                of.sequences.iter().filter_map(|s| s.variants.get(v)).flat_map(|variant| &variant.frames);
            let seconds: Vec<&Seconds> = frames.filter_map(|f| Some(&records.get(&f.key)?.seconds)).collect();
            recorded += seconds.len();
            let sum = |of: fn(&Seconds) -> f64| {
                Cell::number(seconds.iter().map(|s| of(s)).sum(), Digits::Significant(3))
            };
            let cells =
                vec![Cell::count(seconds.len()), sum(|s| s.pose), sum(|s| s.render), sum(|s| s.score)];
            let id = format!("{}/{}", of.experiment, variant.id);
            table.rows.push(Row::new(id, [of.table.title.as_str(), &variant.label], cells));
        }
    }
    (recorded > 0).then_some(table)
}
