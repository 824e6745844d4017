//! Quaternions of the joints with signs that belong together: what a continuous blend is summed from.
//!
//! A rotation has two quaternions, q and −q. The average of Eq. 7 does not care which, and pays for it: where the
//! relative angle of two equally weighted bones passes 180° its answer jumps by 180°. No function of rotations alone can
//! avoid that (turned once around, the bones are where they were, and their midpoint is on the other side), so a blend
//! that does not jump has to remember which way the joints came. Here a joint's quaternion is the product, down the
//! chain, of quaternions relative to the parent joint, each on the side of a reference: the rest pose (no memory: the
//! blend is continuous while every joint stays within 180° of its parent's rest frame, however far the chain turns) or
//! the frame before (continuous through any motion of less than 180° per joint and frame).

use skinsplat_core::math::{Quaternion, rotation};
use skinsplat_core::scene::PosedBody;

/// Joint quaternions of one pose, relative to the rest pose, with signs that belong together.
///
/// Only signs relative to each other mean anything: turning the world changes none of them.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLift {
    /// Relative to the parent joint (the first root for further roots; the world for that): what the next frame follows.
    relative: Vec<Quaternion<f64>>,
    /// World from rest.
    lifted: Vec<Quaternion<f64>>,
}

impl JointLift {
    /// Each joint within 180° of its parent's rest frame: stateless.
    pub fn from_rest(body: &PosedBody<'_>) -> Self {
        Self::near(body, |_| rotation::identity())
    }

    /// Each joint with w of 0 or more, whatever its parent's sign: what sums without alignment blend. Signs do not belong
    /// together where joints are turned by more than 180° against each other.
    pub(crate) fn with_positive_w(body: &PosedBody<'_>) -> Self {
        let of = |q: glam::DQuat| [q.w, q.x, q.y, q.z];
        let positive = |q: Quaternion<f64>| rotation::SignPolicy::NonNegativeW.apply(q, q);
        let own: Vec<_> = body.joints.iter().map(|joint| positive(of(joint.rotation))).collect();
        Self { relative: own.clone(), lifted: own }
    }

    /// The frame after `previous`, or the first one.
    pub fn next(previous: Option<&Self>, body: &PosedBody<'_>) -> Self {
        previous.map_or_else(|| Self::from_rest(body), |previous| previous.following(body))
    }

    /// Each joint on the side on which it was in the frame before. A frame of a body with another number of joints
    /// starts from rest.
    pub fn following(&self, body: &PosedBody<'_>) -> Self {
        if self.relative.len() != body.joints.len() {
            return Self::from_rest(body);
        }
        Self::near(body, |joint| self.relative[joint])
    }

    /// The quaternion of each joint: w, x, y, z, of unit length.
    pub fn quaternions(&self) -> &[Quaternion<f64>] {
        &self.lifted
    }

    fn near(body: &PosedBody<'_>, reference: impl Fn(usize) -> Quaternion<f64>) -> Self {
        let own: Vec<Quaternion<f64>> = body
            .joints
            .iter()
            .map(|joint| [joint.rotation.w, joint.rotation.x, joint.rotation.y, joint.rotation.z])
            .collect();
        let parents = joint_parents(body);
        let mut lift = Self { relative: own.clone(), lifted: own.clone() };
        let mut done = vec![false; own.len()];
        let mut path = Vec::new();
        for joint in 0..own.len() {
            path.push(joint);
            while let Some(&joint) = path.last() {
                match parents[joint].filter(|_| !done[joint]) {
                    Some(parent) if !done[parent] => path.push(parent),
                    parent => {
                        path.pop();
                        if !std::mem::replace(&mut done[joint], true) {
                            lift.place(joint, parent, own[joint], reference(joint));
                        }
                    }
                }
            }
        }
        lift
    }

    fn place(&mut self, joint: usize, parent: Option<usize>, own: Quaternion<f64>, near: Quaternion<f64>) {
        let Some(parent) = parent else {
            (self.relative[joint], self.lifted[joint]) = (own, own);
            return;
        };
        let of_parent = self.lifted[parent];
        let relative = rotation::multiply(rotation::conjugate(of_parent), own);
        let sign = if rotation::is_opposite(relative, near) { -1.0 } else { 1.0 };
        self.relative[joint] = relative.map(|c| c * sign);
        self.lifted[joint] = own.map(|c| c * sign);
    }
}

/// The nearest deforming ancestor of each joint, the first root for other roots.
fn joint_parents(body: &PosedBody<'_>) -> Vec<Option<usize>> {
    let (skeleton, count) = (&body.rest.skeleton, body.joints.len());
    let above = |joint: usize| {
        let mut node = skeleton.parents[joint];
        while let Some(ancestor) = node.filter(|&n| n >= count) {
            node = skeleton.parents[ancestor];
        }
        node
    };
    let mut parents: Vec<Option<usize>> = (0..count).map(above).collect();
    let first = parents.iter().position(Option::is_none);
    for (joint, parent) in parents.iter_mut().enumerate() {
        if parent.is_none() {
            *parent = first.filter(|&root| root != joint);
        }
    }
    parents
}
