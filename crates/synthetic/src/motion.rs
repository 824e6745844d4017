//! Motions: smooth functions of time that give a pose per frame.

use super::parameters::Motion;
use glam::{DQuat, DVec3};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Pose, Skeleton};
use std::f64::consts::TAU;

/// A movement of the body over one sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Track {
    /// Training in front of one camera: turning on the spot with arms half lowered, limbs swinging gently.
    Turn,
    /// Training among many cameras: steps, swings and reaches.
    Drill,
    /// Training of hands: half turns of the upper body, fingers opening and closing.
    Gesture,
    /// Forearms, spine and neck twist far.
    Twist,
    /// Elbows and knees bend far, in squats and reaches.
    Bend,
    /// Fists, pinches and points that training has not shown.
    Fingers,
    /// Training of an arm: it turns about its own axis while it sways.
    ArmTurn,
    /// Every joint of an arm twists, the last frame by the whole angle.
    ArmTwist,
    /// Every joint of an arm bends, the last frame by the whole angle.
    ArmBend,
}

/// The poses of a track. Every angle is a smooth function of time in \[0, 1\], sampled at `frames` moments.
pub(super) fn poses(track: Track, motion: &Motion, seed: u32, skeleton: &Skeleton, frames: u32) -> Vec<Pose> {
    // Seeds only shift the phases of swings that have no meaning of their own.
    let phase = f64::from(seed % 97) / 97.0;
    (0..frames)
        .map(|frame| {
            let mut actor = Actor { skeleton, rotations: vec![DQuat::IDENTITY; skeleton.len()] };
            let cyclic = f64::from(frame) / f64::from(frames);
            // From just after the start to exactly the end.
            let ramp = f64::from(frame + 1) / f64::from(frames);
            match track {
                Track::Turn => actor.turn(motion, cyclic, phase),
                Track::Drill => actor.drill(motion, cyclic, phase),
                Track::Gesture => actor.gesture(motion, cyclic, phase),
                Track::Twist => actor.twist(motion, ramp),
                Track::Bend => actor.bend(motion, ramp),
                Track::Fingers => actor.fingers(motion, ramp),
                Track::ArmTurn => actor.arm_turn(motion, cyclic),
                Track::ArmTwist => actor.arm_joints(DVec3::X * motion.twist_degrees * smooth(ramp)),
                Track::ArmBend => actor.arm_joints(DVec3::Z * motion.bend_degrees * smooth(ramp)),
            }
            actor.pose()
        })
        .collect()
}

/// 0 to 1 with zero slope at both ends.
fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}

fn wave(cycles: f64, t: f64, phase: f64) -> f64 {
    portable::sin(TAU * (cycles * t + phase))
}

/// Between 0 and 1, starting at 0.
fn pulse(cycles: f64, t: f64) -> f64 {
    0.5 - 0.5 * portable::cos(TAU * cycles * t)
}

/// A skeleton being posed, from the rest pose on.
struct Actor<'a> {
    skeleton: &'a Skeleton,
    rotations: Vec<DQuat>,
}

/// Lowering of the arms from T-pose to A-pose, degrees.
const A_POSE: f64 = 48.0;

impl Actor<'_> {
    /// Turns a joint by degrees about x, then y, then z of its parent, after what it already does. Joints that the
    /// skeleton lacks are left out.
    fn rotate(&mut self, joint: &str, [x, y, z]: [f64; 3]) {
        if let Some(i) = self.skeleton.names.iter().position(|name| name == joint) {
            let about = |axis: DVec3, degrees: f64| portable::from_axis_angle(axis, degrees.to_radians());
            let turn = about(DVec3::Z, z) * about(DVec3::Y, y) * about(DVec3::X, x);
            self.rotations[i] = turn * self.rotations[i];
        }
    }

    /// Turns a left joint, and its right counterpart as in a mirror.
    fn mirrored(&mut self, joint: &str, left: [f64; 3], right: [f64; 3]) {
        self.rotate(&format!("left_{joint}"), left);
        self.rotate(&format!("right_{joint}"), [right[0], -right[1], -right[2]]);
    }

    fn both(&mut self, joint: &str, angles: [f64; 3]) {
        self.mirrored(joint, angles, angles);
    }

    /// Arms lowered by degrees, shared between collar and shoulder.
    fn lower_arms(&mut self, left: f64, right: f64) {
        self.mirrored("collar", [0.0, 0.0, -0.12 * left], [0.0, 0.0, -0.12 * right]);
        self.mirrored("shoulder", [0.0, 0.0, -0.88 * left], [0.0, 0.0, -0.88 * right]);
    }

    fn turn(&mut self, motion: &Motion, t: f64, phase: f64) {
        let life = motion.liveliness;
        let sway = |cycles, shift: f64| life * wave(cycles, t, phase + shift);
        self.rotate("pelvis", [0.0, 360.0 * motion.turns * t, 0.0]);
        self.lower_arms(A_POSE + 8.0 * sway(3.0, 0.0), A_POSE + 8.0 * sway(3.0, 0.25));
        self.mirrored(
            "elbow",
            [0.0, -14.0 - 12.0 * sway(2.0, 0.1), 0.0],
            [0.0, -14.0 - 12.0 * sway(2.0, 0.6), 0.0],
        );
        self.mirrored("wrist", [18.0 * sway(2.0, 0.0), 0.0, 0.0], [18.0 * sway(2.0, 0.3), 0.0, 0.0]);
        self.both("hip", [0.0, 4.0, 5.0]);
        self.mirrored(
            "hip",
            [-8.0 * sway(3.0, 0.0).max(-0.2), 0.0, 0.0],
            [-8.0 * sway(3.0, 0.5).max(-0.2), 0.0, 0.0],
        );
        self.mirrored("knee", [6.0 + 6.0 * sway(3.0, 0.0), 0.0, 0.0], [6.0 + 6.0 * sway(3.0, 0.5), 0.0, 0.0]);
        self.rotate("spine2", [0.0, 7.0 * sway(2.0, 0.0), 3.0 * sway(1.0, 0.2)]);
        self.rotate("head", [4.0 * sway(2.0, 0.4), 10.0 * sway(2.0, 0.1), 0.0]);
    }

    fn drill(&mut self, motion: &Motion, t: f64, phase: f64) {
        let life = motion.liveliness;
        let sway = |cycles, shift: f64| life * wave(cycles, t, phase + shift);
        self.rotate("pelvis", [0.0, 360.0 * motion.turns * t, 0.0]);
        self.lower_arms(35.0 + 32.0 * sway(2.0, 0.0), 35.0 + 32.0 * sway(2.0, 0.4));
        self.mirrored("shoulder", [0.0, -18.0 * sway(2.0, 0.2), 0.0], [0.0, -18.0 * sway(2.0, 0.7), 0.0]);
        self.mirrored(
            "elbow",
            [0.0, -38.0 - 36.0 * sway(3.0, 0.0), 0.0],
            [0.0, -38.0 - 36.0 * sway(3.0, 0.35), 0.0],
        );
        self.mirrored(
            "wrist",
            [30.0 * sway(2.0, 0.3), 0.0, 12.0 * sway(3.0, 0.0)],
            [30.0 * sway(2.0, 0.8), 0.0, 0.0],
        );
        for (side, shift) in [("left", 0.0), ("right", 0.5)] {
            let raised = wave(3.0, t, shift).max(0.0);
            let lift = life * (raised * raised);
            self.rotate(&format!("{side}_hip"), [-10.0 - 42.0 * lift, 0.0, 0.0]);
            self.rotate(&format!("{side}_knee"), [18.0 + 58.0 * lift, 0.0, 0.0]);
            self.rotate(&format!("{side}_ankle"), [-8.0 + 12.0 * lift, 0.0, 0.0]);
        }
        self.both("hip", [0.0, 4.0, 7.0]);
        for joint in ["spine1", "spine2", "spine3"] {
            self.rotate(joint, [3.0 + 3.0 * sway(2.0, 0.2), 8.0 * sway(3.0, 0.5), 4.0 * sway(1.0, 0.3)]);
        }
        self.rotate("head", [5.0 * sway(2.0, 0.4), 14.0 * sway(2.0, 0.1), 0.0]);
    }

    fn gesture(&mut self, motion: &Motion, t: f64, phase: f64) {
        let life = motion.liveliness;
        let sway = |cycles, shift: f64| life * wave(cycles, t, phase + shift);
        self.rotate("pelvis", [0.0, 75.0 * motion.turns * wave(1.0, t, 0.0), 0.0]);
        self.arms_before_chest(
            14.0 * sway(2.0, 0.0),
            14.0 * sway(2.0, 0.45),
            45.0 * sway(2.0, 0.1),
            45.0 * sway(2.0, 0.6),
        );
        for (i, finger) in FINGERS.into_iter().enumerate() {
            let curl = |shift: f64| 28.0 + 26.0 * sway(3.0, 0.12 * i as f64 + shift);
            self.curl(finger, curl(0.0), curl(0.5));
        }
        self.rotate("head", [5.0 * sway(2.0, 0.4), 12.0 * sway(2.0, 0.1), 0.0]);
    }

    fn twist(&mut self, motion: &Motion, t: f64) {
        let twist = motion.twist_degrees;
        let swing = wave(1.0, t, 0.0);
        self.lower_arms(30.0 - 12.0 * swing, 30.0 + 12.0 * swing);
        self.both("elbow", [0.0, -35.0 * pulse(2.0, t), 0.0]);
        // A forearm turns mostly at the wrist of a SMPL-like skeleton, which has one joint for it.
        self.mirrored("elbow", [0.25 * twist * swing, 0.0, 0.0], [-0.25 * twist * swing, 0.0, 0.0]);
        self.mirrored("wrist", [twist * swing, 0.0, 0.0], [-twist * swing, 0.0, 0.0]);
        for joint in ["spine1", "spine2", "spine3"] {
            self.rotate(joint, [0.0, twist / 6.0 * wave(1.0, t, 0.12), 0.0]);
        }
        for joint in ["neck", "head"] {
            self.rotate(joint, [0.0, -twist / 5.0 * wave(1.0, t, 0.12), 0.0]);
        }
        self.both("hip", [0.0, 10.0, 6.0]);
        self.mirrored(
            "hip",
            [0.0, 0.12 * twist * wave(1.0, t, 0.4), 0.0],
            [0.0, -0.12 * twist * wave(1.0, t, 0.4), 0.0],
        );
        self.rotate("pelvis", [0.0, 35.0 * wave(1.0, t, 0.62), 0.0]);
    }

    fn bend(&mut self, motion: &Motion, t: f64) {
        let bend = motion.bend_degrees;
        let squat = bend * pulse(1.0, t);
        self.rotate("pelvis", [0.22 * squat, 40.0 * wave(1.0, t, 0.05), 0.0]);
        self.both("hip", [-0.95 * squat, 6.0, 9.0]);
        self.both("knee", [squat, 0.0, 0.0]);
        self.both("ankle", [-0.27 * squat, 0.0, 0.0]);
        for joint in ["spine1", "spine2"] {
            self.rotate(joint, [0.08 * squat, 0.0, 10.0 * wave(1.0, t, 0.1)]);
        }
        self.lower_arms(55.0 - 0.35 * squat, 55.0 - 50.0 * pulse(2.0, t));
        self.mirrored("shoulder", [0.0, -0.35 * squat, 0.0], [0.0, -0.15 * squat, 0.0]);
        let reach = bend * pulse(1.5, t);
        self.mirrored("elbow", [0.0, -bend * pulse(2.0, t), 0.0], [0.0, -reach, 0.0]);
        self.mirrored("wrist", [0.0, 0.0, 0.4 * reach], [0.0, 0.0, -0.3 * reach]);
        self.rotate("head", [-0.12 * squat, 0.0, 0.0]);
    }

    fn fingers(&mut self, motion: &Motion, t: f64) {
        self.rotate("pelvis", [0.0, 25.0 * wave(1.0, t, 0.0), 0.0]);
        let turn = 0.6 * motion.twist_degrees;
        self.arms_before_chest(
            10.0 * wave(1.0, t, 0.2),
            10.0 * wave(1.0, t, 0.6),
            turn * wave(1.0, t, 0.0),
            turn * wave(1.0, t, 0.3),
        );
        let strongest = 0.65 * motion.bend_degrees;
        for (i, finger) in FINGERS.into_iter().enumerate() {
            // From a fist over a point (the index stretched) to an open hand; the other hand counts.
            let fist = if finger == "index" { pulse(2.0, t) } else { pulse(1.0, t) };
            let count = smooth((5.0 * t - i as f64).clamp(0.0, 1.0));
            self.curl(finger, strongest * fist, strongest * (1.0 - count));
        }
        self.rotate("head", [8.0, 10.0 * wave(1.0, t, 0.1), 0.0]);
    }

    /// Upper arms down and forward, forearms raised, hands in view of a camera in front; `turn` twists the wrists.
    fn arms_before_chest(&mut self, left: f64, right: f64, turn_left: f64, turn_right: f64) {
        self.lower_arms(56.0 + left, 56.0 + right);
        self.both("shoulder", [0.0, -12.0, 0.0]);
        // The palms turn to the camera.
        self.mirrored("elbow", [-55.0, -112.0 - left, 0.0], [-55.0, -112.0 - right, 0.0]);
        self.mirrored("wrist", [turn_left, 0.0, 0.0], [turn_right, 0.0, 0.0]);
        self.both("hip", [0.0, 5.0, 4.0]);
    }

    /// Bends a finger's three joints towards the palm, degrees per joint.
    fn curl(&mut self, finger: &str, left: f64, right: f64) {
        for phalanx in 1..=3 {
            let joint = format!("{finger}{phalanx}");
            // The palms face down in T-pose; the thumb closes across the palm.
            let bend = |degrees: f64| {
                if finger == "thumb" { [0.0, 0.45 * degrees, -0.2 * degrees] } else { [0.0, 0.0, -degrees] }
            };
            self.mirrored(&joint, bend(left), bend(right));
        }
    }

    fn arm_turn(&mut self, motion: &Motion, t: f64) {
        let life = motion.liveliness;
        self.rotations[0] =
            portable::from_axis_angle(DVec3::Y, (25.0 * life * wave(1.0, t, 0.0)).to_radians())
                * portable::from_axis_angle(DVec3::X, TAU * motion.turns * t);
        for rotation in self.rotations.iter_mut().skip(1) {
            *rotation = portable::from_axis_angle(DVec3::Z, (12.0 * life * wave(2.0, t, 0.1)).to_radians());
        }
    }

    /// Turns every joint but the root by an axis-angle in degrees.
    fn arm_joints(&mut self, degrees: DVec3) {
        let turn = portable::from_scaled_axis(degrees * (TAU / 360.0));
        self.rotations.iter_mut().skip(1).for_each(|rotation| *rotation = turn);
    }

    /// The pose, with the lower foot on the ground and both feet about the origin; an arm is held by its middle.
    fn pose(&self) -> Pose {
        let axis_angles: Vec<DVec3> = self.rotations.iter().map(|&q| portable::to_scaled_axis(q)).collect();
        let mut pose = Pose::from_axis_angles(self.skeleton, &axis_angles, DVec3::ZERO);
        let rest = self.skeleton.world_transforms(&self.skeleton.rest_locals);
        let posed = self.skeleton.world_transforms(&pose.locals);
        let named = |name: &str| self.skeleton.names.iter().position(|n| n == name);
        let ankles: Vec<usize> = ["left_ankle", "right_ankle"].into_iter().filter_map(named).collect();
        let toes: Vec<usize> = ["left_foot", "right_foot"].into_iter().filter_map(named).collect();
        let supports: Vec<DVec3> = if ankles.is_empty() {
            // An arm's rest pose is centred: its tip is opposite its root.
            let (last, tip) = (rest.len() - 1, -rest[0].translation);
            let posed_tip = posed[last].transform_point3(tip - rest[last].translation);
            posed.iter().map(|joint| joint.translation).chain([posed_tip]).collect()
        } else {
            ankles.iter().map(|&j| posed[j].translation).collect()
        };
        let middle = supports.iter().sum::<DVec3>() / supports.len() as f64;
        let sunk = ankles.iter().chain(&toes).map(|&j| posed[j].translation.y - rest[j].translation.y);
        let ground = sunk.fold(f64::INFINITY, f64::min);
        let height = if ankles.is_empty() { -middle.y } else { -ground };
        pose.translation = DVec3::new(-middle.x, height, -middle.z);
        pose
    }
}

const FINGERS: [&str; 5] = ["index", "middle", "ring", "pinky", "thumb"];
