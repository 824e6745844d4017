//! What a strategy gains or loses by how far the body is bent: differences of tables whose columns share out the body by the
//! angle between its joints.

use super::comparison::MetricDifference;
use super::results::{Results, TableResults};
use skinsplat_plot::{Lines, PlotError, Series, svg};
use skinsplat_statistics::Estimate;

/// A difference of two variants over the pixels of a class of angles.
struct Point {
    /// From the first on and below the second, degrees.
    class: [u32; 2],
    estimate: Estimate,
}

fn points(differences: &[MetricDifference]) -> impl Iterator<Item = Point> {
    differences.iter().filter_map(|difference| {
        Some(Point { class: difference.metric.bend_class()?, estimate: difference.estimate? })
    })
}

/// Comparisons over all sequences that have such differences: variant, baseline, points.
fn compared(table: &TableResults) -> impl Iterator<Item = (&str, &str, Vec<Point>)> {
    table.comparisons.iter().filter(|comparison| comparison.sequence.is_none()).filter_map(|comparison| {
        let points: Vec<Point> = points(&comparison.differences).collect();
        (!points.is_empty()).then_some((comparison.variant.as_str(), comparison.baseline.as_str(), points))
    })
}

/// A line per table, variant and class of angles; none if no table has such columns.
pub fn bend_csv(results: &Results) -> Option<String> {
    let mut lines = ::csv::Writer::from_writer(Vec::new());
    let write = |lines: &mut ::csv::Writer<Vec<u8>>, fields: &[String]| {
        lines.write_record(fields).expect("memory takes every write");
    };
    let headings = "experiment variant baseline from_degrees below_degrees psnr_difference low high frames";
    write(&mut lines, &headings.split(' ').map(str::to_owned).collect::<Vec<_>>());
    let mut any = false;
    for table in &results.tables {
        for (variant, baseline, points) in compared(table) {
            any = true;
            for Point { class, estimate } in points {
                let end = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.4}"));
                write(
                    &mut lines,
                    &[
                        table.experiment.clone(),
                        skinsplat_table::csv_text(variant),
                        skinsplat_table::csv_text(baseline),
                        class[0].to_string(),
                        class[1].to_string(),
                        format!("{:.4}", estimate.mean),
                        end(estimate.interval.map(|interval| interval.low)),
                        end(estimate.interval.map(|interval| interval.high)),
                        estimate.frames.to_string(),
                    ],
                );
            }
        }
    }
    let bytes = lines.into_inner().expect("memory takes every write");
    any.then(|| String::from_utf8(bytes).expect("every field is text"))
}

/// A plot per table with such columns: name (`bend`, the table's id) and SVG.
///
/// # Errors
/// A number that cannot be drawn.
pub fn bend_plots(results: &Results) -> Result<Vec<(String, String)>, PlotError> {
    let mut plots = Vec::new();
    for table in &results.tables {
        let mut baseline = None;
        let series: Vec<Series> = compared(table)
            .map(|(variant, of, points)| {
                baseline = Some(of.to_owned());
                let middle = |[from, to]: [u32; 2]| 0.5 * f64::from(from + to);
                let points = points.iter().map(|p| [middle(p.class), p.estimate.mean]).collect();
                Series { name: variant.to_owned(), points }
            })
            .collect();
        let Some(baseline) = baseline else { continue };
        let lines = Lines {
            title: format!("{}: PSNR over that of {baseline}, by how far the body is bent", table.experiment),
            x_label: "widest angle between the joints that move the surface, degrees".to_owned(),
            y_label: "dB".to_owned(),
            log_y: false,
            series,
        };
        plots.push((table.experiment.clone(), svg(&lines)?));
    }
    Ok(plots)
}
