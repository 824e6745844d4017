//! Gaussians as KHR_gaussian_splatting.

use super::super::splats::names;
use super::Motion;
use super::builder::{Builder, Target};
use super::rig::{animation, put_influences, put_skeleton, put_skinned_mesh};
use crate::Error;
use serde_json::{Value, json};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, RestBody, SceneError};
use std::path::Path;

/// Writes static Gaussians as `.glb` with KHR_gaussian_splatting: unit quaternions (x, y, z, w), standard deviations and
/// opacities as they are drawn, SH to the degree that they have, kernel `ellipse`, colour space `srgb_rec709_display` (that of
/// 3DGS). The axes are those of the Gaussians; glTF asks for y up.
///
/// # Errors
/// Gaussians that [`Gaussians::validate`] refuses, a file that cannot be written.
pub fn write_splats(path: &Path, gaussians: &Gaussians) -> Result<(), Error> {
    let mut builder = Builder::new();
    put_extensions(&mut builder);
    let primitive = primitive(&mut builder, gaussians).map_err(|e| Error::scene(path, e))?;
    builder.json["meshes"] = json!([{ "name": "splats", "primitives": [primitive] }]);
    builder.json["nodes"] = json!([{ "name": "splats", "mesh": 0 }]);
    builder.json["scenes"] = json!([{ "nodes": [0] }]);
    builder.write(path)
}

/// Writes canonical Gaussians as `.glb` with KHR_gaussian_splatting, JOINTS_n and WEIGHTS_n on the points, the skeleton as
/// their skin, and a clip. A proposal: the extension does not say what a skin does to rotations and SH. Here it turns both by
/// the average of the joints' rotations, as `extras.skinning` of the primitive says.
///
/// # Errors
/// An avatar without skinning weights or that does not fit the body, a pose of another skeleton, a file that cannot be written.
pub fn write_skinned_splats(
    path: &Path,
    avatar: &Avatar,
    body: &RestBody,
    motion: Option<Motion<'_>>,
) -> Result<(), Error> {
    let named = |e: SceneError| Error::scene(path, e);
    avatar.validate(Some(body)).map_err(named)?;
    let Binding::Vertex(weights) = &avatar.binding else {
        return Err(Error::invalid(path, "binding", "no skinning weights", "weights of each Gaussian's own"));
    };
    let mut builder = Builder::new();
    put_extensions(&mut builder);
    let mut primitive = primitive(&mut builder, &avatar.gaussians).map_err(named)?;
    put_influences(&mut builder, &mut primitive["attributes"], weights);
    primitive["extras"] =
        json!({ "skinning": "proposal: ROTATION and SH turned by the average of the joints' rotations" });
    let skin = put_skeleton(&mut builder, &body.skeleton, &body.skeleton.rest_locals);
    builder.json["skins"] = json!([skin]);
    builder.json["meshes"] = json!([{ "name": "splats", "primitives": [primitive] }]);
    put_skinned_mesh(&mut builder, &body.skeleton);
    if let Some(motion) = motion {
        let animation = animation(&mut builder, &body.skeleton, &motion).map_err(named)?;
        builder.json["animations"] = json!([animation]);
    }
    builder.write(path)
}

fn put_extensions(builder: &mut Builder) {
    builder.json["extensionsUsed"] = json!([names::EXTENSION]);
}

/// A primitive of points with the attributes of the extension.
fn primitive(builder: &mut Builder, gaussians: &Gaussians) -> Result<Value, SceneError> {
    gaussians.validate()?;
    let count = gaussians.sh_count();
    let mut attributes = json!({});
    let mut put = |name: &str, kind: &str, width: usize, values: &[f32]| {
        let bounds = name == "POSITION";
        attributes[name] = json!(builder.floats(kind, width, values, Target::Vertices, bounds));
    };
    let positions: Vec<f32> = gaussians.means.iter().flat_map(|m| m.to_array()).collect();
    put("POSITION", "VEC3", 3, &positions);
    let rotations: Vec<f32> = (0..gaussians.len())
        .map(|i| stored_rotation(gaussians, i))
        .flat_map(|[w, x, y, z]| [x, y, z, w])
        .collect();
    put(names::ROTATION, "VEC4", 4, &rotations);
    let scales: Vec<f32> =
        gaussians.log_scales.iter().flat_map(|s| s.map(portable::exp).to_array()).collect();
    put(names::SCALE, "VEC3", 3, &scales);
    put(names::OPACITY, "SCALAR", 1, &gaussians.opacities());
    for k in 0..count {
        let coefficient: Vec<f32> = gaussians.sh.iter().skip(k).step_by(count).flatten().copied().collect();
        put(&names::coefficient(k), "VEC3", 3, &coefficient);
    }
    let mut extension = json!({});
    extension[names::EXTENSION] = json!({ "kernel": names::KERNEL, "colorSpace": names::DISPLAY });
    Ok(json!({ "attributes": attributes, "mode": 0, "extensions": extension }))
}

/// A unit quaternion with the bits that it has, so that what was read is written again as it was.
fn stored_rotation(gaussians: &Gaussians, i: usize) -> [f32; 4] {
    let q = gaussians.rotations[i];
    let square: f64 = q.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
    if (square - 1.0).abs() <= 1e-6 { q } else { gaussians.unit_rotation(i) }
}
