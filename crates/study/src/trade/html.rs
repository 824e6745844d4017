//! A result as one HTML page: tables, and cost against error with a name on every point.

use super::page::picks;
use super::{Sweep, Trade, scatter};
use skinsplat_page::{Chart, Page, Part, Point, Section, Series};

/// The page.
pub fn html(trade: &Trade, sweeps: &[Sweep]) -> String {
    let mut page = Page::new("Speed against accuracy");
    for line in &trade.ran_on {
        page = page.lead(format!("{line}."));
    }
    page = page.lead(
        "Front: no other row of the same motion is at least as good in time, in 95 % and in all of the errors (or in PSNR), and better in \
         one. Errors below 1e-5° and images beyond 120 dB count as equal.",
    );
    for table in &trade.sections {
        let mut section = Section::new(&table.id, &table.title);
        for sweep in sweeps.iter().filter(|sweep| sweep.id == table.id) {
            let charts = ["test", "extreme"].into_iter().filter_map(|motion| chart(sweep, motion));
            charts.for_each(|chart| section.push(Part::Chart(chart)));
        }
        section.push(Part::Table(table.clone()));
        page = page.section(section);
    }
    let mut section = Section::new("recommendations", "Recommendations");
    trade.recommendations.iter().for_each(|of| section.push(Part::Table(picks(of))));
    if !trade.recommendations.is_empty() {
        page = page.section(section);
    }
    page.html()
}

/// Cost against error: the front as one series, what is beaten as another.
fn chart(sweep: &Sweep, motion: &str) -> Option<Chart> {
    let plot = scatter(sweep, motion)?;
    let least = plot.points.iter().map(|p| p.y).filter(|&y| y > 0.0).fold(f64::INFINITY, f64::min);
    let zero = if least.is_finite() { least / 10.0 } else { 1.0 };
    let of = |front: bool| {
        let points = plot.points.iter().filter(|p| p.on_front == front);
        let point = |p: &skinsplat_plot::Point| {
            let title = format!("{}: {:.4} {}, {:.3e}", p.label, p.x, plot.x_label, p.y);
            Point::new(p.x, if p.y > 0.0 { p.y } else { zero }).titled(title).labelled(&p.label)
        };
        points.map(point).collect::<Vec<_>>()
    };
    let chart = Chart::scatter(&plot.title, &plot.x_label, &plot.y_label).log(true, true);
    let chart = chart.with(Series::new("front", of(true))).with(Series::new("beaten", of(false)));
    let exact = plot.points.iter().any(|p| p.y <= 0.0);
    Some(if exact { chart.note("An error of 0 is drawn at a tenth of the least above it.") } else { chart })
}
