//! Poses as an estimator would give them: exact ones, turned by noise that is smooth in time.
//!
//! Every joint is turned further by a rotation vector about the axes of its parent. Each of its coordinates is a sum of
//! [`WAVES`] cosines over the index of the pose, of equal amplitudes, random phases, and frequencies spread evenly in logarithm
//! between one period in [`LONGEST`] and one in [`SHORTEST`] poses, each drawn within its share: a flat spectrum per octave, none
//! below and none above. The root of the mean square of the rotation's angle is what was asked for, at every joint; the body's
//! translation stays. Random numbers follow from the seed and the digest of the poses, so that no name and no selection of frames
//! counts.

use super::{Sequence, Sourced};
use glam::DVec3;
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::scene::Pose;
use std::f64::consts::TAU;

/// Version of the noise, for content keys.
pub const VERSION: u32 = 1;
/// Cosines per coordinate.
pub const WAVES: usize = 6;
/// The longest and the shortest period, poses.
pub const LONGEST: f64 = 128.0;
/// See [`LONGEST`].
pub const SHORTEST: f64 = 8.0;

impl Sequence {
    /// A pose with noise of so many degrees.
    pub fn noisy_pose(&self, pose: usize, degrees: f64, seed: u64) -> Pose {
        self.disturbed(pose, degrees, self.noise_seed(seed))
    }

    /// The sequence with noise of so many degrees on every pose; as it is with none.
    #[must_use]
    pub fn with_pose_noise(&self, degrees: f64, seed: u64) -> Self {
        if degrees == 0.0 {
            return self.clone();
        }
        let own = self.noise_seed(seed);
        let noisy = (0..self.poses.len()).map(|pose| self.disturbed(pose, degrees, own)).collect();
        let number = degrees.to_bits().rotate_left(23) ^ seed ^ u64::from(VERSION);
        let poses: Sourced<Vec<Pose>> = self.poses.derived(noisy, number);
        Self { poses, ..self.clone() }
    }

    /// A seed with the digest of the poses.
    fn noise_seed(&self, seed: u64) -> u64 {
        self.poses.digest().0.first_chunk().map_or(0, |first| u64::from_le_bytes(*first)) ^ seed
    }

    fn disturbed(&self, pose: usize, degrees: f64, seed: u64) -> Pose {
        let joints = self.body.skeleton.num_joints();
        let amplitude = (degrees.to_radians() / 3f64.sqrt()) * (2.0 / WAVES as f64).sqrt();
        let vector = |joint: usize| {
            DVec3::from_array([0, 1, 2].map(|axis: usize| {
                let place = (3 * joint + axis) as u64;
                amplitude * wave(seed ^ (place + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15), pose as f64)
            }))
        };
        let vectors: Vec<DVec3> = (0..joints).map(vector).collect();
        self.poses[pose].turned(&vectors, DVec3::ZERO)
    }
}

/// The sum of the cosines of one coordinate.
fn wave(seed: u64, time: f64) -> f64 {
    let mut random = SplitMix64::new(seed);
    let octaves = portable::ln(LONGEST / SHORTEST);
    (0..WAVES)
        .map(|k| {
            let share = (k as f64 + f64::from(random.unit_f32())) / WAVES as f64;
            let frequency = portable::exp(octaves * share) / LONGEST;
            portable::cos(TAU * (frequency * time + f64::from(random.unit_f32())))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::{FrameRef, FrameSource, sequence::FrameGenerator};
    use super::*;
    use skinsplat_core::scene::{RestBody, Skeleton, SkinWeights};
    use std::sync::Arc;

    #[derive(Debug)]
    struct NoFrames;

    impl FrameGenerator for NoFrames {
        fn truth(&self, frame: usize) -> Result<super::super::Truth, super::super::Error> {
            Err(super::super::Error::invalid("none", "frame", frame.to_string(), "no frame"))
        }

        fn key(&self) -> Result<String, super::super::Error> {
            Ok("none".to_owned())
        }
    }

    fn still(poses: usize) -> Sequence {
        let names = vec![String::new(); 3];
        let positions = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let skeleton =
            Skeleton::from_joint_positions(names, vec![None, Some(0), Some(1)], &positions).unwrap();
        let weights = SkinWeights::from_rows([[(0, 1.0f32)]], 3).unwrap();
        let rest = Pose::rest(&skeleton);
        let body = RestBody {
            skeleton,
            vertices: vec![DVec3::ZERO],
            faces: Vec::new(),
            weights,
            uv: None,
            pose_directions: Vec::new(),
        };
        let source = FrameSource::Generated { generator: Arc::new(NoFrames), frame: 0 };
        let frame = FrameRef { name: "f".into(), time: 0, pose: 0, camera: 0, source };
        Sequence {
            id: "still".into(),
            body: Arc::new(body),
            poses: vec![rest; poses].into(),
            cameras: Vec::new().into(),
            frames: vec![frame],
            stored_sizes: None,
        }
    }

    /// Angles of the turns of every joint and pose, radians.
    fn angles(sequence: &Sequence) -> Vec<Vec<f64>> {
        let of = |pose: &Pose| {
            pose.locals.iter().map(|local| portable::to_scaled_axis(local.rotation).length()).collect()
        };
        sequence.poses.iter().map(of).collect()
    }

    #[test]
    fn noise_has_the_size_that_was_asked_for_and_is_smooth() {
        let noisy = still(4000).with_pose_noise(5.0, 3);
        let angles = angles(&noisy);
        for joint in 0..3 {
            let square = angles.iter().map(|pose| pose[joint].powi(2)).sum::<f64>() / angles.len() as f64;
            let size = square.sqrt().to_degrees();
            assert!((size - 5.0).abs() < 0.8, "{size}");
        }
        // Between two poses it moves by a fraction of itself: no frequency is above one period in eight poses.
        let moved =
            |pair: &[Pose]| portable::angle_between(pair[0].locals[1].rotation, pair[1].locals[1].rotation);
        let square = noisy.poses.windows(2).map(moved).map(|angle| angle * angle).sum::<f64>() / 3999.0;
        assert!(square.sqrt().to_degrees() < 5.0 * TAU / SHORTEST * 0.7, "{}", square.sqrt().to_degrees());
    }

    #[test]
    fn noise_depends_on_the_seed_and_the_poses_alone() {
        let sequence = still(20);
        let noisy = sequence.with_pose_noise(5.0, 3);
        assert_eq!(noisy.poses[7], sequence.noisy_pose(7, 5.0, 3));
        let named = Sequence { id: "other".into(), ..sequence.clone() };
        assert_eq!(*named.with_pose_noise(5.0, 3).poses, *noisy.poses);
        assert_ne!(*sequence.with_pose_noise(5.0, 4).poses, *noisy.poses);
        assert_eq!(*sequence.with_pose_noise(0.0, 3).poses, *sequence.poses);
        assert_ne!(noisy.poses.digest(), sequence.poses.digest());
        assert_eq!(noisy.poses[7].translation, DVec3::ZERO);
    }
}
