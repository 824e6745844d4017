//! Camera files: one camera as JSON, `transforms.json`, `cameras.npz`, and those of 3DGS and nerfstudio.

mod foreign;

use super::npz::Archive;
use super::{Error, error};
use glam::DMat4;
use serde::Deserialize;
use skinsplat_core::scene::Camera;
use std::path::Path;

/// A camera and what else its file may say.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraView {
    /// The camera.
    pub camera: Camera,
    /// Background colour, sRGB values in linear order R, G, B.
    pub background: Option<[f32; 3]>,
    /// What the file says and the camera leaves out, or what was assumed: a clause.
    pub note: Option<String>,
}

/// The arrays that are read of a `cameras.npz`.
pub const ARRAYS: [&str; 6] = ["intrinsic", "K", "extrinsic", "w2c", "width", "height"];

/// Loads every camera of a file; the content tells the form.
///
/// # Errors
/// Unknown forms, missing fields, skewed or inconsistent intrinsics, and whatever [`Camera::validate`] refuses.
pub fn load(path: &Path) -> Result<Vec<Camera>, Error> {
    Ok(load_views(path)?.into_iter().map(|view| view.camera).collect())
}

/// As [`load`], with the background colours that JSON files may hold.
///
/// # Errors
/// As [`load`].
pub fn load_views(path: &Path) -> Result<Vec<CameraView>, Error> {
    let is_npz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    let views = if is_npz { load_npz(path)? } else { load_json(path)? };
    for (i, view) in views.iter().enumerate() {
        view.camera.validate().map_err(|mut e| {
            if views.len() > 1 {
                e.field = format!("cameras[{i}].{}", e.field);
            }
            Error::scene(path, e)
        })?;
    }
    Ok(views)
}

/// A camera file: OpenCV axes, pixel centres at +0.5, matrices row-major.
#[derive(Deserialize)]
struct Single {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    world_to_camera: [[f64; 4]; 4],
    background: Option<[f32; 3]>,
}

/// The part of `transforms.json` that holds cameras.
#[derive(Deserialize)]
struct Several {
    cameras: Vec<Listed>,
}

#[derive(Deserialize)]
struct Listed {
    id: usize,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    w2c: [[f64; 4]; 4],
    width: u32,
    height: u32,
}

fn load_json(path: &Path) -> Result<Vec<CameraView>, Error> {
    let expected = "a camera: width, height, fx, fy, cx, cy, world_to_camera (4x4)";
    let value: serde_json::Value = error::read_json(path, "camera", expected)?;
    let malformed = |cause: serde_json::Error| Error::invalid(path, "camera", cause.to_string(), expected);
    if let Some(read) = foreign::reader(&value) {
        return read(path, value);
    }
    if value.get("cameras").is_none() {
        let single: Single = serde_json::from_value(value).map_err(malformed)?;
        if let Some(colour) = single.background.filter(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
            let expected = "three sRGB values in [0, 1]";
            return Err(Error::invalid(path, "background", format!("{colour:?}"), expected));
        }
        return Ok(vec![single.view()]);
    }
    let several: Several = serde_json::from_value(value).map_err(malformed)?;
    let view = |(i, listed): (usize, &Listed)| {
        if listed.id != i {
            let expected = format!("{i} (cameras in order)");
            return Err(Error::invalid(path, format!("cameras[{i}].id"), listed.id.to_string(), expected));
        }
        let k = listed.k.as_flattened();
        let w2c = listed.w2c.as_flattened();
        let camera = pinhole(k, w2c, listed.width, listed.height)
            .map_err(|problem| Error::invalid(path, format!("cameras[{i}].K"), problem, INTRINSICS))?;
        Ok(CameraView { camera, background: None, note: None })
    };
    several.cameras.iter().enumerate().map(view).collect()
}

impl Single {
    fn view(self) -> CameraView {
        let camera = Camera {
            width: self.width,
            height: self.height,
            fx: self.fx,
            fy: self.fy,
            cx: self.cx,
            cy: self.cy,
            camera_from_world: DMat4::from_cols_array_2d(&self.world_to_camera).transpose(),
        };
        CameraView { camera, background: self.background, note: None }
    }
}

const INTRINSICS: &str = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]";

/// `intrinsic` or `K` (3, 3) or (C, 3, 3); `extrinsic` or `w2c` (4, 4) or (C, 4, 4), world to camera; `width` and
/// `height`, one for all cameras.
fn load_npz(path: &Path) -> Result<Vec<CameraView>, Error> {
    let mut archive = Archive::open(path, "cameras")?;
    let k_name = if archive.contains("intrinsic") { "intrinsic" } else { "K" };
    let w2c_name = if archive.contains("extrinsic") { "extrinsic" } else { "w2c" };
    let several = archive.contains(k_name) && archive.header(k_name)?.shape.len() == 3;
    let batch = if several { "C," } else { "" };
    let intrinsics = archive.require(k_name, &format!("{batch}3,3"))?;
    let extrinsics = archive.require(w2c_name, &format!("{batch}4,4"))?;
    let width = side(&mut archive, "width")?;
    let height = side(&mut archive, "height")?;
    let view = |(i, (k, w2c)): (usize, (&[f64], &[f64]))| {
        let field = if several { format!("{k_name}[{i}]") } else { k_name.to_owned() };
        let camera =
            pinhole(k, w2c, width, height).map_err(|problem| archive.invalid(field, problem, INTRINSICS))?;
        Ok(CameraView { camera, background: None, note: None })
    };
    let pairs = intrinsics.values.chunks_exact(9).zip(extrinsics.values.chunks_exact(16));
    pairs.enumerate().map(view).collect()
}

fn side(archive: &mut Archive, name: &str) -> Result<u32, Error> {
    let scalar = archive.contains(name) && archive.header(name)?.shape.is_empty();
    let value = archive.require(name, if scalar { "" } else { "1" })?.values[0];
    if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
        return Err(archive.invalid(name, format!("{value}"), "a number of pixels"));
    }
    Ok(value as u32)
}

fn pinhole(k: &[f64], w2c: &[f64], width: u32, height: u32) -> Result<Camera, String> {
    if [k[1], k[3], k[6], k[7], k[8]] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        return Err(format!("skewed or not normalised: {k:?}"));
    }
    let rows: [f64; 16] = std::array::from_fn(|i| w2c[i]);
    let camera_from_world = DMat4::from_cols_array(&rows).transpose();
    Ok(Camera { width, height, fx: k[0], fy: k[4], cx: k[2], cy: k[5], camera_from_world })
}
