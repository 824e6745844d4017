//! Dual-quaternion blending of a block.

use super::super::joints::Joints;
use super::super::layout::{LANES, Lanes};
use super::average::{put, splat};
use super::take;
use crate::math::dual_quaternion::{self, DualQuaternion};
use crate::math::rotation;

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
    let mut blended = Motions { real: splat(identity.real), dual: splat(identity.dual) };
    let (mut stack, mut heap) = ([identity; STACK], Vec::new());
    let motions = indices.iter().map(|&joint| joints.motion[usize::from(joint)]);
    let motions: &[_] = if indices.len() <= STACK {
        stack.iter_mut().zip(motions).for_each(|(slot, motion)| *slot = motion);
        &stack[..indices.len()]
    } else {
        heap.extend(motions);
        &heap
    };
    let mut own = vec![0.0; indices.len()];
    for lane in 0..LANES {
        own.iter_mut().zip(weights).for_each(|(own, weight)| *own = weight[lane]);
        if let Some(motion) = dual_quaternion::blend(motions, &own) {
            put(&mut blended.real, lane, motion.real);
            put(&mut blended.dual, lane, motion.dual);
        }
    }
    blended
}
