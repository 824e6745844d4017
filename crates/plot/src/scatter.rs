//! Cost against error on logarithmic axes.

use super::PlotError;
use super::canvas::{COLOURS, FAMILY, Figure, INK, SIZE, builder, mesh, range};
use super::labels::{FONT_SIZE, Taken};
use super::log_axis::{LogAxis, tick};
use plotters::backend::DrawingBackend;
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, PathElement, Text};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle};

/// A choice and what it costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Its name.
    pub label: String,
    /// Cost, above 0.
    pub x: f64,
    /// Error; 0 is drawn at the lower edge.
    pub y: f64,
    /// True if nothing is better in both: drawn in colour and joined with its like.
    pub on_front: bool,
}

/// Points on logarithmic axes. As many labels as fit are drawn, those of the front first.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// Above the plot.
    pub title: String,
    /// Below the x axis.
    pub x_label: String,
    /// Beside the y axis.
    pub y_label: String,
    /// The points.
    pub points: Vec<Point>,
}

impl Scatter {
    /// Where an error of 0 is drawn: a tenth of the least error above it.
    fn zero(&self) -> f64 {
        let least = self.points.iter().map(|p| p.y).filter(|&y| y > 0.0).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least / 10.0 } else { 1.0 }
    }
}

impl Figure for Scatter {
    fn check(&self) -> Result<(), PlotError> {
        let value = |point: &Point, axis, value: f64| PlotError::Value {
            label: point.label.clone(),
            axis,
            value: value.to_string(),
            logarithmic: true,
        };
        for point in &self.points {
            if !(point.x.is_finite() && point.x > 0.0) {
                return Err(value(point, 'x', point.x));
            }
            if !(point.y.is_finite() && point.y >= 0.0) {
                return Err(value(point, 'y', point.y));
            }
        }
        if self.points.is_empty() { Err(PlotError::Empty) } else { Ok(()) }
    }

    fn draw<B: DrawingBackend>(&self, paper: &DrawingArea<B, Shift>) -> Result<(), PlotError> {
        let error = PlotError::backend;
        paper.fill(&RGBColor(255, 255, 255)).map_err(error)?;
        let zero = self.zero();
        let at = |p: &Point| (p.x, p.y.max(zero));
        let xs = range(self.points.iter().map(|p| p.x), true);
        let ys = range(self.points.iter().map(|p| at(p).1), true);
        let mut chart = builder(paper, &self.title)
            .build_cartesian_2d(LogAxis(xs), LogAxis(ys))
            .map_err(PlotError::backend)?;
        mesh(&mut chart, [&self.x_label, &self.y_label], [&tick, &tick])?;
        let mut front: Vec<(f64, f64)> = self.points.iter().filter(|p| p.on_front).map(at).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
        let line = ShapeStyle::from(&COLOURS[1]).stroke_width(2);
        chart.draw_series([PathElement::new(front, line)]).map_err(PlotError::backend)?;
        let dots = self.points.iter().map(|p| {
            let colour = if p.on_front { COLOURS[1] } else { COLOURS[0] };
            Circle::new(at(p), if p.on_front { 4 } else { 3 }, colour.filled())
        });
        chart.draw_series(dots).map_err(PlotError::backend)?;
        let pixel = |p: &Point| chart.backend_coord(&at(p));
        let frame = [92, 44, SIZE[0] as i32 - 16, SIZE[1] as i32 - 66];
        let mut taken = Taken::new(frame, self.points.iter().map(pixel));
        let (first, then): (Vec<&Point>, Vec<&Point>) = self.points.iter().partition(|p| p.on_front);
        for point in first.into_iter().chain(then) {
            if let Some(corner) = taken.place(pixel(point), &point.label) {
                let text =
                    Text::new(point.label.as_str(), corner, (FAMILY, FONT_SIZE).into_font().color(&INK));
                paper.draw(&text).map_err(PlotError::backend)?;
            }
        }
        Ok(())
    }
}
