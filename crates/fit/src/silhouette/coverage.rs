//! Which samples of a window a projected mesh covers: one bit per sample, 8 x 8 samples per pixel.

use super::{Topology, Window};
use glam::DVec2;

/// Samples along a side of a pixel: the bits of a byte.
pub(super) const SAMPLES: usize = 8;
const PER_PIXEL: f64 = SAMPLES as f64;

/// Covered samples of a window. Row r of samples has its centre at `(r + 1/2) / 8` pixels from the top, sample k of it at
/// `(k + shift(r)) / 8` pixels from the left: a rotated grid, so that upright edges meet 64 levels of coverage.
pub(super) struct Coverage {
    pub(super) window: Window,
    /// A byte per pixel and row of samples.
    bits: Vec<u8>,
}

/// Shift of the samples of a row, in units of their distance. 5 is odd: all eighths occur in the eight rows of a pixel.
fn shift(row: usize) -> f64 {
    ((row * 5 % SAMPLES) as f64 + 0.5) / PER_PIXEL
}

/// The first of `count` whole numbers that is at least `value`; `count` if none is. Written with casts: on the baseline
/// instruction set, `ceil` is a call.
#[inline]
fn first_from(value: f64, count: usize) -> usize {
    let clamped = value.max(0.0).min(count as f64);
    let below = clamped as i64;
    (below + i64::from((below as f64) < clamped)) as usize
}

impl Coverage {
    /// Draws the faces of projected vertices. Faces with a vertex that is not finite are left out. The samples of faces
    /// that share an edge neither overlap nor leave a gap.
    ///
    /// A line of sight through a closed mesh enters it as often as it leaves it: of such a mesh the faces of one
    /// orientation cover all that the others do.
    pub(super) fn of(points: &[DVec2], topology: &Topology, window: Window) -> Self {
        let mut coverage = Self { window, bits: vec![0; window.area() * SAMPLES] };
        let corner = window.corner();
        let samples: Vec<DVec2> = points.iter().map(|&p| (p - corner) * PER_PIXEL).collect();
        let half = topology.is_closed() && samples.iter().all(|p| p.is_finite());
        for face in topology.faces() {
            let corners = face.map(|i| samples[i as usize]);
            let area = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
            // neither holds for a face that is not finite; one without area covers nothing
            if area < 0.0 || (area > 0.0 && !half) {
                coverage.draw(corners);
            }
        }
        coverage
    }

    /// Draws one triangle, in units of samples.
    fn draw(&mut self, mut corners: [DVec2; 3]) {
        if corners[0].y > corners[1].y {
            corners.swap(0, 1);
        }
        if corners[1].y > corners[2].y {
            corners.swap(1, 2);
        }
        if corners[0].y > corners[1].y {
            corners.swap(0, 1);
        }
        let [low, middle, high] = corners;
        let count = self.window.height * SAMPLES;
        let [first, turn, end] = [low, middle, high].map(|p| first_from(p.y - 0.5, count));
        if first == end {
            return;
        }
        let long = Slope::new(low, high);
        for (rows, short) in [(first..turn, [low, middle]), (turn..end, [middle, high])] {
            if !rows.is_empty() {
                let short = Slope::new(short[0], short[1]);
                for row in rows {
                    self.fill(row, long.at(row), short.at(row));
                }
            }
        }
    }

    /// Covers the samples of a row between two positions.
    #[inline]
    fn fill(&mut self, row: usize, x0: f64, x1: f64) {
        let shift = shift(row);
        let samples = self.window.width * SAMPLES;
        let (from, to) = (first_from(x0.min(x1) - shift, samples), first_from(x0.max(x1) - shift, samples));
        if from >= to {
            return;
        }
        let bytes = &mut self.bits[row * self.window.width..(row + 1) * self.window.width];
        let (first, last) = (from / SAMPLES, (to - 1) / SAMPLES);
        let head = u8::MAX << (from % SAMPLES);
        let tail = u8::MAX >> (SAMPLES - 1 - (to - 1) % SAMPLES);
        if first == last {
            bytes[first] |= head & tail;
        } else {
            bytes[first] |= head;
            bytes[first + 1..last].fill(u8::MAX);
            bytes[last] |= tail;
        }
    }

    /// The covered fraction of each pixel, row by row.
    pub(super) fn fractions(&self) -> Vec<f64> {
        let width = self.window.width;
        let mut fractions = Vec::with_capacity(self.window.area());
        for rows in self.bits.chunks_exact(width * SAMPLES) {
            fractions.extend((0..width).map(|x| {
                let count: u32 = (0..SAMPLES).map(|r| rows[r * width + x].count_ones()).sum();
                f64::from(count) / (PER_PIXEL * PER_PIXEL)
            }));
        }
        fractions
    }

    /// Whether the sample nearest to a point of the window, in pixels from its corner, is covered; nothing is outside.
    pub(super) fn is_covered(&self, point: DVec2) -> bool {
        let row = (point.y * PER_PIXEL).floor();
        if !(row >= 0.0 && row < (self.window.height * SAMPLES) as f64) {
            return false;
        }
        let row = row as usize;
        let column = (point.x * PER_PIXEL - shift(row)).round();
        if !(column >= 0.0 && column < (self.window.width * SAMPLES) as f64) {
            return false;
        }
        let column = column as usize;
        self.bits[row * self.window.width + column / SAMPLES] >> (column % SAMPLES) & 1 == 1
    }
}

/// Where an edge crosses the rows of samples. Its ends are in the order of their y: two faces that share the edge get the
/// same bits.
struct Slope {
    start: DVec2,
    per_row: f64,
}

impl Slope {
    fn new(start: DVec2, end: DVec2) -> Self {
        Self { start, per_row: (end.x - start.x) / (end.y - start.y) }
    }

    #[inline]
    fn at(&self, row: usize) -> f64 {
        self.start.x + (row as f64 + 0.5 - self.start.y) * self.per_row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Window = Window { left: 3, top: 2, width: 10, height: 9 };

    fn total(points: &[DVec2], faces: &[[u32; 3]]) -> f64 {
        Coverage::of(points, &Topology::new(faces), WINDOW).fractions().iter().sum()
    }

    #[test]
    fn areas_are_those_of_the_triangles_inside_of_the_window() {
        let points = [DVec2::new(4.1, 3.2), DVec2::new(11.3, 4.4), DVec2::new(6.0, 9.9)];
        let area = 0.5 * (points[1] - points[0]).perp_dot(points[2] - points[0]);
        assert!((total(&points, &[[0, 1, 2]]) - area).abs() < 0.02 * area);
        assert_eq!(total(&points, &[[0, 1, 2]]), total(&points, &[[1, 0, 2], [0, 1, 2]]), "a union");
        let large = [DVec2::splat(-100.0), DVec2::new(500.0, -100.0), DVec2::new(-100.0, 500.0)];
        assert_eq!(total(&large, &[[0, 1, 2]]), 90.0);
        let unknown = [DVec2::splat(f64::NAN), points[1], points[2]];
        assert_eq!(total(&unknown, &[[0, 1, 2]]), 0.0);
    }

    #[test]
    fn faces_that_share_an_edge_tile_the_plane() {
        // a fan around a point, drawn face by face: no sample twice, none missing
        let centre = DVec2::new(7.3, 6.1);
        let mut points = vec![centre];
        let count = 7;
        points.extend((0..count).map(|k| centre + DVec2::from_angle(0.3 + f64::from(k) * 0.9) * 3.3));
        let faces: Vec<[u32; 3]> = (1..count as u32).map(|k| [0, k, k + 1]).collect();
        let apart: f64 = faces.iter().map(|&face| total(&points, &[face])).sum();
        assert_eq!(apart, total(&points, &faces));
    }

    #[test]
    fn one_orientation_of_a_closed_mesh_covers_what_both_do() {
        let points = [(4.1, 3.2), (11.3, 4.4), (6.0, 9.9), (8.3, 6.1)].map(|(x, y)| DVec2::new(x, y));
        let faces = [[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]];
        assert!(Topology::new(&faces).is_closed() && !Topology::new(&faces[1..]).is_closed());
        let apart = faces.map(|face| Coverage::of(&points, &Topology::new(&[face]), WINDOW).bits);
        let union = |k: usize| apart.iter().fold(0, |bits, face| bits | face[k]);
        let drawn = Coverage::of(&points, &Topology::new(&faces), WINDOW).bits;
        assert!((0..drawn.len()).all(|k| drawn[k] == union(k)));
    }

    #[test]
    fn points_are_looked_up_in_the_sample_that_is_drawn_there() {
        let points = [DVec2::new(3.0, 2.0), DVec2::new(9.0, 2.0), DVec2::new(3.0, 8.0)];
        let coverage = Coverage::of(&points, &Topology::new(&[[0, 1, 2]]), WINDOW);
        for (x, y) in [(0.3, 0.4), (2.9, 2.8), (5.5, 0.2), (3.2, 3.2), (8.0, 8.0), (-1.0, 1.0)] {
            assert_eq!(coverage.is_covered(DVec2::new(x, y)), x >= 0.0 && x + y < 6.0, "({x}, {y})");
        }
    }
}
