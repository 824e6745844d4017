//! Skeletons, skins, clips and skinned meshes.

use super::builder::{Builder, Target};
use crate::Error;
use glam::DAffine3;
use serde_json::{Value, json};
use skinsplat_core::scene::{LocalTransform, Pose, RestBody, SceneError, Skeleton, SkinWeights};
use std::path::Path;

/// A clip: poses at equal distances.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Its name.
    pub name: &'a str,
    /// Poses of the skeleton.
    pub poses: &'a [Pose],
    /// Poses per second.
    pub framerate: f64,
}

/// Writes a skinned mesh as `.glb`, with a clip if one is given. Shape and blend shapes of poses are left out, and numbers are
/// f32. [`Rig::load`](super::super::Rig::load) reads the same joints, vertices and poses back; where vertices have several
/// influences their order is kept.
///
/// # Errors
/// A pose of another skeleton, or a file that cannot be written.
pub fn write_body(path: &Path, body: &RestBody, motion: Option<Motion<'_>>) -> Result<(), Error> {
    body.validate().map_err(|e| Error::scene(path, e))?;
    let mut builder = Builder::new();
    let positions: Vec<f32> = body.vertices.iter().flat_map(|v| v.as_vec3().to_array()).collect();
    let mut attributes = json!({
        "POSITION": builder.floats("VEC3", 3, &positions, Target::Vertices, true),
    });
    put_influences(&mut builder, &mut attributes, &body.weights);
    let indices = builder.indices(body.faces.as_flattened());
    let skin = put_skeleton(&mut builder, &body.skeleton, &body.skeleton.rest_locals);
    builder.json["skins"] = json!([skin]);
    builder.json["meshes"] =
        json!([{ "name": "body", "primitives": [{ "attributes": attributes, "indices": indices }] }]);
    put_skinned_mesh(&mut builder, &body.skeleton);
    if let Some(motion) = motion {
        let animation =
            animation(&mut builder, &body.skeleton, &motion).map_err(|e| Error::scene(path, e))?;
        builder.json["animations"] = json!([animation]);
    }
    builder.write(path)
}

/// JOINTS_n and WEIGHTS_n, as many sets as the longest row needs. Joints without weight are 0, as the specification asks.
pub(super) fn put_influences(builder: &mut Builder, attributes: &mut Value, weights: &SkinWeights) {
    for set in 0..weights.max_influences().div_ceil(4).max(1) {
        let four = |i: usize| {
            let (joints, row) = weights.row(i);
            let place = |k: usize| 4 * set + k;
            let joint = |k: usize| joints.get(place(k)).copied().unwrap_or(0);
            let weight = |k: usize| row.get(place(k)).copied().unwrap_or(0.0);
            ([0, 1, 2, 3].map(joint), [0, 1, 2, 3].map(weight))
        };
        let (joints, values): (Vec<[u16; 4]>, Vec<[f32; 4]>) = (0..weights.len()).map(four).unzip();
        attributes[format!("JOINTS_{set}")] = json!(builder.joints(&joints));
        let values = values.as_flattened();
        attributes[format!("WEIGHTS_{set}")] =
            json!(builder.floats("VEC4", 4, values, Target::Vertices, false));
    }
}

/// The nodes of a skeleton in their order, and a scene with its roots; returns the skin.
pub(super) fn put_skeleton(builder: &mut Builder, skeleton: &Skeleton, locals: &[LocalTransform]) -> Value {
    let node = |i: usize| {
        let children: Vec<usize> = (0..skeleton.len()).filter(|&c| skeleton.parents[c] == Some(i)).collect();
        let LocalTransform { translation, rotation, scale } = locals[i];
        let mut node = json!({
            "name": skeleton.names[i],
            "translation": translation.as_vec3().to_array(),
            "rotation": rotation.as_quat().to_array(),
            "scale": scale.as_vec3().to_array(),
        });
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        node
    };
    builder.json["nodes"] = Value::Array((0..skeleton.len()).map(node).collect());
    let roots: Vec<usize> = (0..skeleton.len()).filter(|&i| skeleton.parents[i].is_none()).collect();
    builder.json["scenes"] = json!([{ "nodes": roots }]);
    let column_major = |m: &DAffine3| glam::DMat4::from(*m).as_mat4().to_cols_array();
    let binds: Vec<f32> = skeleton.inverse_binds.iter().flat_map(column_major).collect();
    let binds = builder.floats("MAT4", 16, &binds, Target::Other, false);
    let joints: Vec<usize> = (0..skeleton.num_joints()).collect();
    json!({ "joints": joints, "inverseBindMatrices": binds })
}

/// A node that shows the first mesh with the first skin.
pub(super) fn put_skinned_mesh(builder: &mut Builder, skeleton: &Skeleton) {
    let node = json!({ "name": "skinned", "mesh": 0, "skin": 0 });
    let place = skeleton.len();
    if let Some(nodes) = builder.json["nodes"].as_array_mut() {
        nodes.push(node);
    }
    if let Some(roots) = builder.json["scenes"][0]["nodes"].as_array_mut() {
        roots.push(json!(place));
    }
}

/// A channel for the rotation of every node, and for translations and scales that ever leave the rest pose. The translation
/// of the whole body is that of the roots.
pub(super) fn animation(
    builder: &mut Builder,
    skeleton: &Skeleton,
    motion: &Motion<'_>,
) -> Result<Value, SceneError> {
    if let Some(pose) = motion.poses.iter().find(|pose| pose.locals.len() != skeleton.len()) {
        let problem = format!("{} joints", pose.locals.len());
        return Err(SceneError::new("pose", problem, format!("the body's {}", skeleton.len())));
    }
    let times: Vec<f32> = (0..motion.poses.len()).map(|k| (k as f64 / motion.framerate) as f32).collect();
    let input = builder.floats("SCALAR", 1, &times, Target::Other, true);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    for node in 0..skeleton.len() {
        for (path, values) in tracks(skeleton, motion, node) {
            let width = values.len() / times.len().max(1);
            let kind = if width == 4 { "VEC4" } else { "VEC3" };
            let output = builder.floats(kind, width, &values, Target::Other, false);
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
            samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        }
    }
    Ok(json!({ "name": motion.name, "samplers": samplers, "channels": channels }))
}

/// The keys of a node by property.
fn tracks(skeleton: &Skeleton, motion: &Motion<'_>, node: usize) -> Vec<(&'static str, Vec<f32>)> {
    let root = skeleton.parents[node].is_none();
    let local = |pose: &Pose| {
        let own = pose.locals[node];
        let moved = if root { own.translation + pose.translation } else { own.translation };
        LocalTransform { translation: moved, ..own }
    };
    let locals: Vec<LocalTransform> = motion.poses.iter().map(local).collect();
    let rest = skeleton.rest_locals[node];
    let rotations = locals.iter().flat_map(|l| l.rotation.as_quat().to_array()).collect();
    let mut tracks = vec![("rotation", rotations)];
    if locals.iter().any(|l| l.translation != rest.translation) {
        let values = locals.iter().flat_map(|l| l.translation.as_vec3().to_array()).collect();
        tracks.push(("translation", values));
    }
    if locals.iter().any(|l| l.scale != rest.scale) {
        tracks.push(("scale", locals.iter().flat_map(|l| l.scale.as_vec3().to_array()).collect()));
    }
    tracks
}
