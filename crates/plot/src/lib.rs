#![doc = include_str!("../README.md")]
//!
//! Pictures of numbers: data in, SVG text or PNG bytes out. No clock, no files, no fonts of the system: the same data
//! gives the same bytes everywhere.
//!
//! [`Scatter`] shows cost against error on logarithmic axes with the points that nothing beats in both joined by a line;
//! [`Lines`] shows named curves over a common x. Both are drawn by [`svg`] and [`png()`].
#![expect(clippy::disallowed_methods, reason = "pictures: no number of a table")]

mod canvas;
mod labels;
mod lines;
mod log_axis;
mod scatter;

pub use canvas::{PlotError, SIZE, png, svg};
pub use lines::{Lines, Series};
pub use scatter::{Point, Scatter};

#[cfg(test)]
mod tests {
    use super::*;

    fn scatter() -> Scatter {
        let point = |label: &str, x, y, on_front| Point { label: label.to_owned(), x, y, on_front };
        Scatter {
            title: "time against error <in degrees>".to_owned(),
            x_label: "ns per Gaussian".to_owned(),
            y_label: "degrees".to_owned(),
            points: vec![
                point("power-1", 10.0, 3.0, true),
                point("power-15 & more", 80.0, 0.02, true),
                point("eigen", 900.0, 0.0, true),
                point("nlerp", 30.0, 4.0, false),
            ],
        }
    }

    fn lines() -> Lines {
        let series = |name: &str, slope: f64| Series {
            name: name.to_owned(),
            points: (0..20).map(|i| [f64::from(i), slope * f64::from(i) + 1.0]).collect(),
        };
        Lines {
            title: "training".to_owned(),
            x_label: "iteration".to_owned(),
            y_label: "dB".to_owned(),
            log_y: false,
            series: vec![series("a", 1.0), series("b", -0.5)],
        }
    }

    /// Every element that opens closes, in order: enough of XML for what a plot can hold.
    fn is_well_formed(svg: &str) -> bool {
        let mut open: Vec<&str> = Vec::new();
        for part in svg.split('<').skip(1) {
            let Some((tag, text)) = part.split_once('>') else { return false };
            if text.replace("&lt;", "").replace("&gt;", "").replace("&amp;", "").contains('&') {
                return false;
            }
            let name = tag.trim_start_matches('/').split([' ', '\n', '/']).next().unwrap_or_default();
            match (tag.starts_with('/'), tag.ends_with('/')) {
                (true, _) if open.pop() != Some(name) => return false,
                (false, false) if !tag.starts_with(['?', '!']) => open.push(name),
                _ => {}
            }
        }
        open.is_empty()
    }

    #[test]
    fn svgs_are_well_formed_and_say_what_they_show() {
        let (points, curves) = (svg(&scatter()).unwrap(), svg(&lines()).unwrap());
        assert!(is_well_formed(&points), "{points}");
        assert!(is_well_formed(&curves), "{curves}");
        for text in ["power-15", "eigen", "ns per Gaussian", "degrees"] {
            assert!(points.contains(text), "{text}");
        }
        assert!(curves.contains("iteration") && curves.contains("training"));
        assert!(!is_well_formed("<a><b></a></b>") && !is_well_formed("<a>x & y</a>"), "the check can fail");
    }

    #[test]
    fn pngs_decode_and_are_not_blank() {
        for bytes in [png(&scatter()).unwrap(), png(&lines()).unwrap()] {
            let image = image::load_from_memory(&bytes).unwrap().to_rgb8();
            assert_eq!([image.width(), image.height()], SIZE);
            let dark = image.pixels().filter(|p| p.0.iter().all(|&c| c < 96)).count();
            assert!(dark > 500, "text and axes are drawn: {dark} dark pixels");
        }
    }

    #[test]
    fn the_same_data_gives_the_same_bytes() {
        assert_eq!(svg(&scatter()).unwrap(), svg(&scatter()).unwrap());
        assert_eq!(png(&lines()).unwrap(), png(&lines()).unwrap());
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        let empty = Scatter { points: Vec::new(), ..scatter() };
        assert_eq!(svg(&empty), Err(PlotError::Empty));
        let mut broken = scatter();
        broken.points[1].x = f64::NAN;
        assert!(matches!(svg(&broken), Err(PlotError::Value { .. })));
        let mut broken = scatter();
        broken.points[1].x = 0.0;
        assert!(matches!(svg(&broken), Err(PlotError::Value { .. })), "logarithm of zero time");
        let mut flat = lines();
        flat.series.truncate(1);
        flat.series[0].points = vec![[1.0, 2.0]];
        assert!(svg(&flat).is_ok(), "one point has no extent, and is drawn all the same");
    }
}
