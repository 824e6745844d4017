//! The derivative of LBS against differences of the posed surface, in f64.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/posing_gradients.rs"]
mod posing_gradients;
#[path = "../../../tests/support/rig.rs"]
mod rig;

use glam::{DMat3, DVec3, Vec3};
use posing_gradients::{Case, kinds, upstream};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, PosedBody, RestBody, SkinWeights};
use skinsplat_posing::{BoundAvatar, CovarianceChoice, PRESETS, RotationChoice, Strategy, pose};

/// A Gaussian in the middle of every face, unit-sized, unrotated: its factor is the derivative itself.
fn probes(body: &RestBody) -> Avatar {
    let n = body.faces.len();
    let mut avatar = rig::on_faces(body, n, 1);
    let gaussians = &mut avatar.gaussians;
    gaussians.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    gaussians.log_scales.fill(Vec3::ZERO);
    avatar.binding = Binding::Face(FaceBinding {
        faces: (0..n as u32).collect(),
        barycentric: vec![[0.5, 0.3, 0.2]; n],
        offsets: vec![0.0; n],
    });
    avatar
}

/// Eq. 6 of a point of a face, with the weights that are linear on it.
fn carried(body: &PosedBody<'_>, face: usize, b: [f64; 3]) -> (DVec3, DVec3) {
    let corners = body.rest.faces[face];
    let point: DVec3 = (0..3).map(|k| body.rest.vertices[corners[k] as usize] * b[k]).sum();
    let mut sum = DVec3::ZERO;
    for k in 0..3 {
        let (joints, weights) = body.rest.weights.row(corners[k] as usize);
        for (&joint, &weight) in joints.iter().zip(weights) {
            let joint = &body.joints[usize::from(joint)];
            sum += (joint.linear * point + joint.translation) * (f64::from(weight) * b[k]);
        }
    }
    (point, sum)
}

fn factors(body: &PosedBody<'_>, id: &str) -> Vec<DMat3> {
    let bound = BoundAvatar::new(&probes(body.rest), body.rest).unwrap();
    let posed = pose(&bound, body, &Strategy::preset(id).unwrap()).unwrap();
    posed.factors.iter().map(|m| m.as_dmat3()).collect()
}

#[test]
fn on_faces_it_is_the_difference_of_posed_points() {
    let rest = rig::body();
    for bend in [0.4, 1.2, 2.0] {
        let at = rig::bent(&rest, 8, bend);
        let body = PosedBody::new(&rest, &at).unwrap();
        let (plain, kept) = (factors(&body, "push-forward"), factors(&body, "push-forward-normal"));
        for (face, (plain, kept)) in plain.iter().zip(&kept).enumerate() {
            let step = 1e-5;
            for towards in [[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]] {
                let at = |sign: f64| {
                    carried(
                        &body,
                        face,
                        [0, 1, 2].map(|k: usize| [0.5, 0.3, 0.2][k] + sign * step * towards[k]),
                    )
                };
                let ((from, start), (to, end)) = (at(-1.0), at(1.0));
                let (tangent, posed) = ((to - from) / (2.0 * step), (end - start) / (2.0 * step));
                for j in [plain, kept] {
                    let error = (*j * tangent - posed).length() / tangent.length();
                    assert!(error < 2e-4, "face {face} at {bend}: {error:e}");
                }
            }
            let [a, b, c] = rest.faces[face].map(|v| rest.vertices[v as usize]);
            let normal = (b - a).cross(c - a).normalize();
            let (first, second) = normal.any_orthonormal_pair();
            let posed = (*plain * first).cross(*plain * second);
            if posed.length() > 0.05 {
                let error = (*kept * normal - posed.normalize()).length();
                assert!(error < 2e-3, "face {face} at {bend}: normal off by {error:e}");
            }
        }
    }
}

/// A square of 80 cm across x, its weights linear along x between the first two joints.
fn sheet() -> RestBody {
    const SIDE: u32 = 5;
    let mut body = rig::body();
    let along = |k: u32| 0.2 * f64::from(k) - 0.4;
    let places = (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE));
    body.vertices = places.clone().map(|(x, y)| DVec3::new(along(x), along(y), 0.0)).collect();
    let corner = |x: u32, y: u32| y * SIDE + x;
    let cells = places.clone().filter(|&(x, y)| x + 1 < SIDE && y + 1 < SIDE);
    body.faces = cells
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)];
            [[a, b, c], [c, b, d]]
        })
        .collect();
    let rows = places.map(|(x, _)| 0.5 + along(x)).map(|w| [(0, (1.0 - w) as f32), (1, w as f32)]);
    body.weights = SkinWeights::from_rows(rows, rig::JOINTS).unwrap();
    body
}

/// R is the rotation nearest to J, of determinant +1.
#[test]
fn the_rotation_is_the_nearest_to_the_derivative() {
    use skinsplat_core::math::rotation;
    let rest = rig::smooth_body();
    let body = PosedBody::new(&rest, &rig::bent(&rest, 8, 1.2)).unwrap();
    let bound = BoundAvatar::new(&probes(&rest), &rest).unwrap();
    for id in ["push-forward", "push-forward-normal"] {
        let strategy = Strategy::preset(id).unwrap();
        let turned = Strategy { covariance: CovarianceChoice::Rotate, ..strategy };
        let (deformed, turned) =
            (pose(&bound, &body, &strategy).unwrap(), pose(&bound, &body, &turned).unwrap());
        for (i, (j, r)) in deformed.factors.iter().zip(&turned.factors).enumerate() {
            let rows = j.transpose().as_dmat3().to_cols_array_2d();
            let nearest = rotation::quaternion_to_matrix_raw(rotation::polar(rows).unwrap());
            let r = r.transpose().as_dmat3().to_cols_array_2d();
            let error = nearest.as_flattened().iter().zip(r.as_flattened());
            let error = error.fold(0.0f64, |worst, (a, b)| worst.max((a - b).abs()));
            assert!(error < 1e-4, "{id}, {i}: {error:e}");
        }
    }
}

/// A flat sheet between two joints, weights linear along it: least squares around a vertex is exact, and J has a closed form.
#[test]
fn around_vertices_it_is_exact_for_linear_weights() {
    let rest = sheet();
    let at = rig::bent(&rest, 3, 1.1);
    let body = PosedBody::new(&rest, &at).unwrap();
    let mut avatar = rig::on_vertices(&rest, rest.vertices.len(), 2);
    avatar.gaussians.means = rest.vertices.iter().map(|v| v.as_vec3()).collect();
    avatar.gaussians.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    avatar.gaussians.log_scales.fill(Vec3::ZERO);
    avatar.binding = Binding::Vertex(rest.weights.clone());
    let bound = BoundAvatar::new(&avatar, &rest).unwrap();
    let posed = pose(&bound, &body, &Strategy::preset("push-forward").unwrap()).unwrap();
    let [first, second] = [&body.joints[0], &body.joints[1]];
    for (x, factor) in rest.vertices.iter().zip(&posed.factors) {
        let w = 0.5 + x.x;
        let moved = |joint: &skinsplat_core::scene::JointTransform| joint.linear * *x + joint.translation;
        let apart = moved(second) - moved(first);
        let outer = DMat3::from_cols(apart, DVec3::ZERO, DVec3::ZERO);
        let expected = first.linear * (1.0 - w) + second.linear * w + outer;
        let error = (factor.as_dmat3() - expected).to_cols_array().iter().fold(0.0f64, |m, e| m.max(e.abs()));
        assert!(error < 2e-5, "{x}: {error:e}");
    }
}

/// The presets that read J, and every pair of one that does with a covariance or a rotation that does not.
fn strategies() -> Vec<Strategy> {
    let presets: Vec<Strategy> = PRESETS.iter().map(|p| p.strategy).filter(rig::pushes).collect();
    let mut all = presets.clone();
    for strategy in presets {
        all.extend(CovarianceChoice::ALL.map(|covariance| Strategy { covariance, ..strategy }));
        let lbs = RotationChoice::named().next().unwrap();
        all.push(Strategy { rotation: lbs, ..strategy });
    }
    all
}

/// Towards every kind of parameter, on a body whose weights change smoothly: where J is near a reflection its nearest rotation
/// jumps, and no difference says anything.
#[test]
fn adjoints_follow_the_mean_through_the_derivative() {
    let rest = rig::smooth_body();
    for (bend, scaled) in [(0.5, false), (1.0, false), (0.5, true)] {
        let at = rig::bent(&rest, 4, bend);
        let at = if scaled { rig::scaled(&at, 6) } else { at };
        let body = PosedBody::new(&rest, &at).unwrap();
        for (seed, strategy) in (0..).zip(strategies()) {
            for avatar in [rig::on_vertices(&rest, 80, seed), rig::on_faces(&rest, 80, seed)] {
                let case = Case::new(avatar, &body);
                let upstream = upstream(&pose(&case.bound, &body, &strategy).unwrap(), seed);
                for kind in kinds(matches!(case.avatar.binding, Binding::Face(_))) {
                    let (error, switching) = case.error(&strategy, &upstream, &kind);
                    assert!(error < 1e-3, "{strategy} at {bend}, {scaled}: {kind:?} is off by {error:e}");
                    assert!(switching * 7 <= case.bound.len(), "{strategy}: {kind:?}, {switching} switch");
                }
            }
        }
    }
}
