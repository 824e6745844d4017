//! Checkpoints of HAHA (`runners/train_gaussians.py`): Gaussians on faces of SMPL-X, and a texture for the rest of the body.
//!
//! `state_dict` holds per Gaussian its face `_gaussian_to_face` and, in the frame of that face and in units of its size,
//! `_xyz` and `_scaling` (a sigmoid between two settings, 0 and 0.1 in every published one); `_rotation`, `_opacity` (a logit)
//! and `_color` (as it is drawn); and `_trainable_texture` (3, H, W), whose first row is v = 0, and `_betas`. Poses of frames,
//! the body model and networks of metrics are in it too and are left.
//!
//! HAHA composites the Gaussians over the mesh in the rasterizer and mixes the result with the mesh once more by its
//! alpha; here they are composited once.

use super::super::Error;
use super::super::npy::Array;
use super::super::torch::{Checkpoint, Tensors};
use super::{Canonical, Format, LoadedAvatar};
use glam::Vec3;
use skinsplat_core::math::{portable, sh};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, Image};

/// The tensor that no other method has.
pub(super) const FACES: &str = "_gaussian_to_face";
const XYZ: &str = "_xyz";
const COLOUR: &str = "_color";
const ROTATION: &str = "_rotation";
const SCALING: &str = "_scaling";
const OPACITY: &str = "_opacity";
const TEXTURE: &str = "_trainable_texture";
const BETAS: &str = "_betas";
const READ: [&str; 8] = [FACES, XYZ, COLOUR, ROTATION, SCALING, OPACITY, TEXTURE, BETAS];

/// `max_s_value` of HAHA's configurations; `min_s_value` is 0.
const LARGEST_SCALE: f64 = 0.1;

/// Reads the tensors below a prefix (`state_dict.`).
pub(super) fn read(
    checkpoint: &mut Checkpoint,
    tensors: &Tensors,
    prefix: &str,
) -> Result<LoadedAvatar, Error> {
    let path = checkpoint.path().to_owned();
    let mut tensor =
        |name: &str, shape: &[Option<usize>]| checkpoint.shaped(tensors, &format!("{prefix}{name}"), shape);
    let xyz = tensor(XYZ, &[None, Some(3)])?;
    let n = xyz.shape[0];
    let rows = Some(n);
    let colour = tensor(COLOUR, &[rows, Some(3)])?;
    let rotation = tensor(ROTATION, &[rows, Some(4)])?;
    let scaling = tensor(SCALING, &[rows, Some(3)])?;
    let opacity = tensor(OPACITY, &[rows, Some(1)])?;
    let faces = tensor(FACES, &[rows])?;
    let has = |name: &str| tensors.contains(&format!("{prefix}{name}"));
    let texture = has(TEXTURE).then(|| tensor(TEXTURE, &[Some(3), None, None])).transpose()?;
    let betas = has(BETAS).then(|| tensor(BETAS, &[Some(1), None])).transpose()?;
    let index = |(i, &face): (usize, &f64)| match face >= 0.0 && face <= f64::from(u32::MAX) {
        true => Ok(face as u32),
        false => {
            let field = format!("{prefix}{FACES}[{i}]");
            Err(Error::invalid(&path, field, format!("{face}"), "the index of a face"))
        }
    };
    let faces = faces.values.iter().enumerate().map(index).collect::<Result<Vec<_>, _>>()?;
    let band = |c: &[f64]| [0, 1, 2].map(|k: usize| ((c[k] - 0.5) / sh::C0) as f32);
    let gaussians = Gaussians {
        means: vectors(&xyz, |x| x),
        rotations: rotation
            .values
            .chunks_exact(4)
            .map(|q| [0, 1, 2, 3].map(|k: usize| q[k] as f32))
            .collect(),
        log_scales: vectors(&scaling, |s| portable::ln(LARGEST_SCALE) + log_sigmoid(s)),
        opacity_logits: opacity.values.iter().map(|&v| v as f32).collect(),
        sh_degree: 0,
        sh: colour.values.chunks_exact(3).map(band).collect(),
    };
    let third = 1.0 / 3.0;
    let binding =
        Binding::Face(FaceBinding { faces, barycentric: vec![[third; 3]; n], offsets: vec![0.0; n] });
    let avatar = Avatar { gaussians, binding };
    avatar.validate(None).map_err(|e| Error::scene(&path, e))?;
    let mut loaded = LoadedAvatar::new(Format::Haha, avatar, &path);
    loaded.canonical = Canonical::Faces;
    loaded.texture =
        texture.map(|texture| image(&texture)).transpose().map_err(|e| Error::scene(&path, e))?;
    loaded.betas = betas.map(|betas| betas.values);
    let read = |name: &str| READ.iter().any(|own| name == format!("{prefix}{own}"));
    loaded.ignored = tensors.names().filter(|name| !read(name)).map(str::to_owned).collect();
    loaded.notes = vec![
        "a HAHA checkpoint; scales are read with its configurations' range of 0 to 0.1 sizes of a face"
            .to_owned(),
        "HAHA poses it by face-tbn+rotation=face-haha-scaled".to_owned(),
    ];
    Ok(loaded)
}

fn vectors(array: &Array, activated: impl Fn(f64) -> f64) -> Vec<Vec3> {
    let row = |v: &[f64]| Vec3::from_array([0, 1, 2].map(|k: usize| activated(v[k]) as f32));
    array.values.chunks_exact(3).map(row).collect()
}

/// ln(1 / (1 + exp(-x))), without overflow.
fn log_sigmoid(x: f64) -> f64 {
    x.min(0.0) - portable::ln(1.0 + portable::exp(-x.abs()))
}

/// Channels of rows from the bottom to an image with its first row at the top.
fn image(texture: &Array) -> Result<Image, skinsplat_core::scene::SceneError> {
    let (height, width) = (texture.shape[1], texture.shape[2]);
    let at = |channel: usize, row: usize, column: usize| {
        texture.values[(channel * height + row) * width + column] as f32
    };
    let pixel = |row: usize, column: usize| [0, 1, 2].map(|channel| at(channel, row, column));
    let rows = (0..height).rev().flat_map(|row| (0..width).map(move |column| pixel(row, column)));
    Image::new(width, height, rows.collect())
}
