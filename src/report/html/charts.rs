//! Scores over frames, and fits over their iterations, as charts.

use super::KeptPictures;
use crate::report::results::{SequenceResults, TableResults, VariantResults};
use skinsplat_metrics::MetricId;
use skinsplat_page::{Chart, Part, Point, Series};
use std::collections::BTreeMap;

/// Charts that stand open; more are folded.
const OPEN: usize = 4;
/// Points of a line; of longer sequences every n-th frame is drawn.
const POINTS: usize = 1500;

/// A chart per sequence and metric that the table shows.
pub(super) fn over_frames(results: &TableResults, pictures: &KeptPictures) -> Vec<Part> {
    let shown = |metric: &MetricId| results.table.columns.iter().any(|column| column.key == metric.id());
    let metrics: Vec<MetricId> = MetricId::of_frames().filter(shown).collect();
    let mut charts: Vec<Part> = Vec::new();
    for sequence in &results.sequences {
        let charted = metrics.iter().filter_map(|&metric| chart(results, sequence, metric, pictures));
        charts.extend(charted.map(Part::Chart));
    }
    if charts.len() > OPEN {
        let rest = charts.split_off(metrics.len().min(charts.len()));
        charts.push(Part::Folded(format!("{} more charts over frames", rest.len()), rest));
    }
    charts
}

fn chart(
    results: &TableResults,
    sequence: &SequenceResults,
    metric: MetricId,
    pictures: &KeptPictures,
) -> Option<Chart> {
    let longest = sequence.variants.iter().map(|variant| variant.frames.len()).max()?;
    let every = longest.div_ceil(POINTS).max(1);
    let known = metric.metric();
    let unit = if known.unit.is_empty() { String::new() } else { format!(", {}", known.unit) };
    let title = format!("{} over frames: {}", metric.title(), sequence.label);
    let mut chart = Chart::lines(title, "frame", format!("{}{unit}", metric.title()));
    if every > 1 {
        chart = chart.note(format!("Every {every}th frame is drawn."));
    }
    let mut any = false;
    for variant in &sequence.variants {
        let points = points(results, sequence, variant, metric, pictures, every);
        any |= !points.is_empty();
        chart = chart.with(Series::new(&variant.label, points));
    }
    any.then_some(chart)
}

fn points(
    results: &TableResults,
    sequence: &SequenceResults,
    variant: &VariantResults,
    metric: MetricId,
    pictures: &KeptPictures,
    every: usize,
) -> Vec<Point> {
    let shown = variant.frames.iter().step_by(every);
    let point = |frame: &crate::report::FrameResult| {
        let value = frame.value(metric)?;
        let digits = metric.decimals() + 1;
        let title = format!("{}, {}: {value:.digits$}", variant.label, frame.name);
        let point = Point::new(frame.frame as f64, value).titled(title);
        let kept = pictures.has(&results.experiment, &sequence.id, &frame.name);
        Some(if kept { point.to(&sequence.label, &frame.name) } else { point })
    };
    shown.filter_map(point).collect()
}

/// A chart of PSNR over iterations per subject of the table.
pub(super) fn training(results: &TableResults, csv: &str) -> Vec<Part> {
    let mut charts: BTreeMap<String, BTreeMap<String, Vec<Point>>> = BTreeMap::new();
    let mut reader = ::csv::Reader::from_reader(csv.as_bytes());
    let label = |id: &str| {
        let variants = results.sequences.iter().flat_map(|sequence| &sequence.variants);
        variants
            .into_iter()
            .find(|variant| variant.id == id)
            .map_or_else(|| id.to_owned(), |v| v.label.clone())
    };
    for record in reader.records().map_while(Result::ok) {
        let field = |i: usize| record.get(i).unwrap_or_default();
        if field(0) != results.experiment {
            continue;
        }
        let Ok(iteration) = field(4).parse::<f64>() else { continue };
        for (column, what) in [(6, "training"), (7, "test")] {
            if let Ok(psnr) = field(column).parse::<f64>() {
                let subject = format!("{}/{}", field(1), field(2));
                let name = format!("{}, {what}", label(field(3)));
                charts.entry(subject).or_default().entry(name).or_default().push(Point::new(iteration, psnr));
            }
        }
    }
    let chart = |(subject, series): (String, BTreeMap<String, Vec<Point>>)| {
        let chart = Chart::lines(format!("PSNR while fitting: {subject}"), "iteration", "PSNR, dB");
        Part::Chart(
            series.into_iter().fold(chart, |chart, (name, points)| chart.with(Series::new(name, points))),
        )
    };
    charts.into_iter().map(chart).collect()
}
