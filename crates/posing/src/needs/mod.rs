//! What an avatar and a motion need: the SH degree and the influences that are there, the joints that are used, how far the
//! joints of a Gaussian turn against each other, and for every cheaper solver a proved bound on how far it can be from the
//! exact average. From pairs of joints and summaries of the weights; no Gaussian is posed.
//!
//! `theory` has the proofs, [`PoseBounds`] a pose, [`Needs`] a motion.

mod gap;
mod pose;
mod theory;
mod values;
mod verdict;

pub use pose::PoseBounds;
pub use values::{Bound, Degrees, Extreme};
pub use verdict::Verdict;

use super::groups::{self, Group};
use super::{BoundAvatar, RotationChoice};
use rayon::prelude::*;
use skinsplat_core::math::rotation;
use skinsplat_core::scene::{Pose, PosedBody, RestBody, SceneError};
use std::collections::BTreeMap;

/// What an avatar and a motion need.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Needs {
    /// Gaussians.
    pub gaussians: usize,
    /// SH degree as stored.
    pub sh_degree_stored: usize,
    /// The highest SH degree with a coefficient other than 0.
    pub sh_degree_present: usize,
    /// `influences[n]`: Gaussians with n joints.
    pub influences: Vec<u64>,
    /// Joints of the body.
    pub joints: usize,
    /// Indices of the joints that some Gaussian hangs on, ascending.
    pub joints_used: Vec<u16>,
    /// Poses of the motion.
    pub poses: usize,
    /// The largest angle between two joints of one Gaussian.
    pub worst_angle: Extreme,
    /// At most the smallest gap (λ1 − λ2)/Σ w of any Gaussian in any pose, from pairs of joints.
    pub gap_bound: Extreme,
    /// The smallest gap itself; none if finding it would have taken too many eigenvalue problems.
    pub gap: Option<Extreme>,
    /// Pairs of joints that share a Gaussian, by ascending joint.
    pub pairs: Vec<Pair>,
    /// Rotation choices and how far they can be from the exact average over the motion.
    pub bounds: Vec<Bound>,
    /// `fewer_influences[k - 1]`: the same for the exact average of the k heaviest influences.
    pub fewer_influences: Vec<Degrees>,
    /// What is enough at a tolerance.
    pub verdict: Verdict,
}

/// Two joints that share a Gaussian.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Pair {
    /// Indices, ascending.
    pub joints: [u16; 2],
    /// Gaussians on both.
    pub gaussians: u64,
    /// Their largest angle, degrees.
    pub worst_angle: Extreme,
}

/// The choices that [`Needs::bounds`] lists unless others are asked for.
pub const LISTED: [&str; 20] = [
    "closed-form",
    "power-0",
    "power-1",
    "power-2",
    "power-4",
    "power-8",
    "power-15",
    "power-15-first",
    "power-15-ones",
    "power-15-identity",
    "power-15-nlerp",
    "power-15-column",
    "squaring-2",
    "squaring-4",
    "nlerp",
    "gram-schmidt-columns",
    "gram-schmidt-rows",
    "matrix-to-quaternion",
    "matrix-to-quaternion-raw",
    "lbs-polar",
];

impl Needs {
    /// What the poses of a motion need, at a tolerance in degrees. Without a pose, what the avatar needs at rest.
    ///
    /// # Errors
    /// A pose that is not one of the body.
    pub fn new(
        bound: &BoundAvatar,
        body: &RestBody,
        poses: &[Pose],
        choices: &[RotationChoice],
        tolerance: f64,
    ) -> Result<Self, SceneError> {
        let rest = [Pose::rest(&body.skeleton)];
        let poses = if poses.is_empty() { &rest } else { poses };
        let frames = poses
            .par_iter()
            .map(|pose| Ok(PoseBounds::new(bound, &PosedBody::new(body, pose)?)))
            .collect::<Result<Vec<_>, SceneError>>()?;
        let groups = bound.groups();
        let mut joints_used: Vec<u16> = groups.iter().flat_map(|group| group.joints.clone()).collect();
        joints_used.sort_unstable();
        joints_used.dedup();
        let mut influences = Vec::new();
        for group in groups {
            influences.resize(influences.len().max(group.joints.len() + 1), 0);
            influences[group.joints.len()] += group.count;
        }
        let pairs = pairs(groups, &frames);
        let over = |degrees: &dyn Fn(&PoseBounds<'_>) -> f64| {
            Degrees(frames.iter().map(degrees).fold(0.0, f64::max))
        };
        Ok(Self {
            gaussians: bound.len(),
            sh_degree_stored: bound.sh_degree,
            sh_degree_present: bound.sh_degree_present(),
            influences,
            joints: body.skeleton.num_joints(),
            joints_used,
            poses: poses.len(),
            worst_angle: pairs
                .iter()
                .map(|pair| pair.worst_angle)
                .fold(Extreme { value: 0.0, pose: 0 }, |a, b| if b.value > a.value { b } else { a }),
            gap_bound: gap::bound(&frames),
            gap: gap::exact(bound.all_chunks(), &frames),
            pairs,
            verdict: Verdict::new(&frames, tolerance),
            bounds: choices
                .iter()
                .map(|&rotation| Bound {
                    rotation,
                    degrees: over(&|frame| frame.degrees(rotation)),
                    proved: over(&|frame| frame.exact_degrees(rotation)),
                })
                .collect(),
            fewer_influences: (1..=groups::KEPT)
                .map(|kept| over(&|frame| frame.fewer_influences(kept)))
                .collect(),
        })
    }

    /// The smallest tolerance that any pose can keep, degrees: what `f32` leaves of one bone.
    pub fn smallest_tolerance() -> f64 {
        theory::rounding::STORED.to_degrees()
    }

    /// A tolerance from text.
    ///
    /// # Errors
    /// What was expected: a number that is not too small for any pose.
    pub fn parse_tolerance(text: &str) -> Result<f64, String> {
        let smallest = Self::smallest_tolerance();
        let usable = |degrees: &f64| degrees.is_finite() && *degrees >= smallest;
        text.parse()
            .ok()
            .filter(usable)
            .ok_or_else(|| format!("a tolerance in degrees such as 0.5, finite and at least {smallest:.2e}"))
    }

    /// The choices of [`LISTED`].
    pub fn listed() -> Vec<RotationChoice> {
        LISTED.iter().filter_map(|id| id.parse().ok()).collect()
    }
}

/// Every pair of joints that shares a Gaussian, with its largest angle.
fn pairs(groups: &[Group], frames: &[PoseBounds<'_>]) -> Vec<Pair> {
    let mut found: BTreeMap<(u16, u16), u64> = BTreeMap::new();
    for group in groups {
        for pair in group.pairs() {
            *found.entry(pair).or_default() += group.count;
        }
    }
    let found: Vec<((u16, u16), u64)> = found.into_iter().collect();
    let pair = |&((a, b), gaussians): &((u16, u16), u64)| {
        let mut worst_angle = Extreme { value: 0.0, pose: 0 };
        for (pose, frame) in frames.iter().enumerate() {
            let [p, q] = [a, b].map(|joint| frame.quats()[usize::from(joint)]);
            let value = rotation::angle_between(p, q).to_degrees();
            if value > worst_angle.value {
                worst_angle = Extreme { value, pose };
            }
        }
        Pair { joints: [a, b], gaussians, worst_angle }
    };
    found.par_iter().map(pair).collect()
}
