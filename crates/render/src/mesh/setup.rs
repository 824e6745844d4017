//! From faces in world space to triangles in fixed-point pixel coordinates: projection, clipping, edge equations.

use super::Mesh;
use glam::DVec3;
use rayon::prelude::*;
use skinsplat_core::scene::Camera;
use skinsplat_core::scene::camera::MAX_IMAGE_SIDE;

/// Nothing nearer to the camera than this is drawn, metres (the near plane of 3DGS).
pub const NEAR_PLANE: f64 = 0.01;

/// Fixed-point units per pixel.
pub(super) const UNITS: i64 = 4096;

/// Triangles are clipped this far from the image origin, pixels. With it, coordinates stay below 2^30 units and edge
/// functions below 2^62.
const GUARD_BAND: f64 = (1 << 17) as f64;
const _: () = assert!(GUARD_BAND > 2.0 * MAX_IMAGE_SIDE as f64);

/// A linear function of pixel coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    x: f64,
    y: f64,
    constant: f64,
}

impl Plane {
    /// The plane of `normal · ray` over the image, for rays through pixels with a z component of one.
    fn of_rays(normal: DVec3, camera: &Camera) -> Self {
        let (x, y) = (normal.x / camera.fx, normal.y / camera.fy);
        Self { x, y, constant: normal.z - x * camera.cx - y * camera.cy }
    }

    pub(super) fn at(self, x: f64, y: f64) -> f64 {
        self.x * x + self.y * y + self.constant
    }

    /// The change over a step of (x, y) pixels.
    pub(super) fn change(self, x: f64, y: f64) -> f64 {
        self.x * x + self.y * y
    }
}

/// A directed edge: `x * px + y * py + constant >= 0` for the points (px, py), in units, that it lets in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) x: i64,
    pub(super) y: i64,
    constant: i64,
}

impl Edge {
    /// The edge a -> b of a triangle whose inside has positive values; points exactly on it belong to the triangle if it
    /// is a top or a left edge.
    fn new(a: [i64; 2], b: [i64; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let top_left = dy < 0 || (dy == 0 && dx > 0);
        let constant = dy * a[0] - dx * a[1] - i64::from(!top_left);
        Self { x: -dy, y: dx, constant }
    }

    pub(super) fn at(self, x: i64, y: i64) -> i64 {
        self.x * x + self.y * y + self.constant
    }
}

/// A triangle ready to be tested against samples: a face, or a part of one that was clipped.
#[derive(Clone, Debug)]
pub(super) struct Triangle {
    pub(super) face: u32,
    pub(super) edges: [Edge; 3],
    /// First and last pixel column and row that it may touch, inside the image.
    pub(super) columns: [u32; 2],
    pub(super) rows: [u32; 2],
    /// 1/z, and its range over the triangle.
    pub(super) inverse_depth: Plane,
    pub(super) inverse_depth_range: [f32; 2],
    /// Camera depth of the face's three corners, metres.
    pub(super) depths: [f64; 3],
    /// Barycentric coordinates of the face up to a common factor: `p1 x p2`, `p2 x p0`, `p0 x p1` along the ray.
    pub(super) barycentric: [Plane; 3],
}

impl Triangle {
    /// Perspective-correct barycentric coordinates of the face at pixel coordinates (x, y). Snapping may put a covered
    /// sample just outside of the exact triangle: the coordinates are clamped to it.
    pub(super) fn barycentric_at(&self, x: f64, y: f64) -> [f64; 3] {
        let raw = self.barycentric.map(|plane| plane.at(x, y));
        let scale = 1.0 / (raw[0] + raw[1] + raw[2]);
        let exact = raw.map(|b| b * scale);
        if exact.iter().all(|&b| b >= 0.0) {
            return exact;
        }
        let inside = exact.map(|b| b.max(0.0));
        let total: f64 = inside.iter().sum();
        // a face seen exactly edge-on has no ray through its inside
        if total.is_finite() && total > 0.0 { inside.map(|b| b / total) } else { [1.0 / 3.0; 3] }
    }
}

/// All triangles of a mesh that may touch the image, in the order of the faces.
pub(super) fn triangles(mesh: &Mesh<'_>, camera: &Camera) -> Vec<Triangle> {
    let to_camera = |v: &glam::Vec3| camera.camera_from_world.transform_point3(v.as_dvec3());
    let points: Vec<DVec3> = mesh.vertices.par_iter().map(to_camera).collect();
    let of_face = |(index, face): (usize, &[u32; 3])| {
        let corners = face.map(|i| points[i as usize]);
        face_triangles(index as u32, corners, camera)
    };
    mesh.faces.par_iter().enumerate().with_min_len(512).flat_map_iter(of_face).collect()
}

fn face_triangles(face: u32, corners: [DVec3; 3], camera: &Camera) -> Parts {
    if !corners.iter().all(|p| p.is_finite()) {
        return Parts::Whole(None);
    }
    let planes = clip_planes(camera);
    let is_inside = |p: &DVec3| planes.iter().all(|plane| plane.dot(p.extend(1.0)) >= 0.0);
    if corners.iter().all(is_inside) {
        return Parts::Whole(triangle(face, corners, corners, camera));
    }
    let polygon = planes.iter().fold(corners.to_vec(), |polygon, &plane| clipped(&polygon, plane));
    let fan = (2..polygon.len()).map(|k| [polygon[0], polygon[k - 1], polygon[k]]);
    Parts::Clipped(
        fan.filter_map(|part| triangle(face, corners, part, camera)).collect::<Vec<_>>().into_iter(),
    )
}

/// The triangles of one face: almost always one at most, so that no list is needed.
enum Parts {
    Whole(Option<Triangle>),
    Clipped(std::vec::IntoIter<Triangle>),
}

impl Iterator for Parts {
    type Item = Triangle;

    fn next(&mut self) -> Option<Triangle> {
        match self {
            Self::Whole(triangle) => triangle.take(),
            Self::Clipped(triangles) => triangles.next(),
        }
    }
}

/// Half-spaces `plane · (p, 1) >= 0` in camera space: the near plane and the four sides of the guard band.
fn clip_planes(camera: &Camera) -> [glam::DVec4; 5] {
    let Camera { fx, fy, cx, cy, .. } = *camera;
    [
        glam::DVec4::new(0.0, 0.0, 1.0, -NEAR_PLANE),
        glam::DVec4::new(fx, 0.0, cx + GUARD_BAND, 0.0),
        glam::DVec4::new(-fx, 0.0, GUARD_BAND - cx, 0.0),
        glam::DVec4::new(0.0, fy, cy + GUARD_BAND, 0.0),
        glam::DVec4::new(0.0, -fy, GUARD_BAND - cy, 0.0),
    ]
}

/// The part of a convex polygon on the positive side of a plane (Sutherland and Hodgman). A crossing is computed from
/// the inside point to the outside one, so that two faces that share an edge get the same new vertex.
fn clipped(polygon: &[DVec3], plane: glam::DVec4) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (at_p, at_q) = (plane.dot(p.extend(1.0)), plane.dot(q.extend(1.0)));
        if at_p >= 0.0 {
            kept.push(p);
        }
        if (at_p >= 0.0) != (at_q >= 0.0) {
            let ((inside, at_inside), (outside, at_outside)) =
                if at_p >= 0.0 { ((p, at_p), (q, at_q)) } else { ((q, at_q), (p, at_p)) };
            kept.push(inside + (outside - inside) * (at_inside / (at_inside - at_outside)));
        }
    }
    kept
}

/// Sets up one part of a face; `None` if it covers no area or lies outside of the image.
fn triangle(face: u32, corners: [DVec3; 3], part: [DVec3; 3], camera: &Camera) -> Option<Triangle> {
    let [a, mut b, mut c] = part.map(|p| snapped(p, camera));
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0 {
        return None;
    }
    if area < 0 {
        std::mem::swap(&mut b, &mut c);
    }
    let range = |axis: usize, side: u32| {
        let (lowest, highest) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
        let (first, last) =
            (lowest.div_euclid(UNITS).max(0), highest.div_euclid(UNITS).min(i64::from(side) - 1));
        (first <= last).then_some([first as u32, last as u32])
    };
    let [p0, p1, p2] = corners;
    let normals = [p1.cross(p2), p2.cross(p0), p0.cross(p1)];
    let determinant = p0.dot(normals[0]);
    let inverse_depth = Plane::of_rays((normals[0] + normals[1] + normals[2]) / determinant, camera);
    let inverse_depths = part.map(|p| (1.0 / p.z) as f32);
    Some(Triangle {
        face,
        edges: [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)],
        columns: range(0, camera.width)?,
        rows: range(1, camera.height)?,
        inverse_depth,
        depths: corners.map(|p| p.z),
        inverse_depth_range: [
            inverse_depths.iter().copied().fold(f32::INFINITY, f32::min),
            inverse_depths.iter().copied().fold(0.0, f32::max),
        ],
        barycentric: normals.map(|normal| Plane::of_rays(normal, camera)),
    })
}

/// Fixed-point pixel coordinates of a point in front of the camera.
fn snapped(p: DVec3, camera: &Camera) -> [i64; 2] {
    let limit = GUARD_BAND * UNITS as f64;
    let fixed = |pixels: f64| (pixels * UNITS as f64).round().clamp(-limit, limit) as i64;
    [fixed(camera.fx * p.x / p.z + camera.cx), fixed(camera.fy * p.y / p.z + camera.cy)]
}
