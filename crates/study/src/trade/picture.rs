//! The plot of a sweep.

use super::section::{EQUAL_BELOW, EQUAL_BEYOND};
use super::{Sweep, pareto_front};
use skinsplat_core::math::portable;
use skinsplat_plot::{Point, Scatter};

/// Cost against error of the rows of one motion; none if nothing was measured. Angles are those that 95 % of the Gaussians
/// keep within; images are drawn by their root mean square error, 1 being white against black. The front is that of what
/// is drawn.
pub fn scatter(sweep: &Sweep, motion: &str) -> Option<Scatter> {
    let rows = sweep.rows.iter().filter(|row| row.motion == motion);
    let measured: Vec<_> =
        rows.filter_map(|row| Some((row, sweep.cost(row)?, row.outcome.as_ref().ok()?))).collect();
    let by_angle = measured.iter().any(|(.., outcome)| outcome.degrees.is_some());
    let mut points: Vec<Point> = measured
        .into_iter()
        .filter_map(|(row, x, outcome)| {
            let y = if by_angle {
                outcome.degrees?.p95
            } else {
                portable::pow(10.0, -outcome.fidelity?.decibels().min(EQUAL_BEYOND) / 20.0)
            };
            Some(Point { label: row.name(), x, y, on_front: false })
        })
        .collect();
    let least = if by_angle { EQUAL_BELOW } else { 0.0 };
    let front = pareto_front(&points.iter().map(|p| [p.x, p.y.max(least)]).collect::<Vec<_>>());
    points.iter_mut().zip(front).for_each(|(point, on_front)| point.on_front = on_front);
    (!points.is_empty()).then(|| Scatter {
        title: format!("{}, {motion} motion", sweep.title),
        x_label: if sweep.by_bytes { "bytes per Gaussian" } else { sweep.unit.title() }.to_owned(),
        y_label: if by_angle {
            "95 % of errors are below, degrees"
        } else {
            "root mean square error of images"
        }
        .to_owned(),
        points,
    })
}
