//! The normalised weighted sum of joint quaternions whose signs belong together ([`JointLift`]): no jump at 180°.
//!
//! Summed in `f64`: near 360° between joints the terms cancel.
//!
//! [`JointLift`]: super::super::JointLift

use super::super::lanes::{LANES, Lanes, identity, put, splat};
use super::BlockInput;
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
