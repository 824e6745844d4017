//! Scores over frames, and fits over their iterations, as charts.

use super::pictures::{Budget, KeptPictures, Links};
use crate::experiment::Shown;
use crate::report::results::{FrameResult, SequenceResults, TableResults, VariantResults};
use skinsplat_metrics::MetricId;
use skinsplat_page::{Chart, Part, Point, Series};
use std::collections::BTreeMap;

/// Charts that stand open; more are folded.
const OPEN: usize = 4;
/// Points of a line; of longer sequences the extremes of every so many frames are drawn.
const POINTS: usize = 1500;

/// Points of a series over the bend, each of which is drawn by itself.
const POINTS_APART: usize = 300;
/// Points of a line up to which each is marked (`skinsplat-page`).
const MARKED: usize = 400;
/// The views of a chart.
const VIEWS: [&str; 2] = ["over frames", "over bend"];

/// A chart per sequence and metric that the table shows: over frames and, where it is known, over how far the body is bent.
pub(super) fn over_frames(
    results: &TableResults,
    budget: &Budget,
    pictures: &KeptPictures,
    bends: &BTreeMap<String, f64>,
) -> Vec<Part> {
    let links = &budget.links(pictures);
    let has = |key: &str| results.table.columns.iter().any(|column| column.key == key);
    let of = |metric: MetricId| [false, true].map(|fitted| Shown { metric, fitted });
    let asked = |shown: &Shown| match shown.fitted {
        false => has(shown.metric.id()),
        true => has(&format!("{}-fitted", shown.metric.id())),
    };
    let scores: Vec<Shown> = MetricId::of_frames().flat_map(of).filter(asked).collect();
    let mut charts: Vec<Part> = Vec::new();
    for sequence in &results.sequences {
        let of = Charted { results, sequence, budget, links, bends };
        charts.extend(scores.iter().filter_map(|&shown| of.part(shown, scores.iter().any(|s| s.fitted))));
    }
    if charts.len() > OPEN {
        let rest = charts.split_off(scores.len().min(charts.len()));
        charts.push(Part::Folded(format!("{} more charts over frames", rest.len()), rest));
    }
    charts
}

/// A sequence whose scores are drawn.
struct Charted<'a> {
    results: &'a TableResults,
    sequence: &'a SequenceResults,
    budget: &'a Budget,
    links: &'a Links<'a>,
    bends: &'a BTreeMap<String, f64>,
}

impl Charted<'_> {
    /// The views of a score, which says whether its poses are as given where there are `both`; none if no frame has it.
    fn part(&self, shown: Shown, both: bool) -> Option<Part> {
        let known = shown.metric.metric();
        let poses = match (both, shown.fitted) {
            (false, _) => "",
            (true, false) => " (as given)",
            (true, true) => " (fitted)",
        };
        let name = format!("{}{poses}", shown.metric.title());
        let unit = if known.unit.is_empty() { String::new() } else { format!(", {}", known.unit) };
        let (label, y) = (&self.sequence.label, format!("{name}{unit}"));
        let titled = |view: &str| format!("{name} {view}: {label}");
        let frames = Chart::lines(titled(VIEWS[0]), "frame", &y);
        let frames = self.filled(frames, shown, POINTS, |frame| Some(frame.frame as f64))?;
        let angle = "widest angle between joints that move one place, degrees";
        let bend = Chart::scatter(titled(VIEWS[1]), angle, &y);
        let bend = self.filled(bend, shown, POINTS_APART, |frame| self.bends.get(&frame.key).copied());
        Some(match bend {
            Some(bend) => Part::Views(VIEWS.map(str::to_owned).into_iter().zip([frames, bend]).collect()),
            None => Part::Chart(frames),
        })
    }

    /// A chart with a series per variant, of at most so many frames and those that have pictures; none without a point.
    fn filled(
        &self,
        mut chart: Chart,
        shown: Shown,
        most: usize,
        x: impl Fn(&FrameResult) -> Option<f64>,
    ) -> Option<Chart> {
        let variants = &self.sequence.variants;
        let longest = variants.iter().map(|variant| variant.frames.len()).max()?;
        let most = self.budget.points(most);
        // Two of each: a line through every n-th would have no peak.
        let every = if longest <= most { 1 } else { longest.div_ceil(most / 2) };
        let mut any = false;
        let mut hollow = false;
        for variant in variants {
            let known: Vec<(&FrameResult, f64, f64)> = (variant.frames.iter())
                .filter_map(|frame| Some((frame, x(frame)?, frame.value(shown)?)))
                .collect();
            let drawn: Vec<_> = if every == 1 { known } else { self.extremes(&known, every) };
            any |= !drawn.is_empty();
            let marked = drawn.len() <= MARKED;
            hollow |= marked && drawn.iter().any(|(frame, ..)| self.shown(frame) == Some(false));
            let points = drawn.into_iter().map(|(frame, x, y)| self.point(variant, frame, shown, [x, y]));
            chart = chart.with(Series::new(&variant.label, points.collect()));
        }
        let mut notes: Vec<String> = Vec::new();
        if every > 1 {
            notes.push(format!("Of every {every} frames the lowest and the highest are drawn."));
        }
        if hollow {
            notes.push("Pictures of hollow points were left out to keep the page small.".to_owned());
        }
        any.then(|| chart.note(notes.join(" ")))
    }

    /// Of every so many frames the lowest, the highest and those whose pictures are on the page.
    fn extremes<'f>(
        &self,
        known: &[(&'f FrameResult, f64, f64)],
        every: usize,
    ) -> Vec<(&'f FrameResult, f64, f64)> {
        let of_bin = |bin: &[(&'f FrameResult, f64, f64)]| {
            let by_value = |a: &usize, b: &usize| bin[*a].2.total_cmp(&bin[*b].2);
            let ends = [(0..bin.len()).min_by(by_value), (0..bin.len()).max_by(by_value)];
            let kept = |i: &usize| ends.contains(&Some(*i)) || self.shown(bin[*i].0) == Some(true);
            (0..bin.len()).filter(kept).map(|i| bin[i]).collect::<Vec<_>>()
        };
        known.chunks(every).flat_map(of_bin).collect()
    }

    /// Whether the page has pictures of a frame; none if the run kept none.
    fn shown(&self, frame: &FrameResult) -> Option<bool> {
        self.links.shown(&self.results.experiment, &self.sequence.id, &frame.name)
    }

    /// The score of a frame, which leads to its pictures where the page has them.
    fn point(
        &self,
        variant: &VariantResults,
        frame: &FrameResult,
        shown: Shown,
        [x, value]: [f64; 2],
    ) -> Point {
        let digits = shown.metric.decimals() + 1;
        let point =
            Point::new(x, value).titled(format!("{}, {}: {value:.digits$}", variant.label, frame.name));
        match self.shown(frame) {
            Some(true) => point.to(&self.sequence.label, &frame.name),
            Some(false) => point.without_picture("its picture was left out to keep the page small"),
            None => point,
        }
    }
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
