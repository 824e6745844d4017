//! What an engine is given: a chain of joints, Gaussians that hang on one to six of them, consecutive poses and a camera.
//!
//! Everything is made in-process and is the same everywhere. Canonical numbers are those of the exported files (f32), so
//! that an engine that reads them starts from the same bits.

use glam::{DQuat, DVec3, Vec3};
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::math::{average, portable, rotation};
use skinsplat_core::scene::{
    Avatar, Binding, Camera, Gaussians, Pose, PosedBody, RestBody, SceneError, Skeleton, SkinWeights,
};

/// Raised whenever the rig changes: exports of another version are refused.
pub const RIG_VERSION: u32 = 1;

/// How many cases a rig holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cases {
    /// 54 Gaussians in 6 poses.
    #[default]
    Small,
    /// 270 Gaussians in 16 poses.
    Full,
}

impl Cases {
    /// Both, with their names.
    pub const NAMES: [(&'static str, Self); 2] = [("small", Self::Small), ("full", Self::Full)];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::Full => "full",
        }
    }

    fn gaussians(self) -> usize {
        match self {
            Self::Small => 54,
            Self::Full => 270,
        }
    }

    fn poses(self) -> usize {
        match self {
            Self::Small => 6,
            Self::Full => 16,
        }
    }
}

/// One pose of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigPose {
    /// Axis times angle per joint, radians, relative to the parent; rest rotations are the identity.
    pub axis_angles: Vec<DVec3>,
    /// Added to everything after skinning, metres.
    pub translation: DVec3,
}

/// Skeleton, Gaussians, weights, poses, camera.
#[derive(Clone, Debug)]
pub struct Rig {
    /// How many cases.
    pub cases: Cases,
    /// One triangle under each Gaussian, with its weights.
    pub body: RestBody,
    /// The canonical Gaussians, SH of degree 3.
    pub gaussians: Gaussians,
    /// Joints and weights of each Gaussian, the heaviest first; weights are multiples of 1/1024 and sum to one.
    pub influences: Vec<Vec<(usize, f64)>>,
    /// Consecutive poses; the first is not the rest pose.
    pub poses: Vec<RigPose>,
    /// The camera from which view directions are measured.
    pub camera: Camera,
}

/// Name, parent and rest position (metres, y up) of each joint; positions are exact in f32.
const JOINTS: [(&str, Option<usize>, [f64; 3]); 9] = [
    ("root", None, [0.0, 1.0, 0.0]),
    ("spine", Some(0), [0.03125, 1.25, -0.0625]),
    ("chest", Some(1), [0.0, 1.5, 0.0]),
    ("neck", Some(2), [-0.03125, 1.75, 0.0625]),
    ("shoulder", Some(2), [0.25, 1.5, -0.03125]),
    ("elbow", Some(4), [0.5, 1.4375, 0.0625]),
    ("wrist", Some(5), [0.75, 1.5, 0.125]),
    ("hip", Some(0), [0.125, 0.875, 0.03125]),
    ("knee", Some(7), [0.15625, 0.4375, 0.0625]),
];

/// Axis and largest angle (degrees) of each joint: bends and twists of up to 150.
const MOTION: [([f64; 3], f64); 9] = [
    ([0.2, 1.0, 0.1], 70.0),
    ([1.0, 0.3, -0.2], 45.0),
    ([0.1, 1.0, 0.4], -60.0),
    ([0.5, 1.0, 0.2], 95.0),
    ([0.3, -0.4, 1.0], 110.0),
    ([0.1, 1.0, -0.3], -150.0),
    ([1.0, 0.1, 0.2], 140.0),
    ([1.0, -0.2, 0.3], -85.0),
    ([1.0, 0.1, 0.0], 125.0),
];

/// The parts into which a weight of one is divided.
const PARTS: usize = 1024;

/// No average of the rig is worse determined than this: (λ1 − λ2) / λ1. So f32 is enough for 1e-6.
const LEAST_GAP: f64 = 0.3;

impl Rig {
    /// The rig of that size.
    ///
    /// # Errors
    /// None that is known: the constructors of the scene check what is made here.
    pub fn new(cases: Cases) -> Result<Self, SceneError> {
        let skeleton = skeleton()?;
        let poses: Vec<RigPose> = (0..cases.poses()).map(|k| pose(k, cases.poses())).collect();
        let turns = turns(&skeleton, &poses)?;
        let mut random = SplitMix64::new(0x5eed_0f5e_11ed);
        let mut gaussians = Gaussians { sh_degree: 3, ..Gaussians::default() };
        let mut influences = Vec::new();
        for i in 0..cases.gaussians() {
            push_gaussian(&mut gaussians, i, &mut random);
            let row = influence_row(i, &gaussians.means[i], &mut random);
            influences.push(well_determined(row, &turns));
        }
        let body = body(skeleton, &gaussians, &influences)?;
        let eye = DVec3::new(0.75, 1.5, 3.5);
        let camera = Camera::look_at(eye, DVec3::new(0.125, 1.125, 0.0), -DVec3::Y, 640.0, 640, 640);
        Ok(Self { cases, body, gaussians, influences, poses, camera })
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.influences.len()
    }

    /// True if there are none (never).
    pub fn is_empty(&self) -> bool {
        self.influences.is_empty()
    }

    /// Where the camera is, metres.
    pub fn eye(&self) -> DVec3 {
        self.camera.position()
    }

    /// The sign with which the quaternion of a joint is handed to engines: both signs occur, since both are the same
    /// rotation.
    pub fn sign(pose: usize, joint: usize) -> f64 {
        if (pose * 7 + joint * 5 + joint * joint) % 3 == 1 { -1.0 } else { 1.0 }
    }

    /// The Gaussians with their weights, as an avatar.
    ///
    /// # Errors
    /// As [`SkinWeights::from_rows`]; none that is known.
    pub fn avatar(&self) -> Result<Avatar, SceneError> {
        let weights = weights(&self.influences)?;
        Ok(Avatar { gaussians: self.gaussians.clone(), binding: Binding::Vertex(weights) })
    }

    /// The poses as the scene has them.
    pub fn scene_poses(&self) -> Vec<Pose> {
        let pose = |p: &RigPose| Pose::from_axis_angles(&self.body.skeleton, &p.axis_angles, p.translation);
        self.poses.iter().map(pose).collect()
    }
}

fn skeleton() -> Result<Skeleton, SceneError> {
    let names = JOINTS.map(|(name, _, _)| name.to_owned()).to_vec();
    let parents = JOINTS.map(|(_, parent, _)| parent).to_vec();
    let positions = JOINTS.map(|(_, _, position)| DVec3::from_array(position));
    Skeleton::from_joint_positions(names, parents, &positions)
}

/// A smooth motion: every joint swings between a third and all of its largest angle, each in its own time.
fn pose(k: usize, count: usize) -> RigPose {
    let time = k as f64 / count as f64;
    let wave = |phase: f64| 0.5 - 0.5 * portable::sin_cos(std::f64::consts::TAU * (time + phase)).1;
    let joint = |(j, &([x, y, z], degrees)): (usize, &([f64; 3], f64))| {
        let wobble = DVec3::new(0.1, -0.15, 0.2) * wave(0.37 * j as f64);
        let axis = (DVec3::new(x, y, z) + wobble).normalize();
        axis * (degrees.to_radians() * (0.35 + 0.65 * wave(0.13 + 0.21 * j as f64)))
    };
    let translation = DVec3::new(0.25 * wave(0.2), 0.125 * wave(0.6) + 0.0625, -0.375 * wave(0.4));
    RigPose { axis_angles: MOTION.iter().enumerate().map(joint).collect(), translation }
}

/// The rotation of each joint in each pose.
fn turns(skeleton: &Skeleton, poses: &[RigPose]) -> Result<Vec<Vec<[f64; 4]>>, SceneError> {
    let row = SkinWeights::from_rows([[(0, 1.0)]], JOINTS.len())?;
    let body = RestBody {
        skeleton: skeleton.clone(),
        vertices: vec![DVec3::ZERO],
        faces: Vec::new(),
        weights: row,
        uv: None,
        pose_directions: Vec::new(),
    };
    let of_pose = |pose: &RigPose| {
        let pose = Pose::from_axis_angles(&body.skeleton, &pose.axis_angles, pose.translation);
        let posed = PosedBody::new(&body, &pose)?;
        Ok(posed.joints.iter().map(|joint| wxyz(joint.rotation)).collect())
    };
    poses.iter().map(of_pose).collect()
}

/// (w, x, y, z).
pub(crate) fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// A number in \[-1, 1).
fn signed(random: &mut SplitMix64) -> f32 {
    2.0 * random.unit_f32() - 1.0
}

fn push_gaussian(gaussians: &mut Gaussians, i: usize, random: &mut SplitMix64) {
    let joint = Vec3::from_array(JOINTS[i % JOINTS.len()].2.map(|c| c as f32));
    let offset = Vec3::new(signed(random), signed(random), signed(random)) * 0.14;
    gaussians.means.push(joint + offset);
    let quat = [signed(random), signed(random), signed(random), signed(random)];
    let unit = rotation::normalize(quat.map(f64::from)).unwrap_or(rotation::identity());
    gaussians.rotations.push(unit.map(|c| c as f32));
    let log_scale = |random: &mut SplitMix64, least: f32| least + 1.1 * random.unit_f32();
    let (long, middle, short) = (log_scale(random, -2.9), log_scale(random, -4.1), log_scale(random, -5.4));
    // Every order of the three axes occurs.
    let scales =
        [[long, middle, short], [short, long, middle], [middle, short, long], [long, short, middle]][i % 4];
    gaussians.log_scales.push(Vec3::from_array(scales));
    gaussians.opacity_logits.push(0.3 + 3.0 * random.unit_f32());
    for k in 0..16 {
        let size = [0.9, 0.5, 0.5, 0.5, 0.35, 0.35, 0.35, 0.35, 0.35][usize::min(k, 8)];
        // Away from zero, so that a wrong sign of any coefficient shows.
        let mut value = || size * (0.25 + 0.75 * random.unit_f32()) * signed(random).signum();
        gaussians.sh.push([value(), value(), value()]);
    }
}

/// The joint at which a Gaussian sits and the next nearest ones, with weights in parts of 1/1024, the heaviest first.
fn influence_row(i: usize, mean: &Vec3, random: &mut SplitMix64) -> Vec<(usize, usize)> {
    let count = 1 + (i / JOINTS.len()) % 6;
    let home = i % JOINTS.len();
    let distance = |j: usize| DVec3::from_array(JOINTS[j].2).distance(mean.as_dvec3());
    let mut others: Vec<usize> = (0..JOINTS.len()).filter(|&j| j != home).collect();
    others.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    let joints = std::iter::once(home).chain(others).take(count);
    let mut row: Vec<(usize, usize)> = joints.map(|j| (j, 40 + random.below(60))).collect();
    let sum: usize = row.iter().map(|(_, parts)| parts).sum();
    row.iter_mut().for_each(|(_, parts)| *parts = (*parts * PARTS / sum).max(1));
    let used: usize = row.iter().map(|(_, parts)| parts).sum();
    row[0].1 += PARTS - used;
    told_apart(&mut row);
    row
}

/// By how many parts the heaviest weight exceeds the next.
const LEAD: usize = 16;

/// The heaviest first, no two weights the same: which is the heaviest, and which are the heaviest four, must not depend on
/// how an engine sorts.
fn told_apart(row: &mut [(usize, usize)]) {
    row.sort_by_key(|&(_, parts)| std::cmp::Reverse(parts));
    let close = |row: &[(usize, usize)]| {
        (1..row.len()).find(|&k| row[k - 1].1 - row[k].1 < if k == 1 { LEAD } else { 1 })
    };
    while let Some(k) = close(row) {
        row[k - 1].1 += 1;
        row[k].1 -= 1;
        row.sort_by_key(|&(_, parts)| std::cmp::Reverse(parts));
    }
}

/// Moves weight to the heaviest joint until the average is well determined in every pose.
fn well_determined(mut row: Vec<(usize, usize)>, turns: &[Vec<[f64; 4]>]) -> Vec<(usize, f64)> {
    let as_weights = |row: &[(usize, usize)]| -> Vec<(usize, f64)> {
        row.iter().map(|&(joint, parts)| (joint, parts as f64 / PARTS as f64)).collect()
    };
    while as_weights(&row).len() > 1 && least_gap(&as_weights(&row), turns) < LEAST_GAP {
        let mut moved = 0;
        for (_, parts) in &mut row[1..] {
            let taken = (*parts).div_ceil(16).min(*parts - 1);
            *parts -= taken;
            moved += taken;
        }
        if moved == 0 {
            break;
        }
        row[0].1 += moved;
        told_apart(&mut row);
    }
    as_weights(&row)
}

fn least_gap(row: &[(usize, f64)], turns: &[Vec<[f64; 4]>]) -> f64 {
    let weights: Vec<f64> = row.iter().map(|(_, weight)| *weight).collect();
    let gap = |joints: &Vec<[f64; 4]>| {
        let quats: Vec<[f64; 4]> = row.iter().map(|(joint, _)| joints[*joint]).collect();
        average::average(&quats, &weights, average::Solver::Eigen).map_or(0.0, |average| average.gap)
    };
    turns.iter().map(gap).fold(1.0, f64::min)
}

fn weights(influences: &[Vec<(usize, f64)>]) -> Result<SkinWeights, SceneError> {
    let row = |row: &Vec<(usize, f64)>| row.iter().map(|&(j, w)| (j, w as f32)).collect::<Vec<_>>();
    SkinWeights::from_rows(influences.iter().map(row), JOINTS.len())
}

/// A triangle under each Gaussian, so that there is a mesh to see.
fn body(
    skeleton: Skeleton,
    gaussians: &Gaussians,
    influences: &[Vec<(usize, f64)>],
) -> Result<RestBody, SceneError> {
    let corners = [Vec3::new(0.02, 0.0, 0.0), Vec3::new(0.0, 0.02, 0.0), Vec3::new(-0.01, -0.01, 0.02)];
    let vertices = gaussians.means.iter().flat_map(|&m| corners.map(|c| (m + c).as_dvec3())).collect();
    let faces = (0..gaussians.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let rows: Vec<Vec<(usize, f64)>> =
        influences.iter().flat_map(|row| std::iter::repeat_n(row.clone(), 3)).collect();
    let body = RestBody {
        skeleton,
        vertices,
        faces,
        weights: weights(&rows)?,
        uv: None,
        pose_directions: Vec::new(),
    };
    body.validate()?;
    Ok(body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rig_has_what_bugs_show_on() {
        for (_, cases) in Cases::NAMES {
            let rig = Rig::new(cases).unwrap();
            let counts: Vec<usize> = rig.influences.iter().map(Vec::len).collect();
            for bones in 1..=6 {
                assert!(counts.iter().filter(|&&n| n == bones).count() >= 9, "{bones} bones");
            }
            for row in &rig.influences {
                assert_eq!(row.iter().map(|(_, w)| w).sum::<f64>(), 1.0);
                assert!(row.iter().all(|(_, w)| *w > 0.0) && row.windows(2).all(|p| p[0].1 > p[1].1));
            }
            let angles = rig.poses.iter().flat_map(|p| &p.axis_angles).map(|a| a.length().to_degrees());
            let largest = angles.fold(0.0, f64::max);
            assert!((135.0..=150.0 + 1e-9).contains(&largest), "{largest}");
            let signs: Vec<f64> =
                (0..rig.poses.len()).flat_map(|p| (0..9).map(move |j| Rig::sign(p, j))).collect();
            assert!(signs.contains(&-1.0) && signs.contains(&1.0));
            let turns = turns(&rig.body.skeleton, &rig.poses).unwrap();
            assert!(rig.influences.iter().all(|row| least_gap(row, &turns) >= LEAST_GAP));
            rig.avatar().unwrap().validate(Some(&rig.body)).unwrap();
        }
    }
}
