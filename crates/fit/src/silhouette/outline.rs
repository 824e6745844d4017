//! From the derivative of a loss by the coverage of each pixel to its derivative by every projected vertex.

use super::coverage::{Coverage, SAMPLES};
use super::topology::{Side, Topology};
use glam::DVec2;

/// How far on either side of an edge it is looked whether the mesh covers the place, pixels: farther than the nearest
/// sample may be from there, which is `1 / (8 √2)`.
const BESIDE: f64 = 1.5 / SAMPLES as f64;
/// Longer pieces of an edge are looked at in parts, pixels.
const LONGEST_PIECE: f64 = 0.5;

/// The derivative by every vertex of a loss, given its derivative by the coverage of every pixel of the window.
///
/// An edge bounds the silhouette of its own faces if all of them lie on one side of it in the image; a piece of it
/// bounds the silhouette of the mesh if nothing covers one of its sides. Within one pixel the derivative by the coverage
/// is constant and the velocity linear along the edge, so that cutting edges at the borders of pixels makes the integral
/// exact. A rounded surface has several such edges in a row within a fraction of a sample of its outline; those that
/// face the other way count negative, so that every place of the outline counts once in all.
pub(super) fn pulled_back(
    topology: &Topology,
    points: &[DVec2],
    coverage: &Coverage,
    by_coverage: &[f64],
) -> Vec<DVec2> {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| points[i as usize]);
        (b - a).perp_dot(c - a)
    };
    let areas: Vec<f64> = topology.faces().iter().map(area).collect();
    let mut gradient = vec![DVec2::ZERO; points.len()];
    for (edge, &[a, b]) in topology.edges().iter().enumerate() {
        let Some(side) = common_side(topology.sides(edge), &areas) else { continue };
        let corner = coverage.window.corner();
        let segment =
            Segment { start: points[a as usize] - corner, end: points[b as usize] - corner, outward: -side };
        let [start, end] = segment.integrated(coverage, by_coverage);
        gradient[a as usize] += start;
        gradient[b as usize] += end;
    }
    gradient
}

/// On which side of an edge all of its faces lie in the image: 1 for the side to which a quarter turn from x to y takes
/// its direction. `None` if they lie on both, or a face has no projection. Faces without area lie on no side.
fn common_side(sides: &[Side], areas: &[f64]) -> Option<f64> {
    let mut common = 0.0;
    for side in sides {
        let area = areas[side.face as usize];
        let sign = if side.forward { area } else { -area };
        if sign.is_nan() || sign * common < 0.0 {
            return None;
        }
        if sign != 0.0 {
            common = sign.signum();
        }
    }
    (common != 0.0).then_some(common)
}

/// An edge in a window, and the side on which its faces do not lie.
struct Segment {
    start: DVec2,
    end: DVec2,
    outward: f64,
}

impl Segment {
    /// The derivatives by the two ends.
    fn integrated(&self, coverage: &Coverage, by_coverage: &[f64]) -> [DVec2; 2] {
        let window = coverage.window;
        let along = self.end - self.start;
        let mut sums = [0.0; 2];
        let size = DVec2::new(window.width as f64, window.height as f64);
        let Some((mut from, last)) = clipped(self.start, along, size) else { return [DVec2::ZERO; 2] };
        let length = along.length();
        // as long as the edge, since integration along it is over a parameter from zero to one
        let normal = along.perp() * self.outward;
        let beside = normal / length * BESIDE;
        while from < last {
            // past the border on which the last piece ended, into the next pixel
            let inside = self.start + along * (from + 1e-9 / length.max(1.0));
            let to = next_border(self.start, along, inside.floor())
                .min(from + LONGEST_PIECE / length)
                .max(from + 1e-12)
                .min(last);
            let parameter = (from + to) / 2.0;
            let middle = self.start + along * parameter;
            if !(coverage.is_covered(middle + beside) && coverage.is_covered(middle - beside)) {
                let x = (middle.x as usize).min(window.width - 1);
                let y = (middle.y as usize).min(window.height - 1);
                let weight = by_coverage[y * window.width + x] * (to - from);
                sums[0] += weight * (1.0 - parameter);
                sums[1] += weight * parameter;
            }
            from = to;
        }
        sums.map(|sum| normal * sum)
    }
}

/// The part of `start + t along`, t from zero to one, in the rectangle from the origin to `size`.
fn clipped(start: DVec2, along: DVec2, size: DVec2) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let (p, d) = (start[axis], along[axis]);
        if d == 0.0 {
            if p < 0.0 || p > size[axis] {
                return None;
            }
            continue;
        }
        let (t0, t1) = (-p / d, (size[axis] - p) / d);
        from = from.max(t0.min(t1));
        to = to.min(t0.max(t1));
    }
    (from < to).then_some((from, to))
}

/// Where `start + t along` leaves a pixel.
fn next_border(start: DVec2, along: DVec2, pixel: DVec2) -> f64 {
    let leaves = |axis: usize| match along[axis] {
        d if d > 0.0 => (pixel[axis] + 1.0 - start[axis]) / d,
        d if d < 0.0 => (pixel[axis] - start[axis]) / d,
        _ => f64::INFINITY,
    };
    leaves(0).min(leaves(1))
}

#[cfg(test)]
mod tests {
    use super::super::{Blur, Window, compare, overlap};
    use super::*;

    const WINDOW: Window = Window { left: 2, top: 1, width: 14, height: 12 };

    /// The part of a convex polygon on the positive side of a line.
    fn cut(polygon: &[DVec2], a: DVec2, b: DVec2) -> Vec<DVec2> {
        let height = |p: DVec2| (b - a).perp_dot(p - a);
        let mut kept = Vec::new();
        for (k, &p) in polygon.iter().enumerate() {
            let q = polygon[(k + 1) % polygon.len()];
            if height(p) >= 0.0 {
                kept.push(p);
            }
            if (height(p) >= 0.0) != (height(q) >= 0.0) {
                kept.push(p + (q - p) * (height(p) / (height(p) - height(q))));
            }
        }
        kept
    }

    fn within(polygon: Vec<DVec2>, other: &[DVec2]) -> Vec<DVec2> {
        (0..other.len()).fold(polygon, |p, k| cut(&p, other[k], other[(k + 1) % other.len()]))
    }

    fn area(polygon: &[DVec2]) -> f64 {
        (2..polygon.len())
            .map(|k| (polygon[k - 1] - polygon[0]).perp_dot(polygon[k] - polygon[0]) / 2.0)
            .sum()
    }

    /// The exact coverage of the pixels of the window by the union of two convex polygons.
    fn exact(first: &[DVec2], second: &[DVec2]) -> Vec<f64> {
        let both = if second.is_empty() { Vec::new() } else { within(first.to_vec(), second) };
        let pixel = |i: usize| {
            let corner = DVec2::new((i % WINDOW.width) as f64, (i / WINDOW.width) as f64) + WINDOW.corner();
            let square =
                [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| corner + DVec2::new(x, y));
            let covered = |polygon: &[DVec2]| area(&within(polygon.to_vec(), &square));
            covered(first) + covered(second) - covered(&both)
        };
        (0..WINDOW.area()).map(pixel).collect()
    }

    fn weights() -> Vec<f64> {
        (0..WINDOW.area()).map(|i| ((i * i * 7 + 3 * i) % 23) as f64 / 11.0 - 1.0).collect()
    }

    fn differences(points: &[DVec2], loss: impl Fn(&[DVec2]) -> f64) -> Vec<DVec2> {
        let by = |i: usize, axis: usize| {
            let at = |step: f64| {
                let mut moved = points.to_vec();
                moved[i][axis] += step;
                loss(&moved)
            };
            (at(1e-5) - at(-1e-5)) / 2e-5
        };
        (0..points.len()).map(|i| DVec2::new(by(i, 0), by(i, 1))).collect()
    }

    /// A convex pentagon that leaves the window on one side, as a fan.
    fn pentagon() -> (Vec<DVec2>, Vec<[u32; 3]>) {
        let points = [(4.2, 3.1), (11.4, 2.3), (18.7, 6.6), (9.9, 11.2), (3.6, 8.45)];
        (points.map(|(x, y)| DVec2::new(x, y)).to_vec(), vec![[0, 1, 2], [0, 2, 3], [0, 4, 3]])
    }

    #[test]
    fn the_derivative_is_exact_where_nothing_is_hidden() {
        let (points, faces) = pentagon();
        let weights = weights();
        let loss =
            |points: &[DVec2]| -> f64 { exact(points, &[]).iter().zip(&weights).map(|(c, w)| c * w).sum() };
        let topology = Topology::new(&faces);
        let coverage = Coverage::of(&points, &topology, WINDOW);
        let found = pulled_back(&topology, &points, &coverage, &weights);
        for (i, (found, expected)) in found.iter().zip(differences(&points, loss)).enumerate() {
            // the coverage is piecewise quadratic: central differences are exact but for rounding
            assert!((*found - expected).length() < 1e-7, "{i}: {found} {expected}");
        }
    }

    #[test]
    fn hidden_parts_do_not_count() {
        let (mut points, mut faces) = pentagon();
        let second = [(7.1, 5.2), (13.8, 4.4), (10.3, 13.9)].map(|(x, y)| DVec2::new(x, y));
        points.extend(second);
        faces.push([5, 6, 7]);
        let weights = weights();
        let loss = |points: &[DVec2]| -> f64 {
            exact(&points[..5], &points[5..]).iter().zip(&weights).map(|(c, w)| c * w).sum()
        };
        let topology = Topology::new(&faces);
        let coverage = Coverage::of(&points, &topology, WINDOW);
        let found = pulled_back(&topology, &points, &coverage, &weights);
        for (i, (found, expected)) in found.iter().zip(differences(&points, loss)).enumerate() {
            // where two outlines cross, a piece counts as a whole or not at all
            assert!((*found - expected).length() < 0.5 * LONGEST_PIECE, "{i}: {found} {expected}");
        }
        points[7] = DVec2::new(10.3, 8.2);
        let coverage = Coverage::of(&points, &topology, WINDOW);
        let inside = pulled_back(&topology, &points, &coverage, &weights);
        assert_eq!(inside[5..], [DVec2::ZERO; 3]);
    }

    #[test]
    fn the_whole_chain_pulls_as_finite_differences_of_the_exact_one() {
        let (points, faces) = pentagon();
        let blur = Blur::new(1.0, 3.0);
        let shifted: Vec<DVec2> = points.iter().map(|&p| p + DVec2::new(0.8, -0.5)).collect();
        let filtered = |points: &[DVec2]| {
            let mut coverage = exact(points, &[]);
            blur.apply(&mut coverage, WINDOW.width);
            coverage
        };
        let mask: Vec<f32> = filtered(&shifted).iter().map(|&v| v as f32).collect();
        let loss = |points: &[DVec2]| overlap::overlap(&filtered(points), &mask).0;
        let found = compare(&Topology::new(&faces), &points, WINDOW, &mask, &blur);
        assert!((found.iou - loss(&points)).abs() < 1e-3, "{} {}", found.iou, loss(&points));
        let expected = differences(&points, loss);
        let largest = expected.iter().map(|e| e.length()).fold(0.0, f64::max);
        for (i, (found, expected)) in found.gradient.iter().zip(expected).enumerate() {
            // the drawn coverage has 64 levels
            assert!((*found - expected).length() < 0.02 * largest, "{i}: {found} {expected}");
        }
    }

    /// A sphere of many small faces: the outline runs over many edges, some of them folded back within a sample.
    #[test]
    fn a_finely_divided_sphere_grows_by_its_circumference() {
        let window = Window { left: 0, top: 0, width: 64, height: 64 };
        let (rows, columns) = (97u32, 211u32);
        let direction = |k: u32| {
            let (row, column) = (k / columns, k % columns);
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(rows - 1);
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(columns) + 0.01 * f64::from(row);
            // turned, so that no edge is seen edge-on
            glam::DQuat::from_rotation_x(0.7)
                * glam::DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        let mut faces = Vec::new();
        for row in 0..rows - 1 {
            for column in 0..columns {
                let at = |r: u32, c: u32| r * columns + c % columns;
                faces.push([at(row, column), at(row + 1, column), at(row + 1, column + 1)]);
                faces.push([at(row, column), at(row + 1, column + 1), at(row, column + 1)]);
            }
        }
        let radius = 25.3;
        let normals: Vec<DVec2> = (0..rows * columns).map(|k| direction(k).truncate()).collect();
        let points: Vec<DVec2> = normals.iter().map(|n| DVec2::splat(32.1) + *n * radius).collect();
        let topology = Topology::new(&faces);
        let coverage = Coverage::of(&points, &topology, window);
        let gradient = pulled_back(&topology, &points, &coverage, &vec![1.0; window.area()]);
        let growth: f64 = gradient.iter().zip(&normals).map(|(g, n)| g.dot(*n)).sum();
        let expected = std::f64::consts::TAU * radius;
        assert!((growth / expected - 1.0).abs() < 0.01, "{growth} {expected}");
    }
}
