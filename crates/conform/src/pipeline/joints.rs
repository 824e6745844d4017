//! Forward kinematics: from the angles of a pose to the motion of each joint relative to the rest pose.

use super::super::rig::{Rig, RigPose, wxyz};
use super::super::wiring::{Angles, Bind, Frames, JointMatrices, Translation, Wiring};
use super::Pipeline;
use glam::{DQuat, DVec3};
use skinsplat_core::math::rotation::{conjugate, multiply};
use skinsplat_core::math::{Matrix3, matrix3, portable, rotation};

/// The motion of every joint in one pose.
#[derive(Clone, Debug)]
pub(crate) struct JointState {
    /// What means are multiplied by.
    pub(crate) linear: Vec<Matrix3<f64>>,
    /// What is added to them, metres.
    pub(crate) translation: Vec<[f64; 3]>,
    /// The joint's rotation (w, x, y, z), with the sign that engines are handed.
    pub(crate) quaternion: Vec<[f64; 4]>,
    /// World position and rotation of the joint itself, without the bind pose.
    pub(crate) world: Vec<(Matrix3<f64>, [f64; 3])>,
    /// The same rotations, their signs those of the product along the chain.
    pub(crate) chained: Vec<[f64; 4]>,
}

impl JointState {
    /// Of a pose of the rig.
    pub(crate) fn new(pipeline: &Pipeline<'_>, wiring: &Wiring, frame: usize) -> Self {
        let (pose, number) = pose_of(pipeline.rig, wiring.frames, frame);
        let mut state = kinematics(pipeline, &pose, wiring);
        for (joint, q) in state.quaternion.iter_mut().enumerate() {
            let sign = Rig::sign(number, joint);
            *q = pipeline.read(wiring.joint_quaternions, q.map(|c| c * sign));
        }
        twist(&mut state, wiring.joint_matrices);
        state
    }
}

/// The pose that is drawn when `frame` is asked for.
fn pose_of(rig: &Rig, frames: Frames, frame: usize) -> (RigPose, usize) {
    let of = |k: usize| (rig.poses[k].clone(), k);
    let last = rig.poses.len() - 1;
    let late = |first: usize| of(frame.checked_sub(1).unwrap_or(first));
    match frames {
        Frames::Own => of(frame),
        Frames::LateHeld => late(0),
        Frames::LateAround => late(last),
        Frames::LateFromRest if frame > 0 => of(frame - 1),
        Frames::LateFromRest => {
            let joints = rig.body.skeleton.num_joints();
            (RigPose { axis_angles: vec![DVec3::ZERO; joints], translation: DVec3::ZERO }, 0)
        }
        Frames::EarlyHeld => of(usize::min(frame + 1, last)),
        Frames::EarlyAround => of((frame + 1) % (last + 1)),
    }
}

fn kinematics(pipeline: &Pipeline<'_>, pose: &RigPose, wiring: &Wiring) -> JointState {
    let factor = match wiring.angles {
        Angles::Radians => 1.0,
        Angles::TakenForDegrees => std::f64::consts::PI / 180.0,
        Angles::HandedInDegrees => 180.0 / std::f64::consts::PI,
    };
    let skeleton = &pipeline.rig.body.skeleton;
    let count = skeleton.num_joints();
    let mut turned = vec![DQuat::IDENTITY; count];
    let mut chained = vec![DQuat::IDENTITY; count];
    let mut position = vec![DVec3::ZERO; count];
    // Parents come before children in this rig.
    for joint in 0..count {
        let local = portable::from_scaled_axis(pose.axis_angles[joint] * factor);
        let [w, x, y, z] = pipeline.read(wiring.locals, wxyz(local));
        let local = DQuat::from_xyzw(x, y, z, w);
        let offset = skeleton.rest_locals[joint].translation;
        (turned[joint], position[joint]) = match skeleton.parents[joint] {
            None => (local, offset),
            Some(parent) if wiring.chain_is_reversed => {
                (local * turned[parent], local * position[parent] + offset)
            }
            Some(parent) => (turned[parent] * local, position[parent] + turned[parent] * offset),
        };
        chained[joint] = turned[joint];
        turned[joint] = turned[joint].normalize();
    }
    let rows = |q: DQuat| rotation::quaternion_to_matrix(wxyz(q));
    let rest = |joint: usize| -skeleton.inverse_binds[joint].translation;
    let translation = |joint: usize| {
        let from_rest = match wiring.bind {
            Bind::Right => turned[joint] * rest(joint),
            Bind::Missing => DVec3::ZERO,
            Bind::OtherSide => rest(joint),
        };
        let moved = match wiring.translation {
            Translation::Right => pose.translation,
            Translation::Missing => DVec3::ZERO,
            Translation::Before => turned[joint] * pose.translation,
        };
        (position[joint] - from_rest + moved).to_array()
    };
    JointState {
        linear: turned.iter().map(|&q| rows(q)).collect(),
        translation: (0..count).map(translation).collect(),
        quaternion: turned.iter().map(|&q| wxyz(q)).collect(),
        world: (0..count).map(|j| (rows(turned[j]), (position[j] + pose.translation).to_array())).collect(),
        chained: chained.iter().map(|&q| wxyz(q)).collect(),
    }
}

/// What transposed matrices do.
fn twist(state: &mut JointState, matrices: JointMatrices) {
    if matrices == JointMatrices::Right {
        return;
    }
    for linear in &mut state.linear {
        *linear = matrix3::transpose(*linear);
    }
    if matches!(matrices, JointMatrices::Transposed4 | JointMatrices::Transposed4MeansOnly) {
        state.translation.iter_mut().for_each(|t| *t = [0.0; 3]);
    }
    if matches!(matrices, JointMatrices::Transposed3 | JointMatrices::Transposed4) {
        for q in state.quaternion.iter_mut().chain(&mut state.chained) {
            *q = conjugate(*q);
        }
    }
}

/// R(q) x.
pub(super) fn rotate(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = multiply(multiply(q, [0.0, x, y, z]), conjugate(q));
    [x, y, z]
}
