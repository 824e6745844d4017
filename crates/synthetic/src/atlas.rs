//! Texture coordinates: the surface is cut into charts that face one of the six axes, each drawn by orthogonal
//! projection (no texel is stretched more than √3), packed on shelves into the unit square.

use glam::{DVec2, DVec3};
use skinsplat_core::scene::Uv;
use std::collections::BTreeMap;

/// Space between charts, as a fraction of the atlas side: two texels at 512².
const GUTTER: f64 = 2.0 / 512.0;

/// Charts never join faces of different `parts` (one label per face), so that a limb in front of the torso cannot be
/// projected onto it.
pub(super) fn unwrap(vertices: &[DVec3], faces: &[[u32; 3]], parts: &[usize]) -> Uv {
    let neighbours = face_neighbours(faces);
    let normals: Vec<DVec3> = faces.iter().map(|f| face_normal(vertices, f)).collect();
    let labels = smoothed_labels(&normals, parts, &neighbours);
    let charts = components(vertices, faces, &labels, &neighbours);
    let flat: Vec<Chart> = charts.into_iter().map(|c| Chart::project(vertices, faces, c)).collect();
    pack(faces.len(), flat)
}

fn face_normal(vertices: &[DVec3], face: &[u32; 3]) -> DVec3 {
    let [a, b, c] = face.map(|i| vertices[i as usize]);
    (b - a).cross(c - a).normalize_or_zero()
}

/// The faces across the three edges of each face of a closed mesh.
fn face_neighbours(faces: &[[u32; 3]]) -> Vec<Vec<usize>> {
    let mut owner = BTreeMap::new();
    for (i, face) in faces.iter().enumerate() {
        for k in 0..3 {
            owner.insert((face[k], face[(k + 1) % 3]), i);
        }
    }
    let around = |face: &[u32; 3]| -> Vec<usize> {
        (0..3).filter_map(|k| owner.get(&(face[(k + 1) % 3], face[k])).copied()).collect()
    };
    faces.iter().map(around).collect()
}

/// Axis 2 a + s: axis a, positive for s = 0.
fn axis_vector(axis: usize) -> DVec3 {
    let sign = if axis.is_multiple_of(2) { 1.0 } else { -1.0 };
    DVec3::AXES[axis / 2] * sign
}

/// Part and axis per face; jagged borders give way to the majority of the neighbours where the projection stays good.
fn smoothed_labels(normals: &[DVec3], parts: &[usize], neighbours: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let nearest = |normal: &DVec3| {
        let facing = |axis: &usize| normal.dot(axis_vector(*axis));
        (0..6).max_by(|a, b| facing(a).total_cmp(&facing(b))).unwrap_or(0)
    };
    let mut labels: Vec<(usize, usize)> = normals.iter().zip(parts).map(|(n, &p)| (p, nearest(n))).collect();
    for _ in 0..6 {
        let better = |i: usize| {
            let around =
                |label: (usize, usize)| neighbours[i].iter().filter(|&&n| labels[n] == label).count();
            let allowed = |label: &(usize, usize)| {
                label.0 == parts[i] && normals[i].dot(axis_vector(label.1)) > 0.35 && around(*label) >= 2
            };
            neighbours[i].iter().map(|&n| labels[n]).find(allowed).unwrap_or(labels[i])
        };
        labels = (0..labels.len()).map(better).collect();
    }
    labels
}

/// The plane orthogonal to an axis: u x v = axis, so that charts are not mirrored.
fn projected(position: DVec3, axis: usize) -> DVec2 {
    let u = DVec3::AXES[(axis / 2 + 1) % 3];
    let v = axis_vector(axis).cross(u);
    DVec2::new(position.dot(u), position.dot(v))
}

/// Faces of one label that hang together and do not overlap when projected.
struct Component {
    axis: usize,
    faces: Vec<usize>,
}

fn components(
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    labels: &[(usize, usize)],
    neighbours: &[Vec<usize>],
) -> Vec<Component> {
    let mut taken = vec![false; faces.len()];
    let mut components = Vec::new();
    let mut start = 0;
    while start < faces.len() {
        if taken[start] {
            start += 1;
            continue;
        }
        let axis = labels[start].1;
        let mut plane = Plane::default();
        let (mut members, mut next, mut refused) = (Vec::new(), 0, None::<usize>);
        let mut candidates = vec![start];
        while let Some(&face) = candidates.get(next) {
            next += 1;
            let corners = faces[face].map(|i| projected(vertices[i as usize], axis));
            if taken[face] {
                continue;
            }
            // A fold over what is there already (an ear over the head) starts a chart of its own.
            if !plane.place(corners) {
                refused = Some(refused.map_or(face, |first| first.min(face)));
                continue;
            }
            taken[face] = true;
            members.push(face);
            candidates.extend(neighbours[face].iter().filter(|&&n| labels[n] == labels[start] && !taken[n]));
        }
        components.push(Component { axis, faces: members });
        start = refused.map_or(start, |face| face.min(start));
    }
    components
}

/// Side of the squares that [`Plane`] sorts triangles into, metres.
const BUCKET: f64 = 0.02;

/// Triangles in a plane, none of which overlap.
#[derive(Default)]
struct Plane {
    triangles: Vec<[DVec2; 3]>,
    buckets: BTreeMap<(i32, i32), Vec<usize>>,
}

impl Plane {
    /// Adds a counter-clockwise triangle, unless it overlaps one that is there.
    fn place(&mut self, corners: [DVec2; 3]) -> bool {
        let bucket = |p: DVec2| (p / BUCKET).floor().as_ivec2();
        let low = bucket(corners[0].min(corners[1]).min(corners[2]));
        let high = bucket(corners[0].max(corners[1]).max(corners[2]));
        let keys: Vec<(i32, i32)> =
            (low.x..=high.x).flat_map(|x| (low.y..=high.y).map(move |y| (x, y))).collect();
        let clashes = |&i: &usize| overlap(&corners, &self.triangles[i]);
        if keys.iter().any(|key| self.buckets.get(key).is_some_and(|b| b.iter().any(clashes))) {
            return false;
        }
        for key in keys {
            self.buckets.entry(key).or_default().push(self.triangles.len());
        }
        self.triangles.push(corners);
        true
    }
}

/// Do two counter-clockwise triangles share more than border? (Separating axes; exact for triangles that share an edge or
/// a vertex, whose differences cancel to zero.)
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    let outside = |edges: &[DVec2; 3], points: &[DVec2; 3]| {
        (0..3).any(|k| {
            let edge = edges[(k + 1) % 3] - edges[k];
            points.iter().all(|&p| edge.perp_dot(p - edges[k]) <= 0.0)
        })
    };
    !outside(a, b) && !outside(b, a)
}

/// A flat chart, metres, with its lower corner at the origin.
struct Chart {
    /// (face, index of each corner in `points`).
    faces: Vec<(usize, [u32; 3])>,
    points: Vec<DVec2>,
    size: DVec2,
}

impl Chart {
    fn project(vertices: &[DVec3], faces: &[[u32; 3]], component: Component) -> Self {
        let mut index = BTreeMap::new();
        let mut points: Vec<DVec2> = Vec::new();
        let mut chart_faces = Vec::with_capacity(component.faces.len());
        for face in component.faces {
            let corners = faces[face].map(|vertex| {
                *index.entry(vertex).or_insert_with(|| {
                    points.push(projected(vertices[vertex as usize], component.axis));
                    points.len() as u32 - 1
                })
            });
            chart_faces.push((face, corners));
        }
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        points.iter_mut().for_each(|p| *p -= low);
        Self { faces: chart_faces, points, size: high - low }
    }
}

/// Shelves of charts by falling height, in the smallest square that takes them all.
fn pack(face_count: usize, mut charts: Vec<Chart>) -> Uv {
    charts.sort_by(|a, b| b.size.y.total_cmp(&a.size.y));
    let area: f64 = charts.iter().map(|c| c.size.x * c.size.y).sum();
    let widest = charts.iter().map(|c| c.size.x).fold(0.0, f64::max);
    let mut side = (area * 1.02).sqrt().max(widest * 1.02);
    let mut corners = shelves(&charts, side);
    while corners.is_none() {
        side *= 1.01;
        corners = shelves(&charts, side);
    }
    let mut uv = Uv { coordinates: Vec::new(), faces: vec![[0; 3]; face_count] };
    for (chart, corner) in charts.iter().zip(corners.unwrap_or_default()) {
        let first = uv.coordinates.len() as u32;
        uv.coordinates.extend(chart.points.iter().map(|&p| ((p + corner) / side).as_vec2().to_array()));
        for (face, indices) in &chart.faces {
            uv.faces[*face] = indices.map(|i| first + i);
        }
    }
    uv
}

/// Lower corners of the charts in a square of that side, or `None` if they do not fit.
fn shelves(charts: &[Chart], side: f64) -> Option<Vec<DVec2>> {
    let gutter = side * GUTTER;
    let (mut cursor, mut shelf_height) = (DVec2::splat(gutter), 0.0f64);
    let mut corners = Vec::with_capacity(charts.len());
    for chart in charts {
        if cursor.x + chart.size.x + gutter > side {
            cursor = DVec2::new(gutter, cursor.y + shelf_height + gutter);
            shelf_height = 0.0;
        }
        shelf_height = shelf_height.max(chart.size.y);
        if cursor.y + chart.size.y + gutter > side || cursor.x + chart.size.x + gutter > side {
            return None;
        }
        corners.push(cursor);
        cursor.x += chart.size.x + gutter;
    }
    Some(corners)
}
