//! An avatar and a motion as the textures that the page uploads.

use glam::{DMat3, Quat, Vec3};
use half::f16;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, Pose, PosedBody, RestBody, SceneError, SkinWeights};
use std::fmt;

/// Texels of a row of a texture.
pub(crate) const WIDTH: usize = 1024;

/// How far a joint's linear part may be from its rotation to count as rigid.
const RIGID: f64 = 1e-4;

/// Rows of the largest texture that any WebGL 2 draws on many machines: 8192, of which SH of degree 3 take twelve per row of Gaussians.
const ROWS: usize = 8192;

/// Why there is no page.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewError {
    /// The avatar, the body or a pose is not what it has to be.
    Scene(SceneError),
    /// Gaussians that hang on nothing, or on faces.
    Binding(&'static str),
    /// No Gaussian, or more than fit.
    Count(usize),
    /// A joint scales in a pose: pose, joint.
    Scales(usize, usize),
    /// No pose.
    NoPose,
}

impl fmt::Display for ViewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(error) => error.fmt(f),
            Self::Binding(found) => write!(f, "binding: {found}; expected skinning weights per Gaussian"),
            Self::Count(count) => {
                write!(f, "{count} Gaussians; expected 1 to {}", ROWS / texels(16) * WIDTH)
            }
            Self::Scales(pose, joint) => {
                write!(
                    f,
                    "pose {pose}: joint {joint} scales; expected joints that turn and move, since the page shows no others"
                )
            }
            Self::NoPose => write!(f, "poses: none; expected one or more"),
        }
    }
}

impl std::error::Error for ViewError {}

impl From<SceneError> for ViewError {
    fn from(error: SceneError) -> Self {
        Self::Scene(error)
    }
}

/// Consecutive poses of a body.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// The body in its rest pose.
    pub rest: &'a RestBody,
    /// Its poses.
    pub poses: &'a [&'a Pose],
    /// Poses per second.
    pub framerate: f64,
}

/// Little-endian numbers, and what they are counted by.
#[derive(Debug)]
pub(crate) struct Packed {
    pub(crate) count: usize,
    pub(crate) rows: usize,
    pub(crate) influence_sets: usize,
    pub(crate) sh_degree: usize,
    pub(crate) joints: usize,
    pub(crate) frames: usize,
    pub(crate) framerate: f64,
    /// The middle of all Gaussians in each pose.
    pub(crate) centres: Vec<[f32; 3]>,
    /// How far Gaussians lie from it.
    pub(crate) reach: f32,
    /// `f32`: three texels a Gaussian, planar.
    pub(crate) gaussians: Vec<u8>,
    /// `u16`: a texel per set.
    pub(crate) indices: Vec<u8>,
    /// `f32`: a texel per set.
    pub(crate) weights: Vec<u8>,
    /// `f16`: as many texels as hold the coefficients.
    pub(crate) sh: Vec<u8>,
    /// `f32`: two texels a joint, a row per frame.
    pub(crate) motion: Vec<u8>,
}

/// Texels that hold RGB coefficients.
fn texels(coefficients: usize) -> usize {
    (3 * coefficients).div_ceil(4)
}

impl Packed {
    pub(crate) fn new(avatar: &Avatar, motion: Motion<'_>) -> Result<Self, ViewError> {
        avatar.validate(Some(motion.rest))?;
        let weights = match &avatar.binding {
            Binding::Vertex(weights) => weights,
            Binding::Static => return Err(ViewError::Binding("none, a static scene")),
            Binding::Face(_) => return Err(ViewError::Binding("faces")),
        };
        let gaussians = &avatar.gaussians;
        let count = gaussians.len();
        if count == 0 || count.div_ceil(WIDTH) * texels(16) > ROWS {
            return Err(ViewError::Count(count));
        }
        let joints = joints(motion)?;
        let first = joints.first().ok_or(ViewError::NoPose)?;
        let shares = shares(gaussians, weights, first.len());
        let centres: Vec<Vec3> = joints.iter().map(|pose| centre(&shares, pose)).collect();
        let influences = (0..count).map(|i| weights.row(i).0.len()).max().unwrap_or(1);
        let influence_sets = influences.div_ceil(4).max(1);
        let rows = count.div_ceil(WIDTH);
        let (indices, packed_weights) = packed_influences(weights, count, rows, influence_sets);
        Ok(Self {
            count,
            rows,
            influence_sets,
            sh_degree: gaussians.sh_degree,
            joints: first.len(),
            frames: joints.len(),
            framerate: motion.framerate,
            reach: reach(gaussians, weights, &joints, &centres),
            centres: centres.iter().map(|centre| centre.to_array()).collect(),
            gaussians: bytes(&packed_gaussians(gaussians, rows)),
            indices,
            weights: bytes(&packed_weights),
            sh: packed_sh(gaussians, rows),
            motion: bytes(joints.concat().as_flattened()),
        })
    }
}

fn bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Quaternion (x, y, z, w), translation and a zero of each joint in each pose.
fn joints(motion: Motion<'_>) -> Result<Vec<Vec<[f32; 8]>>, ViewError> {
    let of_pose = |(number, pose): (usize, &&Pose)| {
        let body = PosedBody::new(motion.rest, pose)?;
        let scales = |joint: &skinsplat_core::scene::JointTransform| {
            !joint.linear.abs_diff_eq(DMat3::from_quat(joint.rotation), RIGID)
        };
        if let Some(joint) = body.joints.iter().position(scales) {
            return Err(ViewError::Scales(number, joint));
        }
        let row = |joint: &skinsplat_core::scene::JointTransform| {
            let (q, t) = (joint.rotation.as_quat(), joint.translation.as_vec3());
            [q.x, q.y, q.z, q.w, t.x, t.y, t.z, 0.0]
        };
        Ok(body.joints.iter().map(row).collect())
    };
    motion.poses.iter().enumerate().map(of_pose).collect()
}

/// Mean and opacity; quaternion; standard deviations: three planes of texels.
fn packed_gaussians(gaussians: &Gaussians, rows: usize) -> Vec<f32> {
    let plane = 4 * WIDTH * rows;
    let mut numbers = vec![0.0; 3 * plane];
    for i in 0..gaussians.len() {
        let [x, y, z] = gaussians.means[i].to_array();
        let [w, qx, qy, qz] = gaussians.unit_rotation(i);
        let [a, b, c] = gaussians.log_scales[i].to_array().map(portable::exp);
        numbers[4 * i..4 * i + 4].copy_from_slice(&[x, y, z, gaussians.opacity(i)]);
        numbers[plane + 4 * i..plane + 4 * i + 4].copy_from_slice(&[qx, qy, qz, w]);
        numbers[2 * plane + 4 * i..2 * plane + 4 * i + 3].copy_from_slice(&[a, b, c]);
    }
    numbers
}

fn packed_influences(
    weights: &SkinWeights,
    count: usize,
    rows: usize,
    influence_sets: usize,
) -> (Vec<u8>, Vec<f32>) {
    let plane = 4 * WIDTH * rows;
    let (mut indices, mut numbers) = (vec![0_u16; influence_sets * plane], vec![0.0; influence_sets * plane]);
    for i in 0..count {
        let (joints, own) = weights.row(i);
        for (k, (&joint, &weight)) in joints.iter().zip(own).enumerate() {
            let at = k / 4 * plane + 4 * i + k % 4;
            (indices[at], numbers[at]) = (joint, weight);
        }
    }
    (indices.iter().flat_map(|joint| joint.to_le_bytes()).collect(), numbers)
}

fn packed_sh(gaussians: &Gaussians, rows: usize) -> Vec<u8> {
    let plane = 4 * WIDTH * rows;
    let coefficients = gaussians.sh_count();
    let mut numbers = vec![f16::ZERO; texels(coefficients) * plane];
    for (i, own) in gaussians.sh.chunks_exact(coefficients).enumerate() {
        for (k, value) in own.as_flattened().iter().enumerate() {
            numbers[k / 4 * plane + 4 * i + k % 4] = f16::from_f32(*value);
        }
    }
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// A joint's share in the Gaussians: Σ w and Σ w mean.
type Share = (f32, Vec3);

fn shares(gaussians: &Gaussians, weights: &SkinWeights, joints: usize) -> Vec<Share> {
    let mut shares = vec![(0.0, Vec3::ZERO); joints];
    for (i, mean) in gaussians.means.iter().enumerate() {
        let (own, weights) = weights.row(i);
        for (&joint, &weight) in own.iter().zip(weights) {
            let share = &mut shares[usize::from(joint)];
            share.0 += weight;
            share.1 += weight * *mean;
        }
    }
    shares
}

fn moved(&[x, y, z, w, a, b, c, _]: &[f32; 8], weight: f32, sum: Vec3) -> Vec3 {
    Quat::from_xyzw(x, y, z, w) * sum + weight * Vec3::new(a, b, c)
}

/// The middle of all posed means.
fn centre(shares: &[Share], joints: &[[f32; 8]]) -> Vec3 {
    let total: f32 = shares.iter().map(|(weight, _)| weight).sum();
    joints.iter().zip(shares).map(|(joint, &(weight, sum))| moved(joint, weight, sum)).sum::<Vec3>() / total
}

/// Poses in which the reach is measured.
const SAMPLES: usize = 12;

/// How far Gaussians lie from the middle of all, at most, over some of the poses.
fn reach(gaussians: &Gaussians, weights: &SkinWeights, motion: &[Vec<[f32; 8]>], centres: &[Vec3]) -> f32 {
    let step = motion.len().div_ceil(SAMPLES);
    let of_frame = |frame: usize| {
        let from_centre = |(i, mean): (usize, &Vec3)| {
            let (own, weights) = weights.row(i);
            let parts = own.iter().zip(weights);
            let posed: Vec3 = parts.map(|(&j, &w)| moved(&motion[frame][usize::from(j)], w, w * *mean)).sum();
            posed.distance(centres[frame])
        };
        gaussians.means.iter().enumerate().map(from_centre).fold(0.0, f32::max)
    };
    (0..motion.len()).step_by(step).map(of_frame).fold(0.0, f32::max)
}
