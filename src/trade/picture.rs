//! The plot of a sweep.

use super::Sweep;
use crate::report::plot::{Point, Scatter};

/// Cost against error of the rows of one motion, with the front; none if nothing was measured. Angles are the worst ones;
/// images are drawn by their root mean square error, 1 being white against black.
pub fn scatter(sweep: &Sweep, motion: &str) -> Option<Scatter> {
    let mut by_angle = false;
    let mut points = Vec::new();
    for (row, on_front) in sweep.rows.iter().zip(sweep.front()) {
        let (Ok(outcome), Some([x, _])) = (&row.outcome, sweep.cost_and_error(row)) else { continue };
        if row.motion != motion {
            continue;
        }
        let y = match (outcome.degrees, outcome.fidelity) {
            (Some(degrees), _) => {
                by_angle = true;
                degrees.max
            }
            (None, Some(fidelity)) => 10.0_f64.powf(-fidelity.decibels() / 20.0),
            (None, None) => continue,
        };
        points.push(Point { label: row.name(), x, y, on_front });
    }
    (!points.is_empty()).then(|| Scatter {
        title: format!("{}, {motion} motion", sweep.title),
        x_label: if sweep.by_bytes { "bytes per Gaussian" } else { sweep.unit.title() }.to_owned(),
        y_label: if by_angle { "worst error, degrees" } else { "root mean square error of images" }
            .to_owned(),
        points,
    })
}
