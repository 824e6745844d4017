//! The normalised weighted sum of joint quaternions whose signs belong together ([`JointLift`]): no jump at 180°.
//!
//! Summed in `f64`: near 360° between joints the terms cancel.
//!
//! [`JointLift`]: super::super::JointLift

use super::super::lanes::{LANES, Lanes, identity, put, splat};
use super::BlockInput;
use skinsplat_core::math::rotation::adjoint;
use skinsplat_core::math::{Quaternion, dot4};

/// A sum shorter than this share of the total weight has no direction: joints of equal weight exactly 360° apart on
/// their way. The quaternion average takes its place.
const CANCELLED: f64 = 1e-12;

/// Σ w q of each lane, made a unit quaternion.
#[inline(never)]
pub(super) fn summed(joints: &[Quaternion<f64>], input: &BlockInput<'_>) -> [Lanes; 4] {
    let (indices, weights) = input.chunk.influences(input.block);
    if let &[joint] = indices {
        return splat(joints[usize::from(joint)].map(|c| c as f32));
    }
    let mut sum = [[0.0f64; LANES]; 4];
    let mut total = [0.0f64; LANES];
    for (&joint, weights) in indices.iter().zip(weights) {
        let q = joints[usize::from(joint)];
        for lane in 0..LANES {
            let weight = f64::from(weights[lane]);
            total[lane] += weight;
            (0..4).for_each(|k| sum[k][lane] += weight * q[k]);
        }
    }
    let mut relative = identity();
    for lane in 0..LANES {
        let q = [sum[0][lane], sum[1][lane], sum[2][lane], sum[3][lane]];
        let length = dot4(q, q).sqrt();
        let unit = if length > CANCELLED * total[lane] {
            q.map(|c| (c / length) as f32)
        } else {
            input.average_of(lane)
        };
        put(&mut relative, lane, unit);
    }
    relative
}

/// [`summed`] walked backwards, of one lane: calls `add` with the position of each influence and the derivative with respect to a further rotation
/// of it, from that with respect to one of the sum. Which signs belong together is a constant.
pub(crate) fn adjoint(
    joints: &[Quaternion<f64>],
    (indices, weights): (&[u16], &[Lanes]),
    lane: usize,
    torque: [f64; 3],
    mut add: impl FnMut(usize, [f64; 3]),
) {
    let (mut sum, mut total) = ([0.0; 4], 0.0);
    for (&joint, weights) in indices.iter().zip(weights) {
        let (q, weight) = (joints[usize::from(joint)], f64::from(weights[lane]));
        total += weight;
        (0..4).for_each(|k| sum[k] += weight * q[k]);
    }
    let length = dot4(sum, sum).sqrt();
    if length <= CANCELLED * total {
        return;
    }
    let of_unit = adjoint::from_torque(sum.map(|c| c / length), torque);
    for (influence, (&joint, weights)) in indices.iter().zip(weights).enumerate() {
        let share = f64::from(weights[lane]) / length;
        add(influence, adjoint::to_torque(joints[usize::from(joint)], of_unit.map(|c| share * c)));
    }
}
