//! What an engine is given, and what it should make of it, as arrays: written as JSON and as flat binary.

mod binary;
mod json;

pub(crate) use binary::binary;
pub(crate) use json::json;

use super::pipeline::{JointState, Pipeline};
use super::rig::Rig;
use super::sample::{Field, Sample, range};
use super::wiring::Wiring;
use skinsplat_core::math::portable;

/// A named array.
pub(crate) struct Array {
    pub(crate) name: &'static str,
    /// Extents, the last index running fastest.
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
    /// Indices, not measures.
    pub(crate) integer: bool,
}

impl Array {
    fn new(name: &'static str, shape: &[usize], values: Vec<f64>) -> Self {
        Self { name, shape: shape.to_vec(), values, integer: false }
    }
}

/// No joint: the parent of the root, in signed and in unsigned form.
pub(crate) const NO_PARENT: u32 = u32::MAX;

/// What is expected, field by field: poses × Gaussians × width.
pub(crate) fn expected(pipeline: &Pipeline<'_>) -> Vec<Array> {
    let (poses, gaussians) = (pipeline.rig.poses.len(), pipeline.rig.len());
    let samples: Vec<Sample> =
        (0..poses).flat_map(|frame| pipeline.frame(&Wiring::default(), frame)).collect();
    let array = |name, field: Field, shape: &[usize]| {
        let values = samples.iter().flat_map(|sample| sample[range(field)].to_vec()).collect();
        Array::new(name, &[&[poses, gaussians], shape].concat(), values)
    };
    let sh =
        samples.iter().flat_map(|s| s[range(Field::Sh0).start..range(Field::Sh3).end].to_vec()).collect();
    vec![
        array("means", Field::Means, &[3]),
        array("quaternions", Field::Quaternions, &[4]),
        array("scales", Field::Scales, &[3]),
        array("covariances", Field::Covariances, &[6]),
        array("directions", Field::Directions, &[3]),
        array("opacities", Field::Opacities, &[]),
        Array::new("sh", &[poses, gaussians, 16, 3], sh),
    ]
}

/// What an engine starts from.
pub(crate) fn inputs(pipeline: &Pipeline<'_>) -> Vec<Array> {
    let mut arrays = joints(pipeline);
    arrays.extend(canonical(pipeline));
    arrays.extend(influences(pipeline.rig));
    arrays.extend(poses(pipeline));
    let eye = pipeline.convention.point(pipeline.rig.eye().to_array());
    arrays.push(Array::new("camera_position", &[3], eye.to_vec()));
    arrays
}

fn joints(pipeline: &Pipeline<'_>) -> Vec<Array> {
    let skeleton = &pipeline.rig.body.skeleton;
    let count = skeleton.num_joints();
    let parents = skeleton.parents.iter().map(|p| p.map_or(f64::from(NO_PARENT), |p| p as f64)).collect();
    let rest = |j: usize| (-skeleton.inverse_binds[j].translation).to_array();
    let identity = skinsplat_core::math::matrix3::identity();
    let point = |p: [f64; 3]| pipeline.convention.point(p);
    let bind = |j: usize| pipeline.convention.matrix(identity, rest(j).map(|c| -c));
    vec![
        Array { integer: true, ..Array::new("parents", &[count], parents) },
        Array::new("rest_positions", &[count, 3], (0..count).flat_map(|j| point(rest(j))).collect()),
        Array::new("inverse_binds", &[count, 16], (0..count).flat_map(bind).collect()),
    ]
}

fn canonical(pipeline: &Pipeline<'_>) -> Vec<Array> {
    let (rig, convention) = (pipeline.rig, &pipeline.convention);
    let count = rig.len();
    let mut numbers: [Vec<f64>; 7] = Default::default();
    for i in 0..count {
        let gaussians = &rig.gaussians;
        let mut sample = [0.0; super::sample::WIDTH];
        sample[range(Field::Means)].copy_from_slice(&gaussians.means[i].to_array().map(f64::from));
        sample[range(Field::Quaternions)].copy_from_slice(&gaussians.unit_rotation(i).map(f64::from));
        let logarithms = gaussians.log_scales[i].to_array().map(f64::from);
        sample[range(Field::Scales)].copy_from_slice(&logarithms.map(portable::exp));
        let sh: [[f64; 3]; 16] = std::array::from_fn(|k| gaussians.sh[16 * i + k].map(f64::from));
        super::convention::put_sh(&mut sample, &sh);
        convention.encode(&mut sample, false);
        let q = std::array::from_fn(|k| sample[range(Field::Quaternions).start + k]);
        let logit = f64::from(gaussians.opacity_logits[i]);
        let scales = &sample[range(Field::Scales)];
        numbers[0].extend(&sample[range(Field::Means)]);
        numbers[1].extend(convention.quaternions.ordered(q));
        numbers[2].extend(scales);
        numbers[3].extend(scales.iter().map(|s| portable::ln(*s)));
        numbers[4].push(1.0 / (1.0 + portable::exp(-logit)));
        numbers[5].push(logit);
        numbers[6].extend(super::convention::sh_of(&sample).as_flattened());
    }
    let [means, quaternions, scales, logarithms, opacities, logits, sh] = numbers;
    vec![
        Array::new("canonical_means", &[count, 3], means),
        Array::new("canonical_quaternions", &[count, 4], quaternions),
        Array::new("canonical_scales", &[count, 3], scales),
        Array::new("canonical_log_scales", &[count, 3], logarithms),
        Array::new("canonical_opacities", &[count], opacities),
        Array::new("canonical_opacity_logits", &[count], logits),
        Array::new("canonical_sh", &[count, 16, 3], sh),
    ]
}

/// Rows padded with joint 0 and weight 0 to the longest.
fn influences(rig: &Rig) -> Vec<Array> {
    let widest = rig.influences.iter().map(Vec::len).max().unwrap_or(0);
    let padded = |row: &Vec<(usize, f64)>| {
        let rest = std::iter::repeat_n((0, 0.0), widest - row.len());
        row.iter().copied().chain(rest).collect::<Vec<_>>()
    };
    let rows: Vec<(usize, f64)> = rig.influences.iter().flat_map(padded).collect();
    let shape = [rig.len(), widest];
    let indices = rows.iter().map(|(joint, _)| *joint as f64).collect();
    vec![
        Array { integer: true, ..Array::new("indices", &shape, indices) },
        Array::new("weights", &shape, rows.iter().map(|(_, weight)| *weight).collect()),
    ]
}

fn poses(pipeline: &Pipeline<'_>) -> Vec<Array> {
    let (rig, convention) = (pipeline.rig, &pipeline.convention);
    let (frames, joints) = (rig.poses.len(), rig.body.skeleton.num_joints());
    let mut numbers: [Vec<f64>; 6] = Default::default();
    // The axis of a rotation is an axial vector.
    let axial = |v: glam::DVec3| {
        let [_, x, y, z] = convention.rotation([0.0, v.x, v.y, v.z]);
        [x, y, z]
    };
    for (frame, pose) in rig.poses.iter().enumerate() {
        let state = JointState::new(pipeline, &Wiring::default(), frame);
        numbers[0].extend(pose.axis_angles.iter().flat_map(|&v| axial(v)));
        numbers[1].extend(convention.point(pose.translation.to_array()));
        for j in 0..joints {
            let (turned, position) = state.world[j];
            numbers[2].extend(convention.matrix(turned, position));
            numbers[3].extend(convention.matrix(state.linear[j], state.translation[j]));
            numbers[4].extend(convention.quaternions.ordered(convention.rotation(state.quaternion[j])));
            numbers[5].extend(convention.point(state.translation[j]));
        }
    }
    let [angles, translation, world, skinning, quaternions, translations] = numbers;
    vec![
        Array::new("pose_axis_angles", &[frames, joints, 3], angles),
        Array::new("pose_translations", &[frames, 3], translation),
        Array::new("world_matrices", &[frames, joints, 16], world),
        Array::new("joint_matrices", &[frames, joints, 16], skinning),
        Array::new("joint_quaternions", &[frames, joints, 4], quaternions),
        Array::new("joint_translations", &[frames, joints, 3], translations),
    ]
}
