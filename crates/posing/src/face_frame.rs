//! Orthonormal frames on triangles, as three stock methods build them, and the rotation of a face between two poses.
//!
//! Cost: a cross product and two square roots per face and pose. A face without area (its normal shorter than 1e-5 of
//! the product of its edges, or an edge of zero length) has no frame; callers then fall back on the quaternion average
//! of the skinning weights. An inverted face has a proper frame like any other.

use glam::{DVec3, Vec3};
use skinsplat_core::math::{matrix3, rotation};

/// Orthonormal frames on a triangle, from one edge and the normal. R is the posed frame times the transposed rest frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceFrame {
    /// Tangent v0→v1, columns \[d×n, −n, d\].
    SplattingAvatar,
    /// Tangent v1→v0, columns \[n, r1, r2\] turned in the plane. The turn is constant, so R is that of SplattingAvatar.
    IHuman,
    /// Tangent v1→v2, columns \[e1, n, e1×n\].
    Haha,
    /// HAHA in full: means and scales also follow the size k of the triangle, measured from its centroid.
    HahaScaled,
}

/// A rotation matrix, row-major; its columns are the axes of the frame.
pub type Frame = [[f32; 3]; 3];

/// A face is degenerate if |e × f| is at most this times |e| |f|.
const DEGENERATE_SINE: f32 = 1e-5;

/// HAHA divides the size of a triangle by this length, metres.
const HAHA_UNIT: f32 = 0.05;

/// The frame of a triangle. `None` without area.
///
/// With n the outward normal (v1 − v0) × (v2 − v0) / |…|:
/// ```text
/// SplattingAvatar   d = unit(v1 − v0)     [d × n | −n | d]       utils/map.py
/// iHuman            r = unit(v0 − v1)     [n | r | n × r]        deformer/mm_triangle_model.py, angle 0
/// HAHA              e = unit(v2 − v1)     [e | n | e × n]        runners/train_gaussians.py
/// ```
pub fn frame(kind: FaceFrame, [a, b, c]: [Vec3; 3]) -> Option<Frame> {
    let (edge, side) = match kind {
        FaceFrame::SplattingAvatar | FaceFrame::IHuman => (b - a, c - a),
        FaceFrame::Haha | FaceFrame::HahaScaled => (c - b, a - b),
    };
    let cross = edge.cross(side);
    let (length, area) = (edge.length(), cross.length());
    if !(area > DEGENERATE_SINE * length * side.length() && area.is_finite()) {
        return None;
    }
    let (tangent, normal) = (edge / length, cross / area);
    if !(tangent.is_finite() && normal.is_finite()) {
        return None;
    }
    let [x, y, z] = match kind {
        FaceFrame::SplattingAvatar => [tangent.cross(normal), -normal, tangent],
        FaceFrame::IHuman => [normal, -tangent, normal.cross(-tangent)],
        FaceFrame::Haha | FaceFrame::HahaScaled => [tangent, normal, tangent.cross(normal)],
    };
    Some([[x.x, y.x, z.x], [x.y, y.y, z.y], [x.z, y.z, z.z]])
}

/// iHuman's frame with its free in-plane angle given as a direction (cos, sin): `[n | c r1 + s r2 | −s r1 + c r2]`.
pub fn ihuman_turned(triangle: [Vec3; 3], [c, s]: [f32; 2]) -> Option<Frame> {
    let frame = frame(FaceFrame::IHuman, triangle)?;
    Some(frame.map(|[n, r1, r2]| [n, c * r1 + s * r2, c * r2 - s * r1]))
}

/// The rotation that takes the rest frame of a face to its posed one, F_posed F_restᵀ, as a unit quaternion, w ≥ 0.
pub(crate) fn rotation_between(posed: &Frame, rest: &Frame) -> [f32; 4] {
    rotation::matrix_to_quaternion(matrix3::multiply(*posed, matrix3::transpose(*rest)))
}

/// HAHA's k: the mean of the side |v0 − v2| and the height over it, in units of 5 cm. Zero without area.
pub fn haha_size([a, b, c]: &[Vec3; 3]) -> f32 {
    let side = a.distance(*c);
    let height = if side > 0.0 { (c - b).cross(a - b).length() / side } else { 0.0 };
    0.5 * (height + side) / HAHA_UNIT
}

/// The mean of the corners.
pub(crate) fn centroid([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (a + b + c) / 3.0
}

/// The derivatives with respect to the corners of a triangle, from that with respect to a further rotation of its [`frame`],
/// `exp(ω) F`. Zero without area.
///
/// With b = t × n, for the unit edge t and the normal n: ω·b = δt·n, ω·n = −δt·b, ω·t = δn·b.
pub(crate) fn frame_adjoint(kind: FaceFrame, corners: [Vec3; 3], torque: DVec3) -> [DVec3; 3] {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    if torque == DVec3::ZERO || frame(kind, corners).is_none() {
        return [DVec3::ZERO; 3];
    }
    let (edge, side) = match kind {
        FaceFrame::SplattingAvatar | FaceFrame::IHuman => (b - a, c - a),
        FaceFrame::Haha | FaceFrame::HahaScaled => (c - b, a - b),
    };
    let (length, cross) = (edge.length(), edge.cross(side));
    let area = cross.length();
    let (tangent, normal) = (edge / length, cross / area);
    let binormal = tangent.cross(normal);
    let turn = torque.dot(tangent) / area;
    let of_edge = (normal * torque.dot(binormal) - binormal * torque.dot(normal)) / length
        + side.cross(binormal) * turn;
    let of_side = binormal.cross(edge) * turn;
    let of_start = -of_edge - of_side;
    match kind {
        FaceFrame::SplattingAvatar | FaceFrame::IHuman => [of_start, of_edge, of_side],
        FaceFrame::Haha | FaceFrame::HahaScaled => [of_side, of_start, of_edge],
    }
}

/// The derivatives of [`haha_size`] with respect to the corners. Zero without area.
pub(crate) fn haha_size_adjoint(corners: [Vec3; 3]) -> [DVec3; 3] {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let (u, v) = (c - b, a - b);
    let (cross, side) = (u.cross(v), a - c);
    let (area, length) = (cross.length(), side.length());
    if !(area > 0.0 && length > 0.0) {
        return [DVec3::ZERO; 3];
    }
    let (normal, scale) = (cross / area, 0.5 / f64::from(HAHA_UNIT));
    let (of_u, of_v) = (v.cross(normal) / length * scale, normal.cross(u) / length * scale);
    let along = side / length * (scale * (1.0 - area / (length * length)));
    [of_v + along, -of_u - of_v, of_u - along]
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::random::SplitMix64;

    /// Against central differences of frames in f32: 1e-3 steps leave 1e-4 of rounding.
    #[test]
    fn frames_and_sizes_are_followed_to_the_corners() {
        let mut random = SplitMix64::new(8);
        let mut number = || 2.0 * random.unit_f32() - 1.0;
        for _ in 0..100 {
            let mut corner = || Vec3::new(number(), number(), number());
            let corners = [corner(), corner(), corner()];
            let (weights, sized) = ([corner(), corner(), corner()], corner().x);
            if (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() < 0.3 {
                continue;
            }
            for kind in
                [FaceFrame::SplattingAvatar, FaceFrame::IHuman, FaceFrame::Haha, FaceFrame::HahaScaled]
            {
                let own: Frame = weights.map(|row| row.to_array());
                let loss = |corners: [Vec3; 3]| {
                    let frame = frame(kind, corners).unwrap();
                    let turned: f32 =
                        frame.iter().flatten().zip(own.as_flattened()).map(|(a, b)| a * b).sum();
                    f64::from(turned) + f64::from(sized * haha_size(&corners) * 0.05)
                };
                let at = frame(kind, corners).unwrap();
                let torque = rotation::adjoint::matrix_to_torque(&at, &own).map(f64::from);
                let found = frame_adjoint(kind, corners, DVec3::from_array(torque));
                let of_size = haha_size_adjoint(corners).map(|own| own * f64::from(sized) * 0.05);
                let size = found.iter().map(|g| g.length()).fold(1.0, f64::max);
                for k in 0..3 {
                    for axis in 0..3 {
                        let slope = |h: f32| {
                            let ends = [h, -h].map(|h| {
                                let mut corners = corners;
                                corners[k][axis] += h;
                                loss(corners)
                            });
                            (ends[0] - ends[1]) / (2.0 * f64::from(h))
                        };
                        let expected = (4.0 * slope(4e-3) - slope(8e-3)) / 3.0;
                        let own = (found[k] + of_size[k])[axis];
                        assert!((own - expected).abs() < 1e-3 * size, "{kind:?}: {own} is not {expected}");
                    }
                }
            }
        }
    }
}
