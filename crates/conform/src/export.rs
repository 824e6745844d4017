//! The folder that an engine programmer starts from.

use super::convention::Convention;
use super::pipeline::Pipeline;
use super::rig::{Cases, Rig};
use super::sample::{Field, Sample, Storage, range};
use super::wiring::Wiring;
use super::{Error, manifest, vectors};
use glam::Vec3;
use serde_json::json;
use skinsplat_core::scene::{Avatar, Binding, Gaussians};
use skinsplat_data::gltf::{Motion, write_body};
use skinsplat_data::{atomic, ply};
use std::io::Write;
use std::path::Path;

/// Poses per second of the clip.
const FRAMERATE: f64 = 32.0;

/// Writes a rig: `avatar.ply`, `body.glb` (with the motion as its clip), `poses.json` (the same motion, and the camera),
/// `camera.json`, `vectors.json`, `vectors.bin`, the expected posed PLY of each pose below `expected`, `conform.json` and a
/// README. PLY, body, poses and cameras are in the axes of their formats (right-handed, y up, metres); vectors are in
/// `convention`.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn export(folder: &Path, cases: Cases, convention: &Convention) -> Result<(), Error> {
    let rig = Rig::new(cases)?;
    let expected = folder.join("expected");
    std::fs::create_dir_all(&expected).map_err(|cause| {
        Error::new(
            folder.display().to_string(),
            format!("cannot make the folder: {cause}"),
            "a folder to write to",
        )
    })?;
    let binary = ply::Encoding::LittleEndian;
    ply::write_avatar(&folder.join("avatar.ply"), &rig.avatar()?, &ply::Metadata::default(), binary)?;
    let poses = rig.scene_poses();
    let motion = Motion { name: "conform", poses: &poses, framerate: FRAMERATE };
    write_body(&folder.join("body.glb"), &rig.body, Some(motion))?;
    write(&folder.join("poses.json"), &poses_json(&rig))?;
    write(&folder.join("camera.json"), &camera_json(&rig))?;
    for frame in 0..rig.poses.len() {
        write_posed(&expected.join(format!("pose_{frame:04}.ply")), &rig, frame)?;
    }
    let pipeline =
        Pipeline { rig: &rig, convention: *convention, vectors: *convention, storage: Storage::Activated };
    write(&folder.join("vectors.json"), &vectors::json(&pipeline))?;
    let bytes = vectors::binary(&pipeline);
    atomic::write(&folder.join("vectors.bin"), |file| file.write_all(&bytes))?;
    write(&folder.join("README.md"), &readme(&rig, convention))?;
    // Last, so that a folder with it is whole.
    write(&folder.join(manifest::NAME), &manifest::text(cases, convention))
}

fn write(path: &Path, text: &str) -> Result<(), Error> {
    Ok(atomic::write(path, |file| file.write_all(text.as_bytes()))?)
}

/// The motion and the camera as `transforms.json` has them.
fn poses_json(rig: &Rig) -> String {
    let pose = |(time, pose): (usize, &super::RigPose)| {
        let thetas: Vec<[f64; 3]> = pose.axis_angles.iter().map(|v| v.to_array()).collect();
        json!({ "time": time, "transl": pose.translation.to_array(), "thetas": thetas })
    };
    let poses: Vec<_> = rig.poses.iter().enumerate().map(pose).collect();
    let camera = &rig.camera;
    let cameras = json!([{
        "id": 0,
        "K": [[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]],
        "w2c": rows(rig),
        "width": camera.width,
        "height": camera.height,
    }]);
    format!("{:#}\n", json!({ "betas": [], "poses": poses, "cameras": cameras }))
}

fn rows(rig: &Rig) -> [[f64; 4]; 4] {
    rig.camera.camera_from_world.transpose().to_cols_array_2d()
}

fn camera_json(rig: &Rig) -> String {
    let camera = &rig.camera;
    let value = json!({
        "width": camera.width, "height": camera.height,
        "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy,
        "world_to_camera": rows(rig),
    });
    format!("{value:#}\n")
}

/// The expected Gaussians of a pose, as a static PLY.
fn write_posed(path: &Path, rig: &Rig, frame: usize) -> Result<(), Error> {
    let convention = Convention::default();
    let pipeline = Pipeline { rig, convention, vectors: convention, storage: Storage::Logarithms };
    let mut posed = Gaussians { sh_degree: 3, ..Gaussians::default() };
    let three = |sample: &Sample, field: Field| -> Vec3 {
        let at = range(field).start;
        Vec3::from_array(std::array::from_fn(|k| sample[at + k] as f32))
    };
    for sample in pipeline.frame(&Wiring::default(), frame) {
        posed.means.push(three(&sample, Field::Means));
        let at = range(Field::Quaternions).start;
        posed.rotations.push(std::array::from_fn(|k| sample[at + k] as f32));
        posed.log_scales.push(three(&sample, Field::Scales));
        posed.opacity_logits.push(sample[range(Field::Opacities).start] as f32);
        posed.sh.extend(super::convention::sh_of(&sample).map(|rgb| rgb.map(|c| c as f32)));
    }
    let avatar = Avatar { gaussians: posed, binding: Binding::Static };
    let comments = vec![format!("expected in pose {frame}, by the quaternion average")];
    let metadata = ply::Metadata { body: None, comments };
    Ok(ply::write_avatar(path, &avatar, &metadata, ply::Encoding::LittleEndian)?)
}

fn readme(rig: &Rig, convention: &Convention) -> String {
    let widest = rig.influences.iter().map(Vec::len).max().unwrap_or(0);
    include_str!("rig.md")
        .replace("{cases}", rig.cases.name())
        .replace("{gaussians}", &rig.len().to_string())
        .replace("{poses}", &rig.poses.len().to_string())
        .replace("{joints}", &rig.body.skeleton.num_joints().to_string())
        .replace("{influences}", &widest.to_string())
        .replace("{convention}", convention.name)
        .replace("{axes}", convention.axes)
        .replace("{units}", &convention.units.to_string())
        .replace("{quaternions}", convention.quaternions.name())
        .replace("{matrices}", convention.matrices.name())
}
