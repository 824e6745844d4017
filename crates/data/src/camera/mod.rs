//! Camera files: one camera as JSON, `transforms.json`, `cameras.npz`, and those of 3DGS and nerfstudio.

mod fields;
mod foreign;
pub(crate) mod rigid;

use super::npz::Archive;
use super::{Error, error};
use fields::Fields;
use glam::{DMat3, DMat4};
use rigid::RIGID;
use serde_json::Value;
use skinsplat_core::scene::Camera;
use std::path::Path;

/// A camera and what else its file may say.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraView {
    /// The camera.
    pub camera: Camera,
    /// Background colour, sRGB values in linear order R, G, B.
    pub background: Option<[f32; 3]>,
    /// What the file says and the camera leaves out, or what was assumed: a clause or several.
    pub note: Option<String>,
}

/// Loads every camera of a file; the content tells the form.
///
/// # Errors
/// Unknown forms, missing fields, skewed or inconsistent intrinsics, axes that are no rotation, and whatever
/// [`Camera::validate`] refuses.
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

/// What a JSON file of cameras may be.
const FORMATS: &str = "a camera (width, height, fx, fy, cx, cy, world_to_camera), cameras.json of 3DGS training (a list of \
                       width, height, position, rotation, fx, fy) or transforms.json (cameras, or frames of \
                       transform_matrix)";
const SINGLE: &str = "a camera: width, height, fx, fy, cx, cy, world_to_camera (4x4)";
const LISTED: &str = "a camera of transforms.json: id, K (3x3), w2c (4x4), width, height";
const PIXELS: &str = "a number of pixels";
const NUMBER: &str = "a number";
const MATRIX: &str = "4 rows of 4 numbers";

fn load_json(path: &Path) -> Result<Vec<CameraView>, Error> {
    let value: Value = error::read_json(path, "camera", FORMATS)?;
    if let Some(read) = foreign::reader(&value) {
        return read(path, value);
    }
    match (&value, value.get("cameras")) {
        (Value::Object(_), None) => Ok(vec![single(path, &value)?]),
        (_, Some(Value::Array(list))) => {
            list.iter().enumerate().map(|(i, camera)| listed(path, i, camera)).collect()
        }
        (_, Some(other)) => Err(Error::invalid(path, "cameras", fields::kind(other), "a list of cameras")),
        (other, None) => Err(Error::invalid(path, "camera", fields::kind(other), FORMATS)),
    }
}

/// A camera file: OpenCV axes, pixel centres at +0.5, matrices row-major.
fn single(path: &Path, value: &Value) -> Result<CameraView, Error> {
    let fields = Fields::of(path, "", value, SINGLE)?;
    let (width, height) = (fields.required("width", PIXELS)?, fields.required("height", PIXELS)?);
    let number = |name| fields.required::<f64>(name, NUMBER);
    let [fx, fy, cx, cy] = [number("fx")?, number("fy")?, number("cx")?, number("cy")?];
    let camera_from_world = world_to_camera(&fields, "world_to_camera")?;
    let expected = "three sRGB values in [0, 1]";
    let background: Option<[f32; 3]> = fields.optional("background", expected)?;
    if let Some(colour) = background.filter(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
        return Err(fields.invalid("background", format!("{colour:?}"), expected));
    }
    let camera = Camera { width, height, fx, fy, cx, cy, camera_from_world };
    Ok(CameraView { camera, background, note: None })
}

/// A camera of the list in `transforms.json`.
fn listed(path: &Path, i: usize, value: &Value) -> Result<CameraView, Error> {
    let fields = Fields::of(path, &format!("cameras[{i}]"), value, LISTED)?;
    let id: usize = fields.required("id", "a whole number")?;
    if id != i {
        return Err(fields.invalid("id", id.to_string(), &format!("{i} (cameras in order)")));
    }
    let k: [[f64; 3]; 3] = fields.required("K", INTRINSICS)?;
    let (width, height) = (fields.required("width", PIXELS)?, fields.required("height", PIXELS)?);
    let camera_from_world = world_to_camera(&fields, "w2c")?;
    let camera = pinhole(k.as_flattened(), camera_from_world, width, height)
        .map_err(|problem| fields.invalid("K", problem, INTRINSICS))?;
    Ok(CameraView { camera, background: None, note: None })
}

/// A field of a transform into the axes of a camera.
fn world_to_camera(fields: &Fields<'_>, name: &str) -> Result<DMat4, Error> {
    let rows: [[f64; 4]; 4] = fields.required(name, MATRIX)?;
    transform(rows.as_flattened()).map_err(|problem| fields.invalid(name, problem, RIGID))
}

/// The transform of these 16 numbers, row by row, whose linear part must be a rotation; else what it is.
fn transform(rows: &[f64]) -> Result<DMat4, String> {
    let rows: [f64; 16] = std::array::from_fn(|i| rows[i]);
    let matrix = DMat4::from_cols_array(&rows).transpose();
    rigid::fault(DMat3::from_mat4(matrix)).map_or(Ok(matrix), Err)
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
    let read = [k_name, w2c_name, "width", "height"];
    let unread: Vec<String> =
        archive.names().into_iter().filter(|name| !read.contains(&name.as_str())).collect();
    let note = (!unread.is_empty()).then(|| format!("not read: {}", unread.join(", ").escape_debug()));
    let view = |(i, (k, w2c)): (usize, (&[f64], &[f64]))| {
        let field = |name: &str| if several { format!("{name}[{i}]") } else { name.to_owned() };
        let camera_from_world =
            transform(w2c).map_err(|problem| archive.invalid(field(w2c_name), problem, RIGID))?;
        let camera = pinhole(k, camera_from_world, width, height)
            .map_err(|problem| archive.invalid(field(k_name), problem, INTRINSICS))?;
        Ok(CameraView { camera, background: None, note: note.clone() })
    };
    let pairs = intrinsics.values.chunks_exact(9).zip(extrinsics.values.chunks_exact(16));
    pairs.enumerate().map(view).collect()
}

fn side(archive: &mut Archive, name: &str) -> Result<u32, Error> {
    let scalar = archive.contains(name) && archive.header(name)?.shape.is_empty();
    let value = archive.require(name, if scalar { "" } else { "1" })?.values[0];
    if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
        return Err(archive.invalid(name, format!("{value}"), PIXELS));
    }
    Ok(value as u32)
}

fn pinhole(k: &[f64], camera_from_world: DMat4, width: u32, height: u32) -> Result<Camera, String> {
    if [k[1], k[3], k[6], k[7], k[8]] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        return Err(format!("skewed or not normalised: {k:?}"));
    }
    Ok(Camera { width, height, fx: k[0], fy: k[4], cx: k[2], cy: k[5], camera_from_world })
}
