//! Charts as inline SVG: every point says what it is when pointed at, and may lead to its picture.

use super::ticks::Axis;
use maud::{Markup, html};

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    title: String,
    x: String,
    y: String,
    kind: Kind,
    log: [bool; 2],
    series: Vec<Series>,
    note: String,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Joined in their order.
    Lines,
    /// By themselves, with their names beside them.
    Scatter,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    name: String,
    points: Vec<Point>,
}

/// A point.
#[derive(Clone, Debug)]
pub struct Point {
    x: f64,
    y: f64,
    title: Option<String>,
    label: Option<String>,
    picture: Option<[String; 2]>,
    /// Why it leads nowhere, where others lead to pictures.
    without: Option<String>,
}

const SIZE: [f64; 2] = [640.0, 260.0];
/// Right, above, below; and the least on the left.
const MARGIN: [f64; 3] = [28.0, 12.0, 48.0];
const LEFT: f64 = 76.0;
/// Width of a digit where the letters are largest (style.css, on narrow screens), and what the title of the axis takes beside them.
const DIGIT: f64 = 11.0;
const TITLE: f64 = 24.0;
/// Points of a series up to which each is drawn large in a plane.
const FEW: usize = 60;
/// Radius of a point in a plane.
const RADIUS: f64 = 4.5;
/// Width of a letter and height of a line of names, where letters are small and where they are large (style.css).
const LETTERS: [[f64; 2]; 2] = [[6.0, 12.0], [10.5, 20.0]];
/// From a label to its axis.
const GAP: f64 = 6.0;
/// Colours of the style sheet; from there on with another dash.
const COLOURS: usize = 7;

impl Point {
    /// A point; one that is not finite is left out.
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y, title: None, label: None, picture: None, without: None }
    }

    /// With what it says when pointed at.
    pub fn titled(self, title: impl Into<String>) -> Self {
        Self { title: Some(title.into()), ..self }
    }

    /// With a name beside it.
    pub fn labelled(self, label: impl Into<String>) -> Self {
        Self { label: Some(label.into()), ..self }
    }

    /// Leading to the pictures of a frame of a sequence.
    pub fn to(self, sequence: impl Into<String>, frame: impl Into<String>) -> Self {
        Self { picture: Some([sequence.into(), frame.into()]), ..self }
    }

    /// Without the picture that one could expect: it is drawn hollow and says why.
    pub fn without_picture(self, why: impl Into<String>) -> Self {
        Self { without: Some(why.into()), ..self }
    }
}

impl Series {
    /// Points under a name.
    pub fn new(name: impl Into<String>, points: Vec<Point>) -> Self {
        Self { name: name.into(), points }
    }
}

impl Chart {
    /// Lines over x.
    pub fn lines(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        let (log, series) = ([false; 2], Vec::new());
        let (title, x, y, note) = (title.into(), x.into(), y.into(), String::new());
        Self { title, x, y, kind: Kind::Lines, log, series, note }
    }

    /// Points in a plane.
    pub fn scatter(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self { kind: Kind::Scatter, ..Self::lines(title, x, y) }
    }

    /// With logarithmic axes, x and y.
    pub fn log(self, x: bool, y: bool) -> Self {
        Self { log: [x, y], ..self }
    }

    /// With one more series.
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// With a sentence below.
    pub fn note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// How many points cannot be drawn: infinite ones, and those not above 0 on a logarithmic axis.
    fn left_out(&self) -> usize {
        let fits = |value: f64, log: bool| value.is_finite() && (!log || value > 0.0);
        let points = self.series.iter().flat_map(|s| &s.points);
        points.filter(|p| !(fits(p.x, self.log[0]) && fits(p.y, self.log[1]))).count()
    }

    /// What it shows.
    pub(super) fn title(&self) -> &str {
        &self.title
    }

    pub(super) fn markup(&self, at: &str) -> Markup {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let x = Axis::of(points().map(|p| p.x), self.log[0]);
        let y = Axis::of(points().map(|p| p.y), self.log[1]);
        let frame = Frame::new(x, y);
        let left_out = self.left_out();
        let names = self.names(&frame);
        html! {
            figure.chart {
                figcaption id={ (at) "-c" } { (self.title) }
                svg viewBox=(format!("0 0 {} {}", SIZE[0], SIZE[1])) role="img" aria-labelledby={ (at) "-c" } {
                    (frame.grid(&self.x, &self.y))
                    @for (i, series) in self.series.iter().enumerate() { (series.markup(i, self.kind, &frame)) }
                    @if let Some(names) = names { (names) }
                }
                @if self.series.len() > 1 { (self.legend()) }
                @if left_out > 0 {
                    p.remark { (left_out) " of the points cannot be drawn on these axes (infinite, or 0 on a logarithmic one)." }
                }
                @if !self.note.is_empty() { p.remark { (self.note) } }
            }
        }
    }

    /// The names beside points, as far as there is room: where names would lie on each other, or on points, the later one is left to
    /// whoever points there. Where letters are large (on narrow screens) fewer have room.
    fn names(&self, frame: &Frame) -> Option<Markup> {
        let placed: Vec<(&Point, [f64; 2])> =
            self.series.iter().flat_map(|series| series.placed(frame)).collect();
        let dots: Vec<Rect> = placed.iter().map(|(_, at)| Rect::around(*at, RADIUS)).collect();
        let named: Vec<(&str, [f64; 2])> =
            placed.iter().filter_map(|(point, at)| Some((point.label.as_deref()?, *at))).collect();
        let [small, large] = LETTERS.map(|letter| arrange(&named, &dots, letter));
        (!named.is_empty()).then(|| {
            html! {
                @for (class, names) in [("wide", small), ("narrow", large)] {
                    g class=(class) {
                        @for ((name, _), at) in named.iter().zip(names) {
                            @if let Some([x, y]) = at { text x=(n(x)) y=(n(y)) { (name) } }
                        }
                    }
                }
            }
        })
    }

    fn legend(&self) -> Markup {
        html! {
            ul.keys {
                @for (i, series) in self.series.iter().enumerate() {
                    li {
                        svg.key viewBox="0 0 24 10" aria-hidden="true" { line class=(class(i)) x1="0" y1="5" x2="24" y2="5" {} }
                        " " (series.name)
                    }
                }
            }
        }
    }
}

/// Colour and dash of a series.
fn class(series: usize) -> String {
    let dash = if series >= COLOURS { " dash" } else { "" };
    format!("c{}{dash}", series % COLOURS)
}

/// The area between the axes.
struct Frame {
    x: Axis,
    y: Axis,
    /// Where it begins: right of the longest label and of the axis's title.
    left: f64,
}

impl Frame {
    fn new(x: Axis, y: Axis) -> Self {
        let longest = y.ticks.iter().map(|(_, label)| label.chars().count()).max().unwrap_or(0);
        let left = LEFT.max(TITLE + DIGIT * longest as f64 + GAP);
        Self { x, y, left }
    }

    fn place_x(&self, value: f64) -> Option<f64> {
        let [right, ..] = MARGIN;
        Some(self.left + self.x.at(value)? * (SIZE[0] - self.left - right))
    }

    fn place_y(&self, value: f64) -> Option<f64> {
        let [_, top, bottom] = MARGIN;
        Some(SIZE[1] - bottom - self.y.at(value)? * (SIZE[1] - top - bottom))
    }

    fn place(&self, point: &Point) -> Option<[f64; 2]> {
        Some([self.place_x(point.x)?, self.place_y(point.y)?])
    }

    fn grid(&self, x: &str, y: &str) -> Markup {
        let ([right, top, bottom], left) = (MARGIN, self.left);
        let [width, height] = SIZE;
        let xs = self.x.ticks.iter().filter_map(|(at, label)| Some((self.place_x(*at)?, label)));
        let ys = self.y.ticks.iter().filter_map(|(at, label)| Some((self.place_y(*at)?, label)));
        html! {
            g.grid {
                @for (at, label) in ys {
                    line x1=(n(left)) x2=(width - right) y1=(n(at)) y2=(n(at)) {}
                    text x=(n(left - GAP)) y=(n(at + 4.0)) text-anchor="end" { (label) }
                }
                @for (at, label) in xs {
                    line x1=(n(at)) x2=(n(at)) y1=(top) y2=(height - bottom) {}
                    text x=(n(at)) y=(height - bottom + 16.0) text-anchor="middle" { (label) }
                }
                text.axis x=(n((left + width - right) / 2.0)) y=(height - 6.0) text-anchor="middle" { (x) }
                text.axis transform=(format!("translate(16 {}) rotate(-90)", n((top + height - bottom) / 2.0))) text-anchor="middle" { (y) }
            }
        }
    }
}

/// Sides of a rectangle: left, top, right, bottom.
#[derive(Clone, Copy, Debug)]
struct Rect([f64; 4]);

impl Rect {
    fn around([x, y]: [f64; 2], radius: f64) -> Self {
        Self([x - radius, y - radius, x + radius, y + radius])
    }

    fn meets(&self, other: &Self) -> bool {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        a < g && e < c && b < h && f < d
    }

    fn inside(&self) -> bool {
        let [left, top, right, bottom] = self.0;
        left >= 0.0 && top >= 0.0 && right <= SIZE[0] && bottom <= SIZE[1]
    }
}

/// Where names begin, at the left of their base line: right of, left of, above or below their points, the first that has room.
fn arrange(named: &[(&str, [f64; 2])], dots: &[Rect], [width, height]: [f64; 2]) -> Vec<Option<[f64; 2]>> {
    let mut taken = dots.to_vec();
    let place = |&(name, [x, y]): &(&str, [f64; 2])| {
        let length = width * name.chars().count() as f64;
        let (beside, middle) = (RADIUS + 2.0, y + 0.35 * height);
        let starts = [
            [x + beside, middle],
            [x - beside - length, middle],
            [x - length / 2.0, y - beside - 0.2 * height],
            [x - length / 2.0, y + beside + height],
        ];
        let found = starts.into_iter().find_map(|[x, y]| {
            let box_of_text = Rect([x, y - 0.8 * height, x + length, y + 0.2 * height]);
            let free = box_of_text.inside() && !taken.iter().any(|other| other.meets(&box_of_text));
            free.then_some(([x, y], box_of_text))
        });
        found.map(|(at, text)| {
            taken.push(text);
            at
        })
    };
    named.iter().map(place).collect()
}

impl Series {
    /// Its points that the axes hold, and where.
    fn placed<'s>(&'s self, frame: &'s Frame) -> impl Iterator<Item = (&'s Point, [f64; 2])> {
        self.points.iter().filter_map(|point| Some((point, frame.place(point)?)))
    }

    fn markup(&self, index: usize, kind: Kind, frame: &Frame) -> Markup {
        let placed: Vec<(&Point, [f64; 2])> = self.placed(frame).collect();
        let path: Vec<String> = placed.iter().map(|(_, [x, y])| format!("{},{}", n(*x), n(*y))).collect();
        // A mark per point is too much where there are thousands: the line has them all, and marks those that lead somewhere.
        let marks = placed.len() <= 400 || kind == Kind::Scatter;
        html! {
            g class=(class(index)) {
                @if kind == Kind::Lines && placed.len() > 1 { polyline points=(path.join(" ")) {} }
                @for (point, at) in &placed {
                    @if marks || point.picture.is_some() { (self.mark(point, *at, kind)) }
                }
            }
        }
    }

    fn mark(&self, point: &Point, [x, y]: [f64; 2], kind: Kind) -> Markup {
        let few = self.points.len() <= FEW;
        let radius = if kind == Kind::Scatter && few { RADIUS } else { 3.0 };
        let title = point.title.clone().unwrap_or_else(|| format!("{}: {}, {}", self.name, point.x, point.y));
        let title = point.without.iter().fold(title, |title, why| format!("{title}; {why}"));
        let hollow = point.without.is_some().then_some("hollow");
        let dot = html! { circle class=[hollow] cx=(n(x)) cy=(n(y)) r=(radius) { title { (title) } } };
        match &point.picture {
            Some([sequence, name]) => html! {
                a href="#pictures" data-sequence=(sequence) data-frame=(name) data-label=(self.name) aria-label=(title) { (dot) }
            },
            None => dot,
        }
    }
}

/// A coordinate in a tenth of a pixel.
fn n(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_placed_titled_and_linked() {
        let points = vec![
            Point::new(0.0, 10.0).titled("frame 0: 10 dB").to("lab", "image_0000"),
            Point::new(1.0, f64::INFINITY),
            Point::new(2.0, 20.0),
        ];
        let html = Chart::lines("T", "x", "y").with(Series::new("a", points)).markup("s").into_string();
        assert!(html.contains("<title>frame 0: 10 dB</title>"), "{html}");
        assert!(html.contains(r#"data-sequence="lab" data-frame="image_0000" data-label="a""#), "{html}");
        assert_eq!(html.matches("<circle").count(), 2, "{html}");
        assert!(html.contains("1 of the points cannot be drawn"), "{html}");
        assert!(!html.contains("NaN") && !html.contains("inf\""), "{html}");
    }

    #[test]
    fn a_point_without_its_picture_says_so() {
        let point = Point::new(1.0, 2.0).titled("frame 7").without_picture("its picture was left out");
        let html =
            Chart::scatter("T", "x", "y").with(Series::new("a", vec![point])).markup("s").into_string();
        assert!(html.contains("<title>frame 7; its picture was left out</title>"), "{html}");
        assert!(html.contains("class=\"hollow\"") && !html.contains("<a "), "{html}");
    }

    #[test]
    fn names_do_not_lie_on_each_other() {
        let named = [("power-15", [300.0, 100.0]), ("power-30", [302.0, 101.0]), ("newton", [301.0, 99.0])];
        let dots: Vec<Rect> = named.iter().map(|(_, at)| Rect::around(*at, RADIUS)).collect();
        let [small, large] = LETTERS.map(|letter| arrange(&named, &dots, letter));
        assert_eq!(small.iter().flatten().count(), 3, "{small:?}");
        assert!(small[0].unwrap()[0] > 302.0 && small[1].unwrap()[0] < 300.0, "{small:?}");
        assert!(large[0].unwrap()[0] > 302.0, "{large:?}");
        let crowd: Vec<(&str, [f64; 2])> = (0..50).map(|_| ("the same place", [300.0, 100.0])).collect();
        let dots = [Rect::around([300.0, 100.0], RADIUS)];
        assert_eq!(arrange(&crowd, &dots, LETTERS[0]).iter().flatten().count(), 4);
    }

    /// Letters are largest where the page is narrow: 19 units high, 11 a digit.
    #[test]
    fn labels_stay_beside_the_title_of_their_axis() {
        for values in [[0.998_51, 0.998_59], [12.0, 1e7], [1.0, 2.0]] {
            let frame =
                Frame::new(Axis::of([0.0, 9.0].into_iter(), false), Axis::of(values.into_iter(), false));
            let longest = frame.y.ticks.iter().map(|(_, label)| label.len()).max().unwrap();
            // The title stands at 16 and reaches a few units to its right.
            assert!(frame.left - 6.0 - 11.0 * longest as f64 >= 22.0, "{values:?}: {}", frame.left);
            assert!(frame.left < SIZE[0] / 3.0);
        }
    }

    #[test]
    fn ten_thousand_points_stay_small() {
        let point = |i: i32| match Point::new(f64::from(i), f64::from(i % 7)) {
            point if i % 1000 == 0 => point.to("lab", i.to_string()),
            point => point,
        };
        let points = (0..10_000).map(point).collect();
        let html = Chart::lines("T", "x", "y").with(Series::new("a", points)).markup("s").into_string();
        assert!(html.len() < 250_000, "{}", html.len());
        assert_eq!(html.matches("<a ").count(), 10, "those with pictures lead there");
    }
}
