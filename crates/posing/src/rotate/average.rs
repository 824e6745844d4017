//! Eq. 7 on a block: the average of the joints' rotations with the skinning weights.
//!
//! One joint is its own average; two have a closed form that reads nothing but their inner product, which the block
//! shares; three or more come from the blend that moves the means. A lane too close to a tie for `f32` is decided in
//! `f64` by [`average_rotation`]. The heaviest joint alone and the normalised sum are vector code as well; other solvers
//! run one Gaussian at a time, in `f64`.

use super::super::blend::{self, Blend};
use super::super::joints::Joints;
use super::super::lanes::{LANES, Lanes, identity, put, splat};
use skinsplat_core::math::average::{Solver, Start, average_rotation, average_rotation_adjoint, lanes};
use skinsplat_core::math::{Quaternion, rotation};

/// Below this gap of the eigenvalues (over their sum) two joints are decided in `f64`.
const PAIR_GAP: f32 = 1e-4;

/// The average of each lane as a unit quaternion of either sign.
#[inline(always)]
pub(super) fn average(
    arch: pulp::Arch,
    joints: &Joints,
    indices: &[u16],
    weights: &[Lanes],
    blend: &Blend,
    solver: Solver,
) -> [Lanes; 4] {
    match (indices, solver) {
        ([], _) => identity(),
        (&[joint], _) => splat(joints.rotation[usize::from(joint)]),
        (&[a, b], Solver::ClosedForm) => {
            let (mut average, settled) = pair(joints, [a, b], [&weights[0], &weights[1]]);
            settle(joints, indices, weights, &settled, &mut average);
            average
        }
        (_, Solver::ClosedForm) => {
            let blended;
            let rotations = match &joints.rotation_matrix {
                None => &blend.linear,
                Some(matrices) => {
                    blended = blend::rotations(matrices, indices, weights);
                    &blended
                }
            };
            let lanes::Lanes { mut quats, settled } = dominant(arch, rotations, &blend.weight);
            settle(joints, indices, weights, &settled, &mut quats);
            quats
        }
        (_, Solver::Power { steps: 0, start: Start::Heaviest }) => heaviest(joints, indices, weights),
        (_, Solver::Nlerp) => normalised_sum(joints, indices, weights)
            .unwrap_or_else(|| one_by_one(joints, indices, weights, solver)),
        _ => one_by_one(joints, indices, weights, solver),
    }
}

/// The rotation of the heaviest joint of each lane, the first of equals: power iteration that has not begun.
#[inline(always)]
fn heaviest(joints: &Joints, indices: &[u16], weights: &[Lanes]) -> [Lanes; 4] {
    let mut quats = splat(joints.rotation[usize::from(indices[0])]);
    let mut largest = weights[0];
    for (&joint, weight) in indices.iter().zip(weights).skip(1) {
        // A loop per component: the compiler makes a vector select of each.
        let heavier: [bool; LANES] = std::array::from_fn(|lane| weight[lane] > largest[lane]);
        for (quats, own) in quats.iter_mut().zip(joints.rotation[usize::from(joint)]) {
            for lane in 0..LANES {
                quats[lane] = if heavier[lane] { own } else { quats[lane] };
            }
        }
        for lane in 0..LANES {
            largest[lane] = largest[lane].max(weight[lane]);
        }
    }
    quats
}

/// A cosine of quaternions below which `f32` might not know its sign.
const SURE_COSINE: f32 = 1e-5;

/// [`Solver::Nlerp`], a block at a time; `None` if a side cannot be told in `f32`.
#[inline(always)]
fn normalised_sum(joints: &Joints, indices: &[u16], weights: &[Lanes]) -> Option<[Lanes; 4]> {
    let reference = heaviest(joints, indices, weights);
    let (mut sum, mut least) = ([[0.0; LANES]; 4], [1.0_f32; LANES]);
    for (&joint, weight) in indices.iter().zip(weights) {
        let [w, x, y, z] = joints.rotation[usize::from(joint)];
        for lane in 0..LANES {
            let cosine = (w * reference[0][lane] + x * reference[1][lane])
                + (y * reference[2][lane] + z * reference[3][lane]);
            least[lane] = least[lane].min(cosine.abs());
            let weight = weight[lane].copysign(cosine);
            sum[0][lane] += weight * w;
            sum[1][lane] += weight * x;
            sum[2][lane] += weight * y;
            sum[3][lane] += weight * z;
        }
    }
    for lane in 0..LANES {
        let [w, x, y, z] = [sum[0][lane], sum[1][lane], sum[2][lane], sum[3][lane]];
        let inverse = 1.0 / ((w * w + x * x) + (y * y + z * z)).sqrt();
        for k in 0..4 {
            sum[k][lane] *= inverse;
        }
    }
    least.iter().all(|&cosine| cosine > SURE_COSINE).then_some(sum)
}

/// Three joints or more. A function of its own, small enough for the compiler to inline all that is in it.
#[inline(never)]
pub(super) fn dominant(arch: pulp::Arch, rotations: &[Lanes; 9], weight: &Lanes) -> lanes::Lanes<LANES> {
    arch.dispatch(Dominant { rotations, weight })
}

struct Dominant<'a> {
    rotations: &'a [Lanes; 9],
    weight: &'a Lanes,
}

impl pulp::NullaryFnOnce for Dominant<'_> {
    type Output = lanes::Lanes<LANES>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        lanes::from_blends(self.rotations, self.weight)
    }
}

/// Any solver.
#[inline(never)]
fn one_by_one(joints: &Joints, indices: &[u16], weights: &[Lanes], solver: Solver) -> [Lanes; 4] {
    let mut average = identity();
    for lane in 0..LANES {
        put(&mut average, lane, of_lane(joints, indices, weights, lane, solver));
    }
    average
}

/// Two joints p, q with weights u, v, as [`skinsplat_core::math::average::two_bones`]: `(ρ + c)(p + q) + κ (1 + c)(p − q)` with
/// c = |p·q|, κ = (u − v)/(u + v), ρ = √(c² + κ²(1 − c²)) the gap. c is computed in `f64`, nothing after it cancels.
#[inline(always)]
fn pair(joints: &Joints, [a, b]: [u16; 2], [u, v]: [&Lanes; 2]) -> ([Lanes; 4], [bool; LANES]) {
    let [a, b] = [usize::from(a), usize::from(b)];
    let cosine: f64 = joints.rotation_f64[a].iter().zip(&joints.rotation_f64[b]).map(|(x, y)| x * y).sum();
    let c = cosine.abs().min(1.0);
    let sine2 = ((1.0 - c) * (1.0 + c)) as f32;
    let (c, sign) = (c as f32, 1.0f32.copysign(cosine as f32));
    let (p, [w, x, y, z]) = (joints.rotation[a], joints.rotation[b]);
    let q = [w * sign, x * sign, y * sign, z * sign];
    let (mut average, mut settled) = ([[0.0; LANES]; 4], [false; LANES]);
    for lane in 0..LANES {
        let kappa = (u[lane] - v[lane]) / (u[lane] + v[lane]);
        let gap = (c * c + kappa * kappa * sine2).sqrt();
        let (even, odd) = (gap + c, kappa * (1.0 + c));
        let (of_p, of_q) = (even + odd, even - odd);
        let (w, x) = (of_p * p[0] + of_q * q[0], of_p * p[1] + of_q * q[1]);
        let (y, z) = (of_p * p[2] + of_q * q[2], of_p * p[3] + of_q * q[3]);
        let inverse = 1.0 / ((w * w + x * x) + (y * y + z * z)).sqrt();
        settled[lane] = gap > PAIR_GAP;
        average[0][lane] = w * inverse;
        average[1][lane] = x * inverse;
        average[2][lane] = y * inverse;
        average[3][lane] = z * inverse;
    }
    (average, settled)
}

/// Decides the lanes that are not settled in `f64`.
#[inline(always)]
fn settle(
    joints: &Joints,
    indices: &[u16],
    weights: &[Lanes],
    settled: &[bool; LANES],
    average: &mut [Lanes; 4],
) {
    if settled.iter().all(|&s| s) {
        return;
    }
    for lane in 0..LANES {
        if !settled[lane] {
            put(average, lane, of_lane(joints, indices, weights, lane, Solver::ClosedForm));
        }
    }
}

/// The average of one lane, computed in `f64`.
#[inline(never)]
pub(super) fn of_lane(
    joints: &Joints,
    indices: &[u16],
    weights: &[Lanes],
    lane: usize,
    solver: Solver,
) -> Quaternion<f32> {
    let bone =
        |(&joint, weight): (&u16, &Lanes)| (joints.rotation_f64[usize::from(joint)], f64::from(weight[lane]));
    let average = with_bones(indices.iter().zip(weights).map(bone), |quats, weights| {
        average_rotation(quats, weights, solver)
    });
    average.unwrap_or_else(rotation::identity).map(|c| c as f32)
}

/// [`of_lane`] walked backwards, whatever the solver: calls `add` with the position of each bone and the derivative with respect
/// to a further rotation of it, from that with respect to one of the average.
pub(crate) fn adjoint(
    bones: impl ExactSizeIterator<Item = (Quaternion<f64>, f64)>,
    solver: Solver,
    torque: [f64; 3],
    mut add: impl FnMut(usize, [f64; 3]),
) {
    with_bones(bones, |quats, weights| {
        let Some(average) = average_rotation(quats, weights, solver) else { return };
        let upstream = rotation::adjoint::from_torque(average, torque);
        average_rotation_adjoint(quats, weights, solver, upstream, |bone, own| {
            add(bone, rotation::adjoint::to_torque(quats[bone], own));
        });
    });
}

/// Calls `f` with quaternions and weights as slices, on the stack for any usual number of joints.
pub(super) fn with_bones<R>(
    bones: impl ExactSizeIterator<Item = (Quaternion<f64>, f64)>,
    f: impl FnOnce(&[Quaternion<f64>], &[f64]) -> R,
) -> R {
    const STACK: usize = 16;
    let n = bones.len();
    if n > STACK {
        let (quats, weights): (Vec<_>, Vec<_>) = bones.unzip();
        return f(&quats, &weights);
    }
    let (mut quats, mut weights) = ([[0.0; 4]; STACK], [0.0; STACK]);
    for (k, (quat, weight)) in bones.enumerate() {
        (quats[k], weights[k]) = (quat, weight);
    }
    f(&quats[..n], &weights[..n])
}
