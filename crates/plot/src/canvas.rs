//! What all plots share: the two kinds of paper, the font, colours.

use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::style::{FontStyle, IntoFont, RGBColor, register_font};
use std::sync::OnceLock;

/// Width and height of every plot, pixels.
pub const SIZE: [u32; 2] = [960, 640];

/// Characters that the embedded font has are Latin letters, digits, `° ± ² ³ µ × Δ Σ α λ σ − ≤ ≥ ∞`.
const FONT: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");
/// The name under which SVG viewers look for a font of their own.
pub(super) const FAMILY: &str = "sans-serif";

pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
pub(super) const PALE: RGBColor = RGBColor(225, 225, 225);
/// Okabe and Ito's colours: told apart also by the colour-blind.
pub(super) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// Why there is no plot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlotError {
    /// No point at all.
    #[error("nothing to draw; expected at least one point")]
    Empty,
    /// A coordinate that has no place on its axis.
    #[error("point {label}: {value} on the {axis} axis; expected a finite number{}", if *.logarithmic { " above 0" } else { "" })]
    Value {
        /// Which point.
        label: String,
        /// `x` or `y`.
        axis: char,
        /// The coordinate.
        value: String,
        /// True for a logarithmic axis.
        logarithmic: bool,
    },
    /// The drawing library gave up.
    #[error("cannot draw: {0}")]
    Backend(String),
}

impl PlotError {
    pub(super) fn backend(error: impl std::fmt::Display) -> Self {
        Self::Backend(error.to_string())
    }
}

/// A plot: checks its data, then draws itself on any paper.
pub trait Figure {
    /// That every coordinate has a place.
    ///
    /// # Errors
    /// [`PlotError::Empty`] and [`PlotError::Value`].
    fn check(&self) -> Result<(), PlotError>;

    /// Draws on white paper of [`SIZE`].
    ///
    /// # Errors
    /// [`PlotError::Backend`].
    fn draw<B: DrawingBackend>(&self, paper: &DrawingArea<B, Shift>) -> Result<(), PlotError>;
}

/// A plot as an SVG document.
///
/// # Errors
/// Data that cannot be drawn.
pub fn svg(figure: &impl Figure) -> Result<String, PlotError> {
    figure.check()?;
    load_font()?;
    let mut text = String::new();
    {
        let paper = SVGBackend::with_string(&mut text, (SIZE[0], SIZE[1])).into_drawing_area();
        figure.draw(&paper)?;
        paper.present().map_err(PlotError::backend)?;
    }
    Ok(text)
}

/// A plot as the bytes of a PNG file.
///
/// # Errors
/// Data that cannot be drawn.
pub fn png(figure: &impl Figure) -> Result<Vec<u8>, PlotError> {
    figure.check()?;
    load_font()?;
    let mut pixels = vec![255; (SIZE[0] * SIZE[1] * 3) as usize];
    {
        let paper = BitMapBackend::with_buffer(&mut pixels, (SIZE[0], SIZE[1])).into_drawing_area();
        figure.draw(&paper)?;
        paper.present().map_err(PlotError::backend)?;
    }
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &pixels, SIZE[0], SIZE[1], image::ExtendedColorType::Rgb8)
        .map_err(PlotError::backend)?;
    Ok(bytes)
}

fn load_font() -> Result<(), PlotError> {
    static LOADED: OnceLock<bool> = OnceLock::new();
    let loaded = LOADED.get_or_init(|| register_font(FAMILY, FontStyle::Normal, FONT).is_ok());
    loaded.then_some(()).ok_or_else(|| PlotError::backend("the embedded font cannot be read"))
}

/// A chart with a title and room for both axes.
pub(super) fn builder<'a, 'b, B: DrawingBackend>(
    paper: &'a DrawingArea<B, Shift>,
    title: &str,
) -> ChartBuilder<'a, 'b, B> {
    let mut builder = ChartBuilder::on(paper);
    builder
        .margin(16)
        .caption(title, (FAMILY, 20).into_font().color(&INK))
        .x_label_area_size(48)
        .y_label_area_size(72);
    builder
}

/// Axes x and y with their labels and ticks, and the lines of the grid.
pub(super) fn mesh<'a, B, X, Y>(
    chart: &mut ChartContext<'a, B, Cartesian2d<X, Y>>,
    labels: [&str; 2],
    ticks: [&dyn Fn(f64) -> String; 2],
) -> Result<(), PlotError>
where
    B: DrawingBackend + 'a,
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    chart
        .configure_mesh()
        .x_desc(labels[0])
        .y_desc(labels[1])
        .axis_desc_style((FAMILY, 15))
        .label_style((FAMILY, 13))
        .x_label_formatter(&|v| ticks[0](*v))
        .y_label_formatter(&|v| ticks[1](*v))
        .bold_line_style(PALE)
        .light_line_style(RGBColor(245, 245, 245))
        .draw()
        .map_err(PlotError::backend)
}

/// A range that holds all values with some room, never empty. On a logarithmic axis the room is a factor.
pub(super) fn range(values: impl Iterator<Item = f64>, logarithmic: bool) -> std::ops::Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if logarithmic {
        let room = (high / low).powf(0.08).max(1.3);
        low / room..high * room
    } else {
        let room = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-9);
        low - room..high + room
    }
}
