//! Findings as one HTML page: tables, pictures, and curves of the error against the extreme.

use super::averages::said_of;
use super::report::Report;
use super::table::{Findings, LIMITS, Row, UNDETERMINED, Verdict};
use skinsplat_page::{Chart, Page, Part, Picture, Point, Section, Series};
use std::collections::BTreeMap;

/// Errors below this, degrees, are drawn here: quaternions hold no more, and a logarithmic axis has no zero.
const FLOOR: f64 = 1e-10;

/// The page. `pictures`: the bytes of the PNG of each of the report's, in their order.
pub fn page(report: &Report, pictures: &[Vec<u8>]) -> Page {
    let [degrades, breaks] = LIMITS.degrees;
    let mut page = Page::new("Numerical stability at the extremes").lead(format!(
        "Degrades: more than {degrades}° off the exact answer; breaks: more than {breaks}°, or no finite answer. Curves: how far off, against \
         how extreme the input is."
    ));
    if report.quick {
        page = page.warning("Quick: fewer inputs.");
    }
    for findings in &report.sections {
        page = page.section(section(findings));
    }
    let mut shown = Section::new("pictures", "Pictures");
    for (picture, bytes) in report.pictures.iter().zip(pictures) {
        let size = [picture.image.width(), picture.image.height()];
        shown.push(Part::Figure(Picture::new("image/png", bytes, size), picture.caption.clone()));
    }
    if report.pictures.is_empty() { page } else { page.section(shown) }
}

fn section(findings: &Findings) -> Section {
    let mut section = Section::new(findings.section, findings.title);
    curves(findings).into_iter().for_each(|chart| section.push(Part::Chart(chart)));
    findings.tables.iter().for_each(|table| section.push(Part::Table(table.clone())));
    findings.causes.iter().for_each(|cause| section.push(Part::Text(cause.clone())));
    section
}

/// What was measured, by subject: where on the axis, and the row.
type Subjects<'a> = BTreeMap<&'a str, Vec<(f64, &'a Row)>>;

/// A chart per family of inputs along an axis, in f64: a line per subject that does not hold everywhere on it.
fn curves(findings: &Findings) -> Vec<Chart> {
    let mut families: BTreeMap<&str, Subjects<'_>> = BTreeMap::new();
    let mut axes: BTreeMap<&str, &str> = BTreeMap::new();
    // Where the input has no one answer, no distance from it says anything.
    let measured = |row: &&Row| row.precision == "f64" && !row.note.starts_with(UNDETERMINED);
    for row in findings.rows.iter().filter(measured) {
        let Some((x, axis)) = said_of(row) else { continue };
        axes.insert(&row.family, axis);
        families.entry(&row.family).or_default().entry(&row.subject).or_default().push((x, row));
    }
    let order = |family: &&str| findings.rows.iter().position(|row| row.family == *family);
    let mut families: Vec<_> = families.into_iter().collect();
    families.sort_by_key(|(family, _)| order(family));
    families.into_iter().filter_map(|(family, subjects)| chart(family, axes[family], subjects)).collect()
}

fn chart(family: &str, axis: &str, subjects: Subjects<'_>) -> Option<Chart> {
    // Not what rounding of the input alone may turn: that is no method's, and the verdict allows for it.
    let judged_off =
        |row: &Row| row.verdict != Verdict::Holds && row.error.value().is_some_and(|e| e > LIMITS.degrees[0]);
    let off = |rows: &[(f64, &Row)]| rows.iter().any(|(_, row)| judged_off(row));
    let (bad, good): (Vec<_>, Vec<_>) = subjects.into_iter().partition(|(_, rows)| off(rows));
    let inputs: Vec<f64> = bad.first()?.1.iter().map(|(x, _)| *x).collect();
    let wide = !axis.ends_with("degrees")
        && inputs.iter().all(|x| *x > 0.0)
        && inputs.iter().copied().fold(f64::INFINITY, f64::min) * 1e3
            < inputs.iter().copied().fold(0.0, f64::max);
    let holding: Vec<&str> = good.iter().map(|(subject, _)| *subject).collect();
    let mut chart =
        Chart::lines(format!("{family}: error against the extreme"), axis, "degrees off").log(wide, true);
    for (subject, mut rows) in bad {
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let point = |(x, row): &(f64, &Row)| {
            let error = row.error.value()?;
            Some(
                Point::new(*x, error.max(FLOOR))
                    .titled(format!("{subject} at {x}: {error:.3e}° off, {}", row.verdict)),
            )
        };
        chart = chart.with(Series::new(subject, rows.iter().filter_map(point).collect()));
    }
    let note = format!(
        "Within {}°, and what rounding of the input alone may turn, everywhere here: {}.",
        LIMITS.degrees[0],
        holding.join(", ")
    );
    Some(if holding.is_empty() { chart } else { chart.note(note) })
}
