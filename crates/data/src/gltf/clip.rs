//! Animations: channels with their own keys, sampled into poses.

use super::buffers::{Integers, Source};
use super::{Joints, Rig, unit};
use crate::SourceDigest;
use crate::digest::Fingerprint;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::animation::{Channel as GltfChannel, Interpolation, Property};
use glam::{DQuat, DVec3, DVec4};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Pose, SceneError};

/// No clip of more poses times joints than this is sampled at its keys.
const MAX_SAMPLES: usize = 1 << 22;

/// So many values of all channels together are read of any file; of a larger file one for each of its bytes.
const FREE_VALUES: usize = 1 << 20;

/// An animation of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Its name ("clip 3" where the file has none).
    pub name: String,
    channels: Vec<Channel>,
}

/// The course of one property of one skeleton node.
#[derive(Clone, Debug, PartialEq)]
struct Channel {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    /// Seconds, increasing.
    times: Vec<f64>,
    /// One value per key; three (in-tangent, value, out-tangent) for cubic splines. Vectors leave w at 0.
    values: Vec<DVec4>,
}

impl Rig {
    /// A clip by name, or the only one.
    ///
    /// # Errors
    /// No such clip; no name although there are several, or none at all. The message lists the clips.
    pub fn clip(&self, name: Option<&str>) -> Result<&Clip, SceneError> {
        let names: Vec<&str> = self.clips.iter().map(|c| c.name.as_str()).collect();
        let found = match name {
            Some(name) => self.clips.iter().find(|c| c.name == name),
            None => self.clips.first().filter(|_| self.clips.len() == 1),
        };
        found.ok_or_else(|| {
            let problem =
                name.map_or(format!("{} clips and no name", names.len()), |n| format!("no clip {n:?}"));
            SceneError::new("animations", problem, format!("one of: {}", names.join(", ")))
        })
    }
}

impl Clip {
    /// The times of all keys of all channels, seconds, increasing.
    pub fn key_times(&self) -> Vec<f64> {
        let mut times: Vec<f64> = self.channels.iter().flat_map(|c| c.times.iter().copied()).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// The nodes whose scale moves, with the scales at the keys.
    pub(super) fn scales(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = DVec3>)> {
        let scaling = self.channels.iter().filter(|channel| channel.property == Property::Scale);
        scaling.map(|channel| (channel.node, (0..channel.times.len()).map(|k| channel.key(k).truncate())))
    }

    /// The pose at a time, in seconds. Before its first and after its last key a channel holds that key's value; nodes
    /// without a channel keep their rest transform.
    pub fn pose_at(&self, rig: &Rig, time: f64) -> Pose {
        let mut pose = Pose::rest(&rig.body.rest.skeleton);
        for channel in &self.channels {
            let value = channel.at(time);
            let local = &mut pose.locals[channel.node];
            match channel.property {
                Property::Translation => local.translation = value.truncate(),
                Property::Scale => local.scale = value.truncate(),
                _ => local.rotation = unit(DQuat::from_vec4(value)),
            }
        }
        pose
    }

    /// The poses at all keys.
    ///
    /// # Errors
    /// More than 2^22 joint transforms.
    pub fn key_poses(&self, rig: &Rig) -> Result<Vec<Pose>, SceneError> {
        let times = self.key_times();
        let joints = rig.body.rest.skeleton.len();
        if times.len().saturating_mul(joints) > MAX_SAMPLES {
            let problem = format!("{} keys for {joints} nodes", times.len());
            return Err(SceneError::new(format!("animation {}", self.name), problem, "a shorter clip"));
        }
        Ok(times.iter().map(|&time| self.pose_at(rig, time)).collect())
    }
}

impl Clip {
    /// The digest of what the file stores of the clip and of the rest pose that it moves.
    pub(crate) fn digest(&self, rig: &Rig) -> SourceDigest {
        let mut hash = Fingerprint::new();
        hash.count(rig.body.rest.skeleton.len());
        rig.body.rest.skeleton.rest_locals.iter().for_each(|local| hash.local(local));
        hash.count(self.channels.len());
        for Channel { node, property, interpolation, times, values } in &self.channels {
            hash.count(*node).bytes(format!("{property:?} {interpolation:?}").as_bytes()).count(times.len());
            hash.numbers(times.iter().copied());
            hash.count(values.len()).numbers(values.iter().flat_map(|v| v.to_array()));
        }
        hash.finish()
    }
}

impl Channel {
    fn at(&self, time: f64) -> DVec4 {
        let next = self.times.partition_point(|&t| t <= time);
        let last = self.times.len() - 1;
        if next == 0 || next > last || self.interpolation == Interpolation::Step {
            return self.key(next.saturating_sub(1));
        }
        let before = next - 1;
        let span = self.times[next] - self.times[before];
        let t = (time - self.times[before]) / span;
        match self.interpolation {
            Interpolation::CubicSpline => self.hermite(before, span, t),
            _ if self.property == Property::Rotation => {
                let [a, b] = [before, next].map(|k| unit(DQuat::from_vec4(self.key(k))));
                DVec4::from(portable::slerp(a, b, t))
            }
            _ => self.key(before).lerp(self.key(next), t),
        }
    }

    fn key(&self, k: usize) -> DVec4 {
        match self.interpolation {
            Interpolation::CubicSpline => self.values[3 * k + 1],
            _ => self.values[k],
        }
    }

    /// glTF 2.0, appendix C: a cubic Hermite spline with tangents per second.
    fn hermite(&self, before: usize, span: f64, t: f64) -> DVec4 {
        let (t2, t3) = (t * t, t * t * t);
        let out_tangent = self.values[3 * before + 2] * span;
        let in_tangent = self.values[3 * (before + 1)] * span;
        self.key(before) * (2.0 * t3 - 3.0 * t2 + 1.0)
            + out_tangent * (t3 - 2.0 * t2 + t)
            + self.key(before + 1) * (3.0 * t2 - 2.0 * t3)
            + in_tangent * (t3 - t2)
    }
}

/// All animations; channels of nodes outside the skeleton and of morph weights are left out.
pub(super) fn collect(source: &Source, joints: &Joints) -> Result<Vec<Clip>, SceneError> {
    let mut values = 0usize;
    let mut clip = |animation: ::gltf::Animation| {
        let index = animation.index();
        let name = animation.name().map_or_else(|| format!("clip {index}"), str::to_owned);
        let channels = animation.channels().enumerate().filter_map(|(i, gltf_channel)| {
            let node = joints.index_of(&gltf_channel.target().node())?;
            let field = format!("animations[{index}].channels[{i}]");
            let moves = gltf_channel.target().property() != Property::MorphTargetWeights;
            moves.then(|| {
                values = values.saturating_add(size(&gltf_channel));
                check_size(values, source, &field)?;
                channel(source, &gltf_channel, node, &field)
            })
        });
        Ok(Clip { name, channels: channels.collect::<Result<_, SceneError>>()? })
    };
    source.document.animations().map(&mut clip).collect()
}

/// How many values a channel asks memory for.
fn size(channel: &GltfChannel) -> usize {
    channel.sampler().input().count().max(channel.sampler().output().count())
}

/// Accessors that channels repeat may not make clips grow beyond what the file could hold.
fn check_size(values: usize, source: &Source, field: &str) -> Result<(), SceneError> {
    if values <= source.size.max(FREE_VALUES) {
        return Ok(());
    }
    let problem = format!("{values} values up to here, in a file of {} bytes", source.size);
    Err(SceneError::new(field, problem, "channels that do not repeat an accessor over and over"))
}

fn channel(source: &Source, channel: &GltfChannel, node: usize, field: &str) -> Result<Channel, SceneError> {
    let sampler = channel.sampler();
    let property = channel.target().property();
    let input = format!("{field}.input");
    let times: Vec<f32> = source.items(&sampler.input(), (DataType::F32, Dimensions::Scalar), &input)?;
    if times.iter().any(|t| !t.is_finite()) || times.windows(2).any(|w| w[0] >= w[1]) {
        return Err(SceneError::new(input, "times that do not increase", "increasing, finite seconds"));
    }
    let output = format!("{field}.output");
    let values = match property {
        Property::Rotation => rotations(source, &sampler.output(), &output)?,
        _ => {
            let kind = (DataType::F32, Dimensions::Vec3);
            let vectors: Vec<[f32; 3]> = source.items(&sampler.output(), kind, &output)?;
            vectors.iter().map(|v| DVec3::from_array(v.map(f64::from)).extend(0.0)).collect()
        }
    };
    let per_key = if sampler.interpolation() == Interpolation::CubicSpline { 3 } else { 1 };
    if values.len() != times.len() * per_key {
        let problem = format!("{} values", values.len());
        return Err(SceneError::new(
            output,
            problem,
            format!("{} for {} keys", times.len() * per_key, times.len()),
        ));
    }
    if values.iter().any(|v: &DVec4| !v.is_finite()) {
        return Err(SceneError::new(output, "NaN or infinite", "finite values"));
    }
    let times = times.iter().map(|&t| f64::from(t)).collect();
    Ok(Channel { node, property, interpolation: sampler.interpolation(), times, values })
}

/// Quaternions (x, y, z, w), as floats or normalised integers.
fn rotations(source: &Source, accessor: &::gltf::Accessor, field: &str) -> Result<Vec<DVec4>, SceneError> {
    let values = source.vectors::<4>(accessor, Dimensions::Vec4, Integers::Fractions, field)?;
    Ok(values.into_iter().map(DVec4::from_array).collect())
}
