//! Poses that are fitted: a further rotation of every joint and a shift of the body, on top of a pose that was given.
//!
//! A step of Adam is taken in the tangent space of the rotations as they stand (`exp(ω) R` about the axes of the parent), so that
//! gradients are exact however far a joint has turned. What would make no sense (numbers that are not finite, a joint that has
//! turned too far) is not done: the pose stays as it was and is fitted no further.

use crate::adam::Adam;
use crate::options::Moments;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Pose, PoseGradient, Skeleton};

/// What a pose is turned and shifted by, and the state of its optimiser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FreePose {
    /// Per node, the rotation before the given one, as w, x, y, z.
    turns: Vec<[f64; 4]>,
    /// Metres.
    shift: [f64; 3],
    moments: Adam,
    /// It diverged, and stays as it is.
    stopped: bool,
}

/// How far a step goes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseRates {
    /// Joints, radians.
    pub(crate) rotation: f32,
    /// The body, metres.
    pub(crate) translation: f32,
    /// A joint that turns further from the given pose has lost its way, degrees.
    pub(crate) most_degrees: f64,
}

/// Why a pose is fitted no further.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stopped {
    /// The joint, and what is wrong with it.
    pub(crate) problem: String,
}

impl FreePose {
    /// The given pose itself, of a skeleton with so many nodes.
    pub(crate) fn new(nodes: usize, moments: Moments) -> Self {
        let turns = vec![[1.0, 0.0, 0.0, 0.0]; nodes];
        Self { turns, shift: [0.0; 3], moments: Adam::new(3 * nodes + 3, moments), stopped: false }
    }

    /// True if it is of a skeleton with so many nodes: a checkpoint may say something else.
    pub(crate) fn is_for(&self, nodes: usize) -> bool {
        self.turns.len() == nodes && self.moments.is_for(3 * nodes + 3)
    }

    /// The pose as it stands.
    pub(crate) fn applied(&self, given: &Pose) -> Pose {
        let vectors: Vec<DVec3> =
            self.turns.iter().map(|&turn| portable::to_scaled_axis(quat(turn))).collect();
        given.turned(&vectors, DVec3::from_array(self.shift))
    }

    /// By how much the joint that turned most has turned, degrees.
    pub(crate) fn turned_degrees(&self) -> f64 {
        self.turns.iter().map(|&turn| degrees(quat(turn))).fold(0.0, f64::max)
    }

    /// True once it is fitted no further.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// One step against the gradient at the pose as it stands.
    ///
    /// # Errors
    /// A gradient that is not finite, or a joint that would turn too far: nothing has changed then, and nothing will.
    pub(crate) fn step(
        &mut self,
        skeleton: &Skeleton,
        gradient: &PoseGradient,
        rates: PoseRates,
    ) -> Result<(), Stopped> {
        if self.stopped {
            return Ok(());
        }
        let nodes = self.turns.len();
        let rotations = gradient.rotations.iter().flat_map(|own| own.to_array());
        let slopes: Vec<f32> = rotations.chain(gradient.translation.to_array()).map(|g| g as f32).collect();
        let mut step = vec![0.0; 3 * nodes + 3];
        let name = |place: usize| match place / 3 {
            node if node < nodes => format!("joint {} ({node})", skeleton.names[node]),
            _ => "the translation".to_owned(),
        };
        let before = self.clone();
        if slopes.len() == step.len() && slopes.iter().all(|g| g.is_finite()) {
            let rate = |place: usize| if place < 3 * nodes { rates.rotation } else { rates.translation };
            self.moments.step_rows(&mut step, &slopes, 3 * nodes + 3, rate);
        }
        let broken =
            slopes.iter().chain(&step).position(|v| !v.is_finite()).map(|place| place % (3 * nodes + 3));
        if let Some(place) = broken {
            *self = Self { stopped: true, ..before };
            return Err(Stopped { problem: format!("{}: its derivative is not finite", name(place)) });
        }
        for (node, turn) in self.turns.iter_mut().enumerate() {
            let own = DVec3::new(
                f64::from(step[3 * node]),
                f64::from(step[3 * node + 1]),
                f64::from(step[3 * node + 2]),
            );
            if own != DVec3::ZERO {
                *turn = components((portable::from_scaled_axis(own) * quat(*turn)).normalize());
            }
        }
        (0..3).for_each(|axis| self.shift[axis] += f64::from(step[3 * nodes + axis]));
        let angles = self.turns.iter().map(|&turn| degrees(quat(turn)));
        let mut too_far =
            angles.enumerate().filter(|(_, angle)| angle.is_nan() || *angle > rates.most_degrees);
        if let Some((node, angle)) = too_far.next() {
            *self = Self { stopped: true, ..before };
            let most = rates.most_degrees;
            let problem = format!(
                "{}: it would turn {angle:.0} degrees from the given pose, more than {most}",
                name(3 * node)
            );
            return Err(Stopped { problem });
        }
        Ok(())
    }
}

fn quat([w, x, y, z]: [f64; 4]) -> DQuat {
    DQuat::from_xyzw(x, y, z, w)
}

fn components(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

fn degrees(turn: DQuat) -> f64 {
    portable::angle_between(DQuat::IDENTITY, turn).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> Skeleton {
        let names = vec!["hip".to_owned(), "knee".to_owned()];
        Skeleton::from_joint_positions(names, vec![None, Some(0)], &[DVec3::ZERO, DVec3::X]).expect("a chain")
    }

    const RATES: PoseRates = PoseRates { rotation: 0.05, translation: 0.01, most_degrees: 40.0 };

    /// A loss that only knows where a hand is, 2 m along x from the hip when at rest.
    #[test]
    fn steps_bring_a_hand_where_it_belongs() {
        let skeleton = chain();
        let given = Pose::rest(&skeleton);
        let hand = |pose: &Pose| {
            let world = skeleton.world_transforms(&pose.locals);
            world[1].transform_point3(DVec3::X) + pose.translation
        };
        let wanted = DVec3::new(1.8, 0.5, 0.2);
        let mut free = FreePose::new(2, Moments::with_epsilon(1e-8));
        for k in 0..200 {
            let at = free.applied(&given);
            let slope = |vectors: [DVec3; 2], shift: DVec3| {
                (hand(&at.turned(&vectors, shift)) - wanted).length_squared()
            };
            let mut gradient = PoseGradient { rotations: vec![DVec3::ZERO; 2], translation: DVec3::ZERO };
            for axis in 0..9 {
                let ends = [1e-5, -1e-5].map(|h| {
                    let mut vectors = [DVec3::ZERO; 3];
                    vectors[axis / 3][axis % 3] = h;
                    slope([vectors[0], vectors[1]], vectors[2])
                });
                let own = (ends[0] - ends[1]) / 2e-5;
                match axis / 3 {
                    node @ 0..2 => gradient.rotations[node][axis % 3] = own,
                    _ => gradient.translation[axis % 3] = own,
                }
            }
            let fading = 1.0 - k as f32 / 200.0;
            let rates = PoseRates {
                rotation: RATES.rotation * fading,
                translation: RATES.translation * fading,
                ..RATES
            };
            free.step(&skeleton, &gradient, rates).expect("no joint turns far");
        }
        assert!((hand(&free.applied(&given)) - wanted).length() < 0.01, "{}", hand(&free.applied(&given)));
        assert!(free.turned_degrees() > 5.0);
    }

    #[test]
    fn a_pose_that_diverges_stays_as_it_was_and_names_its_joint() {
        let skeleton = chain();
        let mut gradient = PoseGradient { rotations: vec![DVec3::ZERO, DVec3::Y], translation: DVec3::ZERO };
        let mut free = FreePose::new(2, Moments::with_epsilon(1e-8));
        free.step(&skeleton, &gradient, RATES).expect("a small step");
        let good = free.applied(&Pose::rest(&skeleton));
        gradient.rotations[1].x = f64::NAN;
        let stopped = free.step(&skeleton, &gradient, RATES).expect_err("not finite");
        assert_eq!(stopped.problem, "joint knee (1): its derivative is not finite");
        assert!(free.is_stopped());
        assert_eq!(free.applied(&Pose::rest(&skeleton)), good);
        // Nothing happens any more.
        gradient.rotations[1].x = 1.0;
        free.step(&skeleton, &gradient, RATES).expect("stopped");
        assert_eq!(free.applied(&Pose::rest(&skeleton)), good);

        let mut free = FreePose::new(2, Moments::with_epsilon(1e-8));
        let rates = PoseRates { rotation: 0.3, ..RATES };
        let stopped = (0..10).find_map(|_| free.step(&skeleton, &gradient, rates).err()).expect("too far");
        assert!(stopped.problem.starts_with("joint knee (1): it would turn"), "{}", stopped.problem);
        assert!(free.turned_degrees() <= 40.0 && free.turned_degrees() > 10.0);
    }
}
