//! Named curves over a common x.

use super::PlotError;
use super::canvas::{COLOURS, FAMILY, Figure, PALE, builder, mesh, range};
use super::log_axis::{LogAxis, tick};
use plotters::backend::DrawingBackend;
use plotters::chart::{ChartContext, SeriesLabelPosition};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, PathElement};
use plotters::series::LineSeries;
use plotters::style::{Color, RGBColor, ShapeStyle};

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the legend calls it.
    pub name: String,
    /// (x, y) in drawing order.
    pub points: Vec<[f64; 2]>,
}

/// Curves with a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Above the plot.
    pub title: String,
    /// Below the x axis.
    pub x_label: String,
    /// Beside the y axis.
    pub y_label: String,
    /// Logarithmic y axis; every y is then above 0.
    pub log_y: bool,
    /// The curves, in the order of the legend.
    pub series: Vec<Series>,
}

impl Figure for Lines {
    fn check(&self) -> Result<(), PlotError> {
        for series in &self.series {
            for &[x, y] in &series.points {
                let value = |axis, value: f64, logarithmic| PlotError::Value {
                    label: series.name.clone(),
                    axis,
                    value: value.to_string(),
                    logarithmic,
                };
                if !x.is_finite() {
                    return Err(value('x', x, false));
                }
                if !y.is_finite() || (self.log_y && y <= 0.0) {
                    return Err(value('y', y, self.log_y));
                }
            }
        }
        if self.series.iter().all(|s| s.points.is_empty()) { Err(PlotError::Empty) } else { Ok(()) }
    }

    fn draw<B: DrawingBackend>(&self, paper: &DrawingArea<B, Shift>) -> Result<(), PlotError> {
        paper.fill(&RGBColor(255, 255, 255)).map_err(PlotError::backend)?;
        let coordinate = |k: usize| self.series.iter().flat_map(|s| &s.points).map(move |p| p[k]);
        let (xs, ys) = (range(coordinate(0), false), range(coordinate(1), self.log_y));
        let mut builder = builder(paper, &self.title);
        if self.log_y {
            let chart = builder.build_cartesian_2d(xs, LogAxis(ys)).map_err(PlotError::backend)?;
            self.fill(chart, &tick)
        } else {
            let chart = builder.build_cartesian_2d(xs, ys).map_err(PlotError::backend)?;
            self.fill(chart, &plain)
        }
    }
}

/// A tick of a linear axis.
fn plain(value: f64) -> String {
    let rounded = format!("{value:.4}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

impl Lines {
    fn fill<'a, B, X, Y>(
        &self,
        mut chart: ChartContext<'a, B, Cartesian2d<X, Y>>,
        y_tick: &dyn Fn(f64) -> String,
    ) -> Result<(), PlotError>
    where
        B: DrawingBackend + 'a,
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        mesh(&mut chart, [&self.x_label, &self.y_label], [&plain, y_tick])?;
        for (i, series) in self.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let style = ShapeStyle::from(&colour).stroke_width(2);
            let points = series.points.iter().map(|&[x, y]| (x, y));
            if series.points.len() == 1 {
                chart
                    .draw_series(points.clone().map(|p| Circle::new(p, 3, colour.filled())))
                    .map_err(PlotError::backend)?;
            }
            chart
                .draw_series(LineSeries::new(points, style))
                .map_err(PlotError::backend)?
                .label(&series.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font((FAMILY, 13))
            .background_style(RGBColor(255, 255, 255).mix(0.85))
            .border_style(PALE)
            .draw()
            .map_err(PlotError::backend)
    }
}
