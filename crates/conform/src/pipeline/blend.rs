//! From the joints of a Gaussian to one rotation and one position.

use super::super::wiring::{Blend, Conversion, From, GramSchmidt, Of, Signs, Unit, Wiring};
use super::{Blended, JointState, Pipeline};
use skinsplat_core::math::average::{self, Solver, Start};
use skinsplat_core::math::dual_quaternion::DualQuaternion;
use skinsplat_core::math::rotation::{SignPolicy, conjugate, multiply, normalize};
use skinsplat_core::math::{Matrix3, dot4, matrix3, rotation};

/// The blend of the joints of a Gaussian at `mean`; `weights` are its (joint, weight) pairs, the heaviest first.
pub(super) fn blended(
    pipeline: &Pipeline<'_>,
    wiring: &Wiring,
    joints: &JointState,
    weights: &[(usize, f64)],
    mean: [f64; 3],
    canonical: [f64; 4],
) -> Blended {
    let quats: Vec<[f64; 4]> = weights.iter().map(|(joint, _)| joints.quaternion[*joint]).collect();
    let mut matrix = [[0.0; 3]; 3];
    let mut position = [0.0; 3];
    for (&(joint, weight), &quat) in weights.iter().zip(&quats) {
        let r = rotation::quaternion_to_matrix(quat);
        let moved =
            matrix3::add_scaled(matrix3::apply(joints.linear[joint], mean), 1.0, joints.translation[joint]);
        for row in 0..3 {
            position[row] += weight * moved[row];
            for column in 0..3 {
                matrix[row][column] += weight * r[row][column];
            }
        }
    }
    let mut blended = Blended { relative: rotation::identity(), posed: None, matrix, mean: position };
    let only: Vec<f64> = weights.iter().map(|(_, weight)| *weight).collect();
    match wiring.blend {
        Blend::Average if wiring.unit == Unit::Normalised => {
            blended.relative = exact(&quats, &only);
        }
        Blend::Average => blended.relative = sum(pipeline, joints, weights, &quats, Signs::Heaviest),
        Blend::Power(steps, from) => {
            let start = match from {
                From::Heaviest => Start::Heaviest,
                From::Ones => Start::Ones,
                From::Identity => Start::Identity,
            };
            blended.relative = averaged(&quats, &only, Solver::Power { steps, start });
        }
        Blend::Sum(signs) => {
            let sum = sum(pipeline, joints, weights, &quats, signs);
            let unit = wiring.unit == Unit::Normalised;
            blended.relative = if unit { normalize(sum).unwrap_or(rotation::identity()) } else { sum };
        }
        Blend::Dual(signs) => {
            let signed = signed(pipeline, joints, weights, &quats, signs);
            dual(joints, weights, &signed, mean, &mut blended);
        }
        Blend::GramSchmidt(way) => projected(way.of, canonical, &mut blended, |m| {
            gram_schmidt(way, m).map_or(rotation::identity(), rotation::matrix_to_quaternion)
        }),
        Blend::Converted(conversion, of) => projected(of, canonical, &mut blended, |m| {
            let raw = converted(conversion, &m);
            let unit = wiring.unit == Unit::Normalised;
            if unit { normalize(raw).unwrap_or(rotation::identity()) } else { raw }
        }),
    }
    blended
}

fn averaged(quats: &[[f64; 4]], weights: &[f64], solver: Solver) -> [f64; 4] {
    average::average_rotation(quats, weights, solver).unwrap_or(rotation::identity())
}

/// Eq. 7.
fn exact(quats: &[[f64; 4]], weights: &[f64]) -> [f64; 4] {
    averaged(quats, weights, Solver::Eigen)
}

/// Σ w q with signs, not normalised.
fn sum(
    pipeline: &Pipeline<'_>,
    joints: &JointState,
    weights: &[(usize, f64)],
    quats: &[[f64; 4]],
    signs: Signs,
) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for (q, (_, weight)) in signed(pipeline, joints, weights, quats, signs).iter().zip(weights) {
        (0..4).for_each(|k| sum[k] += weight * q[k]);
    }
    sum
}

/// The quaternions with the signs that they are summed with.
fn signed(
    pipeline: &Pipeline<'_>,
    joints: &JointState,
    weights: &[(usize, f64)],
    quats: &[[f64; 4]],
    signs: Signs,
) -> Vec<[f64; 4]> {
    let aligned = |q: [f64; 4], reference: [f64; 4]| SignPolicy::AlignToFirst.apply(q, reference);
    match signs {
        // The heaviest bone is the first that is stored.
        Signs::Heaviest => quats.iter().map(|&q| aligned(q, quats[0])).collect(),
        Signs::Given => quats.to_vec(),
        Signs::NonNegativeW => quats.iter().map(|&q| SignPolicy::NonNegativeW.apply(q, q)).collect(),
        Signs::LargestPositive(space) => {
            let axes = pipeline.space(space);
            let positive = |q: [f64; 4]| SignPolicy::LargestPositive.apply(q, q);
            quats.iter().map(|&q| axes.rotation_back(positive(axes.rotation(q)))).collect()
        }
        Signs::FromMatrices(space) => {
            let axes = pipeline.space(space);
            quats.iter().map(|&q| axes.rotation_back(from_matrix_signs(axes.rotation(q)))).collect()
        }
        Signs::Chained => weights.iter().map(|(joint, _)| joints.chained[*joint]).collect(),
        Signs::Running => {
            let mut so_far = [0.0; 4];
            let mut next = |(&q, (_, weight)): (&[f64; 4], &(usize, f64))| {
                let q = if dot4(q, so_far) < 0.0 { q.map(|c| -c) } else { q };
                (0..4).for_each(|k| so_far[k] += weight * q[k]);
                q
            };
            quats.iter().zip(weights).map(&mut next).collect()
        }
    }
}

/// The sign that [`trace_first`] gives a unit quaternion: w positive where the trace 4 w² - 1 is, else the largest of the others.
fn from_matrix_signs(q: [f64; 4]) -> [f64; 4] {
    let [w, x, y, z] = q;
    let pivot = if 4.0 * w * w > 1.0 {
        w
    } else if x.abs() > y.abs() && x.abs() > z.abs() {
        x
    } else if y.abs() > z.abs() {
        y
    } else {
        z
    };
    if pivot < 0.0 { q.map(|c| -c) } else { q }
}

/// Dual-quaternion blending, of the position too.
fn dual(
    joints: &JointState,
    weights: &[(usize, f64)],
    signed: &[[f64; 4]],
    mean: [f64; 3],
    blended: &mut Blended,
) {
    let (mut real, mut dual) = ([0.0; 4], [0.0; 4]);
    for (&q, &(joint, weight)) in signed.iter().zip(weights) {
        let motion = DualQuaternion::new(q, joints.translation[joint]);
        for k in 0..4 {
            real[k] += weight * motion.real[k];
            dual[k] += weight * motion.dual[k];
        }
    }
    let length = dot4(real, real).sqrt();
    let unit = normalize(real).unwrap_or(rotation::identity());
    let [_, x, y, z] = multiply(dual.map(|c| 2.0 * c / length), conjugate(unit));
    blended.relative = unit;
    blended.mean = matrix3::add_scaled(super::joints::rotate(unit, mean), 1.0, [x, y, z]);
}

/// A rotation read from the blended matrix, or from its product with the canonical rotation.
fn projected(of: Of, canonical: [f64; 4], blended: &mut Blended, read: impl Fn(Matrix3<f64>) -> [f64; 4]) {
    match of {
        Of::Blend => blended.relative = read(blended.matrix),
        Of::Product => {
            let product = matrix3::multiply(blended.matrix, rotation::quaternion_to_matrix(canonical));
            let posed = read(product);
            blended.posed = Some(posed);
            blended.relative = multiply(posed, conjugate(canonical));
        }
    }
}

/// Orthonormal in the order of its axes: the first keeps its direction, the second its half-plane, the third follows.
fn gram_schmidt(way: GramSchmidt, m: Matrix3<f64>) -> Option<Matrix3<f64>> {
    let rows = if way.rows { m } else { matrix3::transpose(m) };
    let third = 3 - way.first - way.second;
    let [a, b, c] = rotation::gram_schmidt_rows([rows[way.first], rows[way.second], rows[third]])?;
    let even = (way.first + 1) % 3 == way.second;
    let mut made = [[0.0; 3]; 3];
    (made[way.first], made[way.second]) = (a, b);
    made[third] = if even { c } else { c.map(|v| -v) };
    Some(if way.rows { made } else { matrix3::transpose(made) })
}

fn converted(conversion: Conversion, m: &Matrix3<f64>) -> [f64; 4] {
    match conversion {
        Conversion::Largest => rotation::matrix_to_quaternion_raw(*m),
        Conversion::TraceFirst => trace_first(m),
        Conversion::FourRoots => four_roots(m),
    }
}

/// Shepperd's branches with w first: through w where the trace is positive, else through the largest diagonal entry.
fn trace_first(m: &Matrix3<f64>) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    if trace > 0.0 {
        let s = (trace + 1.0).sqrt() * 2.0;
        return [s / 4.0, (m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s];
    }
    let i = if m[0][0] > m[1][1] && m[0][0] > m[2][2] {
        0
    } else if m[1][1] > m[2][2] {
        1
    } else {
        2
    };
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    let s = (1.0 + m[i][i] - m[j][j] - m[k][k]).max(1e-12).sqrt() * 2.0;
    let mut q = [0.0; 4];
    q[0] = (m[k][j] - m[j][k]) / s;
    q[1 + i] = s / 4.0;
    q[1 + j] = (m[j][i] + m[i][j]) / s;
    q[1 + k] = (m[k][i] + m[i][k]) / s;
    q
}

/// Every component by a square root of its own, signs from the off-diagonal differences.
fn four_roots(m: &Matrix3<f64>) -> [f64; 4] {
    let root = |v: f64| v.max(0.0).sqrt() / 2.0;
    [
        root(1.0 + m[0][0] + m[1][1] + m[2][2]),
        root(1.0 + m[0][0] - m[1][1] - m[2][2]).copysign(m[2][1] - m[1][2]),
        root(1.0 - m[0][0] + m[1][1] - m[2][2]).copysign(m[0][2] - m[2][0]),
        root(1.0 - m[0][0] - m[1][1] + m[2][2]).copysign(m[1][0] - m[0][1]),
    ]
}
