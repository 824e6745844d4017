//! Dual-quaternion blending of a block.

use super::super::joints::Joints;
use super::super::lanes::{LANES, Lanes, identity, put, splat, take};
use skinsplat_core::math::dual_quaternion::{self, DualQuaternion};
use skinsplat_core::math::rotation;

/// A unit dual quaternion per lane.
pub(super) struct Motions {
    pub(super) real: [Lanes; 4],
    dual: [Lanes; 4],
}

impl Motions {
    /// R x + t.
    #[inline(always)]
    pub(super) fn transform(&self, x: &[Lanes; 3]) -> [Lanes; 3] {
        let mut moved = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let motion = DualQuaternion { real: take(&self.real, lane), dual: take(&self.dual, lane) };
            let point = motion.transform([x[0][lane], x[1][lane], x[2][lane]]);
            for axis in 0..3 {
                moved[axis][lane] = point[axis];
            }
        }
        moved
    }
}

/// Blends the motions of a block's joints. See [`dual_quaternion::blend`].
#[inline(never)]
pub(super) fn blend(joints: &Joints, indices: &[u16], weights: &[Lanes]) -> Motions {
    const STACK: usize = 16;
    let identity = DualQuaternion::new(rotation::identity(), [0.0; 3]);
    if indices.len() <= STACK {
        let (mut motions, mut own) = ([identity; STACK], [0.0; STACK]);
        return lane_by_lane(
            joints,
            indices,
            weights,
            &mut motions[..indices.len()],
            &mut own[..indices.len()],
        );
    }
    lane_by_lane(joints, indices, weights, &mut vec![identity; indices.len()], &mut vec![0.0; indices.len()])
}

fn lane_by_lane(
    joints: &Joints,
    indices: &[u16],
    weights: &[Lanes],
    motions: &mut [DualQuaternion<f32>],
    own: &mut [f32],
) -> Motions {
    for (motion, &joint) in motions.iter_mut().zip(indices) {
        *motion = joints.motion[usize::from(joint)];
    }
    let mut blended = Motions { real: identity(), dual: splat([0.0; 4]) };
    for lane in 0..LANES {
        own.iter_mut().zip(weights).for_each(|(own, weight)| *own = weight[lane]);
        if let Some(motion) = dual_quaternion::blend(motions, own) {
            put(&mut blended.real, lane, motion.real);
            put(&mut blended.dual, lane, motion.dual);
        }
    }
    blended
}
