//! How fits went, as CSV and as plots.

use crate::experiment::Experiment;
use crate::run::curves::{Curve, CurvePoint};
use skinsplat_plot::{Lines, PlotError, Series, svg};
use skinsplat_table::csv_text;
use std::collections::BTreeMap;

const COLUMNS: [&str; 9] = [
    "experiment",
    "dataset",
    "subject",
    "variant",
    "iteration",
    "loss",
    "training_psnr",
    "test_psnr",
    "splats",
];

/// Checks that a text is one of [`curves_csv`]'s.
///
/// # Errors
/// One line: what is wrong, where, and what was expected.
pub fn check_curves(text: &str) -> Result<(), String> {
    let mut reader = ::csv::Reader::from_reader(text.as_bytes());
    let headings = reader.headers().map_err(|error| error.to_string())?;
    if headings != COLUMNS.as_slice() {
        return Err(format!("not the CSV that was expected: columns {}", COLUMNS.join(", ")));
    }
    for record in reader.records() {
        let record = record.map_err(|error| format!("not the CSV that was expected: {error}"))?;
        let numbers = || COLUMNS.iter().zip(&record).skip(4);
        let wrong = numbers().find(|(name, field)| {
            field.parse::<f64>().is_err() && (**name == "iteration" || !field.is_empty())
        });
        if let Some((name, field)) = wrong {
            let line = record.position().map_or(0, ::csv::Position::line);
            return Err(format!("line {line}: {name}: `{field}`; expected a number"));
        }
    }
    Ok(())
}

/// A line per point, a column per number; a field without a number is empty.
pub fn curves_csv(curves: &[Curve]) -> String {
    let mut lines = ::csv::Writer::from_writer(Vec::new());
    lines.write_record(COLUMNS).expect("memory takes every write");
    let number =
        |value: Option<f64>, digits: usize| value.map_or_else(String::new, |v| format!("{v:.digits$}"));
    for Curve { experiment, dataset, subject, variant, points } in curves {
        for point in points {
            let names = [experiment, dataset, subject, variant].map(|name| csv_text(name));
            let numbers = [
                point.iteration.to_string(),
                number(point.loss, 6),
                number(point.training_psnr, 3),
                number(point.test_psnr, 3),
                point.splats.map_or_else(String::new, |splats| splats.to_string()),
            ];
            lines.write_record(names.iter().chain(&numbers)).expect("memory takes every write");
        }
    }
    let bytes = lines.into_inner().expect("memory takes every write");
    String::from_utf8(bytes).expect("every field is text")
}

/// A plot of training and test PSNR for every table and subject: name (`table1-SUBJECT`) and SVG. Of variants that differ
/// in their seed alone, the first is shown.
///
/// # Errors
/// A number that cannot be drawn.
pub fn curve_plots(curves: &[Curve], experiments: &[Experiment]) -> Result<Vec<(String, String)>, PlotError> {
    let mut plots: BTreeMap<(&str, &str), Vec<Series>> = BTreeMap::new();
    for curve in curves {
        let experiment = experiments.iter().find(|experiment| experiment.id == curve.experiment);
        let variant = experiment.and_then(|experiment| experiment.variant(&curve.variant));
        let replicate = variant.and_then(|variant| variant.replicate.as_ref());
        let first = experiment.and_then(|experiment| experiment.seeds.first().copied());
        if replicate.is_some_and(|replicate| Some(replicate.seed) != first) {
            continue;
        }
        let label = variant.map_or(&curve.variant, |variant| replicate.map_or(&variant.label, |r| &r.label));
        let series = plots.entry((&curve.experiment, &curve.subject)).or_default();
        for kind in ["training", "test"] {
            let value = |point: &CurvePoint| {
                if kind == "training" { point.training_psnr } else { point.test_psnr }
            };
            let at = |point: &CurvePoint| {
                Some([f64::from(point.iteration), value(point).filter(|v| v.is_finite())?])
            };
            let points: Vec<[f64; 2]> = curve.points.iter().filter_map(at).collect();
            if !points.is_empty() {
                series.push(Series { name: format!("{label}, {kind}"), points });
            }
        }
    }
    let plot = |((experiment, subject), series): ((&str, &str), Vec<Series>)| {
        let lines = Lines {
            title: format!("{experiment}, {subject}: PSNR of training frames and of held-out frames"),
            x_label: "iteration".to_owned(),
            y_label: "dB".to_owned(),
            log_y: false,
            series,
        };
        Ok((format!("{experiment}-{subject}"), svg(&lines)?))
    };
    plots.into_iter().filter(|(_, series)| !series.is_empty()).map(plot).collect()
}
