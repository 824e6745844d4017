//! What frames cost, and where the time of a run went.

use super::results::{Results, VariantResults};
use crate::experiment::{Records, Seconds};
use crate::run::costs::{Cost, Costs};
use crate::run::provenance::{FitParts, Phases};
use skinsplat_metrics::MetricId;
use skinsplat_table::{Cell, Column, Digits, Direction, Label, Row, Table};

/// A row per table and variant: size and Gaussians of the avatar, and the time of a frame, with repeats if they were `measured` by
/// this run. None without a record that knows its time.
pub fn costs(results: &Results, records: &Records, measured: Option<&Costs>) -> Option<Table> {
    let measured = measured.filter(|costs| costs.plan == results.plan);
    let once = "Times were taken once per frame, while other frames were drawn on the other threads: `run --html` and `reproduce \
                trade` measure with repeats in alternating order";
    let how = match measured {
        None => once.to_owned(),
        Some(Costs { frames, rounds, threads, .. }) => format!(
            "Posing and drawing: at most {frames} frames of a table, the median of {rounds} repeats, variants in alternating order, \
             one frame at a time on {threads} threads"
        ),
    };
    let mut table = Table {
        sentences: vec!["Means over the frames of all sequences, quality beside them".to_owned(), how],
        labels: vec![Label::new("table", "Table").once(), Label::new("variant", "Variant")],
        columns: vec![
            Column::new("psnr", "PSNR").better(Direction::Higher).digits(Digits::Decimals(2)),
            Column::new("bytes", "Bytes")
                .better(Direction::Lower)
                .digits(Digits::Decimals(0))
                .about("of the avatar's files: what the run made, or what it was given"),
            Column::new("splats", "Splats").better(Direction::Lower).digits(Digits::Decimals(0)),
            Column::new("visible", "Visible").digits(Digits::Decimals(0)).about("those that reach the image"),
            time("pose", "Pose, ms"),
            time("render", "Draw, ms"),
        ],
        ..Table::new("costs", "Cost of a frame")
    };
    for of in &results.tables {
        let Some(first) = of.sequences.first() else { continue };
        for (v, variant) in first.variants.iter().enumerate() {
            let all: Vec<&VariantResults> = of.sequences.iter().filter_map(|s| s.variants.get(v)).collect();
            let Some(mut cells) = cells(&all, records) else { continue };
            if let Some(costs) = measured {
                let is = |cost: &&Cost| cost.table == of.experiment && cost.variant == variant.id;
                let found = costs.variants.iter().find(is);
                let ms = |of: fn(&Cost) -> f64| {
                    found.map_or_else(Cell::empty, |cost| Cell::number(of(cost), Digits::Significant(3)))
                };
                (cells[POSE], cells[POSE + 1]) = (ms(|cost| cost.pose), ms(|cost| cost.draw));
            }
            let id = format!("{}/{}", of.experiment, variant.id);
            table.rows.push(Row::new(id, [of.table.title.as_str(), &variant.label], cells));
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// The column of posing; drawing follows.
const POSE: usize = 4;

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
    let bytes = frames().filter_map(|frame| Some(records.get(&frame.key)?.bytes? as f64));
    let bytes: Vec<f64> = bytes.collect();
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
        number(&bytes, Digits::Decimals(0)),
        number(&splats, Digits::Decimals(0)),
        number(&visible, Digits::Decimals(0)),
        ms(|s| s.pose),
        ms(|s| s.render),
    ])
}

/// Where the time of the last call went: planning, every avatar with the parts of its fit, the frames; wall-clock seconds.
pub fn calls(phases: &Phases) -> Table {
    let seconds = |value: f64| Cell::number(value, Digits::Significant(3));
    let part = |value: Option<f64>| value.filter(|v| *v > 0.0).map_or_else(Cell::empty, seconds);
    let row = |id: usize, name: String, parts: Option<FitParts>, total: f64| {
        let of_fit = [parts.map(|p| p.start), parts.map(|p| p.iterations), parts.map(|p| p.curve)].map(part);
        Row::new(id.to_string(), [name], of_fit.into_iter().chain([seconds(total)]).collect())
    };
    let mut rows = vec![row(0, "data and plan".to_owned(), None, phases.plan)];
    for (i, (avatar, total)) in phases.avatars.iter().enumerate() {
        rows.push(row(i + 1, format!("avatar {avatar}"), phases.fits.get(i).copied(), *total));
    }
    if phases.avatars.len() > 1 {
        let total = phases.avatars.iter().map(|(_, seconds)| seconds).sum();
        let parts = (!phases.fits.is_empty()).then(|| sum(&phases.fits));
        rows.push(row(rows.len(), "all avatars".to_owned(), parts, total));
    }
    rows.push(row(rows.len(), "frames".to_owned(), None, phases.frames));
    Table {
        sentences: vec![
            "Wall-clock seconds of the last call of `run` on this folder; avatars that it found done have the times of the call \
             that made them, and frames that it found done took none"
                .to_owned(),
            "Start: the avatar with which a fit begins. Fit: its iterations. Curve: scores on the way, on test frames. Avatars \
             without these were made from frames or read"
                .to_owned(),
        ],
        labels: vec![Label::new("part", "Part")],
        columns: vec![
            time("start", "Start, s"),
            time("fit", "Fit, s"),
            time("curve", "Curve, s"),
            time("seconds", "Time, s"),
        ],
        rows,
        ..Table::new("calls", "The last call")
    }
}

fn sum(parts: &[FitParts]) -> FitParts {
    let of = |part: fn(&FitParts) -> f64| parts.iter().map(part).sum();
    FitParts { start: of(|p| p.start), iterations: of(|p| p.iterations), curve: of(|p| p.curve) }
}

/// Where the time of the frames went, per table and variant, of tables of several sequences per sequence: seconds of posing,
/// drawing and scoring, and of fitting test poses where that was done, added over threads. None without a record of the results.
pub fn phases(results: &Results, records: &Records) -> Option<Table> {
    let fits = records.values().any(|record| record.seconds.fit > 0.0);
    let mut table = Table {
        sentences: vec![
            "Seconds, added over the threads. On a sequence a variant draws one avatar. Scoring holds what is drawn only to be \
             scored, such as the frame before for metrics of motion; what of the truth every score needs is in that of the first \
             variant"
                .to_owned(),
        ],
        labels: vec![
            Label::new("table", "Table").once(),
            Label::new("variant", "Variant").once(),
            Label::new("sequence", "Sequence"),
        ],
        columns: vec![
            Column::new("frames", "Frames").digits(Digits::Decimals(0)),
            time("pose", "Pose, s"),
            time("render", "Draw, s"),
            time("score", "Score, s"),
        ],
        ..Table::new("timing", "Where the time went")
    };
    table.columns.extend(fits.then(|| time("fit", "Fit poses, s").about("and their scores")));
    let mut recorded = 0;
    for of in &results.tables {
        let Some(first) = of.sequences.first() else { continue };
        for (v, variant) in first.variants.iter().enumerate() {
            let mut all = Vec::new();
            let mut row = |sequence: &str, label: &str, seconds: &[&Seconds]| {
                let id = format!("{}/{}/{sequence}", of.experiment, variant.id);
                table.rows.push(Row::new(
                    id,
                    [of.table.title.as_str(), &variant.label, label],
                    sums(seconds, fits),
                ));
            };
            for sequence in &of.sequences {
                let frames = sequence.variants.get(v).map_or(&[][..], |variant| variant.frames.as_slice());
                let seconds: Vec<&Seconds> =
                    frames.iter().filter_map(|f| Some(&records.get(&f.key)?.seconds)).collect();
                if of.sequences.len() > 1 {
                    row(&sequence.id, &sequence.label, &seconds);
                }
                all.extend(seconds);
            }
            recorded += all.len();
            row("", "all", &all);
        }
    }
    (recorded > 0).then_some(table)
}

/// How many frames there are, and the sums of their phases.
fn sums(seconds: &[&Seconds], fits: bool) -> Vec<Cell> {
    let sum =
        |of: fn(&Seconds) -> f64| Cell::number(seconds.iter().map(|s| of(s)).sum(), Digits::Significant(3));
    let mut cells = vec![Cell::count(seconds.len()), sum(|s| s.pose), sum(|s| s.render), sum(|s| s.score)];
    cells.extend(fits.then(|| sum(|s| s.fit)));
    cells
}
