//! Gaussians in HAHA's frames of faces, put on the body at rest.
//!
//! HAHA draws a Gaussian of a face with frame F, centroid c and size k (`face_frame::haha_size`) at `c + F x k`, turned by
//! `F q`, its scales times k (runners/train_gaussians.py, `calc_faces_transform`). On the body at rest that gives the mean,
//! rotation and scales from which `face-haha-scaled` poses: its R is F_posed F_restᵀ, its growth k_posed / k_rest.

use glam::{DMat3, DVec3, Vec3};
use skinsplat_core::math::{portable, rotation};
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{FaceBinding, Gaussians, RestBody};
use skinsplat_posing::FaceFrame;
use skinsplat_posing::face_frame::{frame, haha_size};

/// Further from where they belong, Gaussians are spoken of, metres.
const NOTICED: f64 = 1e-5;

/// Puts Gaussians that are measured in the frames of their faces on a body. Returns what has to be said of it.
pub(super) fn put(gaussians: &mut Gaussians, binding: &mut FaceBinding, body: &RestBody) -> Vec<String> {
    let normals = vertex_normals(&body.vertices, &body.faces);
    let (mut flat, mut off, mut farthest) = (0usize, 0usize, 0.0f64);
    for i in 0..gaussians.len() {
        let face = body.faces[binding.faces[i] as usize];
        let corners = face.map(|v| body.vertices[v as usize]);
        let single = corners.map(|v| v.as_vec3());
        let k = haha_size(&single);
        let own = gaussians.unit_rotation(i);
        let offset = gaussians.means[i].as_dvec3() * f64::from(k);
        let offset = match frame(FaceFrame::Haha, single) {
            Some(frame) => {
                gaussians.rotations[i] = rotation::multiply(rotation::matrix_to_quaternion(frame), own);
                let row = |r: usize| DVec3::from_array(frame[r].map(f64::from)).dot(offset);
                DVec3::new(row(0), row(1), row(2))
            }
            None => {
                flat += 1;
                offset
            }
        };
        gaussians.log_scales[i] += Vec3::splat(portable::ln(k));
        let mean = (corners[0] + corners[1] + corners[2]) / 3.0 + offset;
        gaussians.means[i] = mean.as_vec3();
        let place = Place::of(mean, corners, face.map(|v| normals[v as usize]));
        binding.barycentric[i] = place.barycentric().map(|b| b as f32);
        binding.offsets[i] = place.offset as f32;
        if place.error > NOTICED {
            (off, farthest) = (off + 1, farthest.max(place.error));
        }
    }
    let n = gaussians.len();
    let mut notes = Vec::new();
    if flat > 0 {
        notes.push(format!("{flat} of {n} Gaussians are on faces without area and keep their rotation"));
    }
    if off > 0 {
        let millimetres = farthest * 1e3;
        notes.push(format!(
            "{off} of {n} Gaussians lie where no offset along the normals of their face leads: up to {millimetres:.2} mm off \
             under strategies other than face-haha-scaled"
        ));
    }
    notes
}

/// A point as a place on a face: barycentric coordinates (the first follows from the others) and an offset along the
/// interpolated unit normal.
#[derive(Clone, Copy)]
struct Place {
    second: f64,
    third: f64,
    offset: f64,
    /// How far off it is, metres.
    error: f64,
}

/// Newton steps; halved where they lead away.
const STEPS: usize = 40;

impl Place {
    /// The place whose point is `target`, or the nearest that was found.
    fn of(target: DVec3, corners: [DVec3; 3], normals: [DVec3; 3]) -> Self {
        let surface = Face { corners, normals };
        let mut best =
            surface.checked(Self { second: 1.0 / 3.0, third: 1.0 / 3.0, offset: 0.0, error: 0.0 }, target);
        let mut step = 1.0;
        for _ in 0..STEPS {
            let (point, jacobian) = surface.at(&best);
            if best.error <= 1e-12 || jacobian.determinant().abs() < 1e-30 {
                break;
            }
            let change = jacobian.inverse() * (target - point) * step;
            let next = Self {
                second: best.second + change.x,
                third: best.third + change.y,
                offset: best.offset + change.z,
                error: 0.0,
            };
            let next = surface.checked(next, target);
            if next.error < best.error {
                (best, step) = (next, (2.0f64 * step).min(1.0));
            } else {
                step *= 0.5;
            }
        }
        best
    }

    fn barycentric(&self) -> [f64; 3] {
        [1.0 - self.second - self.third, self.second, self.third]
    }
}

struct Face {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
}

impl Face {
    /// The point of a place, and how it follows the second and third coordinate and the offset.
    fn at(&self, place: &Place) -> (DVec3, DMat3) {
        let mixed = |values: &[DVec3; 3]| -> DVec3 {
            values.iter().zip(place.barycentric()).map(|(&value, b)| value * b).sum()
        };
        let sum = mixed(&self.normals);
        let (unit, length) = (sum.normalize_or_zero(), sum.length());
        let turned = |change: DVec3| match length > 0.0 {
            true => (change - unit * unit.dot(change)) * (place.offset / length),
            false => DVec3::ZERO,
        };
        let column = |k: usize| self.corners[k] - self.corners[0] + turned(self.normals[k] - self.normals[0]);
        (mixed(&self.corners) + unit * place.offset, DMat3::from_cols(column(1), column(2), unit))
    }

    /// The place with its error.
    fn checked(&self, place: Place, target: DVec3) -> Place {
        let error = (self.at(&place).0 - target).length();
        Place { error: if error.is_finite() { error } else { f64::INFINITY }, ..place }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 3] =
        [DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.0, 0.012, 0.001), DVec3::new(-0.01, -0.002, 0.0)];

    #[test]
    fn a_point_near_a_curved_face_has_a_place_whose_point_it_is() {
        let normals = [DVec3::new(0.3, 0.0, 1.0), DVec3::new(0.0, 0.4, 1.0), DVec3::new(-0.3, -0.2, 1.0)];
        let normals = normals.map(DVec3::normalize);
        for (x, y, z) in [(0.0, 0.0, 0.0), (0.004, 0.003, 0.002), (-0.01, 0.01, 0.006), (0.02, 0.0, -0.004)] {
            let target = DVec3::new(x, y, z);
            let place = Place::of(target, CORNERS, normals);
            let (point, _) = Face { corners: CORNERS, normals }.at(&place);
            assert!((point - target).length() < 1e-9 && place.error < 1e-9, "{target}: {}", place.error);
        }
    }

    #[test]
    fn a_point_that_cannot_be_placed_is_spoken_of() {
        let place = Place::of(DVec3::Z, CORNERS, [DVec3::ZERO; 3]);
        assert!(place.error > 0.9 && place.barycentric().iter().all(|b| b.is_finite()));
    }
}
