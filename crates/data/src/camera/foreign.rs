//! Cameras as other programs write them: `cameras.json` of 3DGS training, `transforms.json` of nerfstudio, instant-ngp and the
//! NeRF data sets.

use super::super::Error;
use super::fields::{self, Fields};
use super::rigid::{self, RIGID};
use super::{CameraView, NUMBER, PIXELS};
use glam::{DMat3, DMat4, DVec3, DVec4};
use serde::Deserialize;
use serde_json::Value;
use skinsplat_core::math::portable;
use skinsplat_core::scene::Camera;
use std::path::Path;

type Reader = fn(&Path, Value) -> Result<Vec<CameraView>, Error>;

/// The reader of a file of another program; none if it is one of our own.
pub(super) fn reader(value: &Value) -> Option<Reader> {
    let has = |one: &Value, names: &[&str]| names.iter().any(|name| one.get(name).is_some());
    let of_training = |list: &[Value]| list.iter().any(|one| has(one, &["rotation", "position", "img_name"]));
    match value {
        Value::Array(list) if of_training(list) => Some(trained),
        Value::Object(fields) if !fields.contains_key("cameras") => {
            let frames = fields.get("frames").and_then(Value::as_array);
            let placed =
                frames.is_some_and(|frames| frames.iter().any(|one| has(one, &["transform_matrix"])));
            (placed || has(value, &["fl_x", "camera_angle_x"])).then_some(nerf)
        }
        _ => None,
    }
}

fn trained(path: &Path, value: Value) -> Result<Vec<CameraView>, Error> {
    let list = value.as_array().map(Vec::as_slice).unwrap_or_default();
    list.iter().enumerate().map(|(i, camera)| trained_camera(path, i, camera)).collect()
}

/// A camera of 3DGS training: its place and axes (camera to world, rows) in the world, OpenCV axes, the principal point in the
/// middle.
fn trained_camera(path: &Path, i: usize, value: &Value) -> Result<CameraView, Error> {
    let format = "the cameras of 3DGS training: width, height, position, rotation (3x3), fx, fy";
    let fields = Fields::of(path, &format!("cameras[{i}]"), value, format)?;
    let (width, height) = (fields.required("width", PIXELS)?, fields.required("height", PIXELS)?);
    let position: [f64; 3] = fields.required("position", "3 numbers")?;
    let rotation: [[f64; 3]; 3] = fields.required("rotation", "3 rows of 3 numbers")?;
    let axes = DMat3::from_cols_array_2d(&rotation).transpose();
    if let Some(fault) = rigid::fault(axes) {
        return Err(fields.invalid("rotation", fault, RIGID));
    }
    let camera = Camera {
        width,
        height,
        fx: fields.required("fx", NUMBER)?,
        fy: fields.required("fy", NUMBER)?,
        cx: 0.5 * f64::from(width),
        cy: 0.5 * f64::from(height),
        camera_from_world: placed(axes, DVec3::from_array(position)).inverse(),
    };
    let note = "a camera of 3DGS training, whose file has no principal point: the middle of the image";
    Ok(CameraView { camera, background: None, note: Some(note.to_owned()) })
}

fn placed(axes: DMat3, place: DVec3) -> DMat4 {
    let column = |k: usize| axes.col(k).extend(0.0);
    DMat4::from_cols(column(0), column(1), column(2), place.extend(1.0))
}

/// Intrinsics, which stand at the top for all frames, or in a frame.
#[derive(Clone, Deserialize)]
struct Lens {
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    k3: f64,
    #[serde(default)]
    k4: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
    camera_model: Option<String>,
}

#[derive(Deserialize)]
struct Nerf {
    #[serde(flatten)]
    lens: Lens,
    frames: Vec<NerfFrame>,
}

/// A frame: camera to world, rows, OpenGL axes (y up, looking along -z).
#[derive(Deserialize)]
struct NerfFrame {
    #[serde(flatten)]
    lens: Lens,
    transform_matrix: Vec<Vec<f64>>,
}

fn nerf(path: &Path, value: Value) -> Result<Vec<CameraView>, Error> {
    let expected = "transforms.json of nerfstudio or instant-ngp: w, h, fl_x or camera_angle_x, frames of transform_matrix";
    let file: Nerf = serde_json::from_value(value)
        .map_err(|cause| Error::invalid(path, "frames", fields::problem(&cause), expected))?;
    let view = |(i, frame): (usize, &NerfFrame)| {
        let lens = frame.lens.clone().or(&file.lens);
        let about_matrix = |problem: String, expected: &str| {
            Error::invalid(path, format!("frames[{i}].transform_matrix"), problem, expected)
        };
        let world_from_camera = matrix(&frame.transform_matrix)
            .ok_or_else(|| about_matrix("another shape".to_owned(), "3 or 4 rows of 4 numbers"))?;
        if let Some(fault) = rigid::fault(DMat3::from_mat4(world_from_camera)) {
            return Err(about_matrix(fault, RIGID));
        }
        lens.view(world_from_camera).map_err(|(field, problem, expected)| {
            Error::invalid(path, format!("frames[{i}].{field}"), problem, expected)
        })
    };
    file.frames.iter().enumerate().map(view).collect()
}

fn matrix(rows: &[Vec<f64>]) -> Option<DMat4> {
    let row = |r: usize| rows.get(r).and_then(|row| <[f64; 4]>::try_from(row.as_slice()).ok());
    let last = if rows.len() == 3 { Some([0.0, 0.0, 0.0, 1.0]) } else { row(3) };
    let rows = [row(0)?, row(1)?, row(2)?, last?];
    Some(DMat4::from_cols_array_2d(&rows).transpose())
}

/// A field, what is wrong with it, and what was expected.
type Problem = (&'static str, String, &'static str);

impl Lens {
    /// These intrinsics, where the frame has some; those of the file elsewhere.
    fn or(self, file: &Self) -> Self {
        let distorted = self.distortion() != [0.0; 6];
        let of = if distorted { &self } else { file };
        let [k1, k2, k3, k4, p1, p2] = of.distortion();
        Self {
            w: self.w.or(file.w),
            h: self.h.or(file.h),
            fl_x: self.fl_x.or(file.fl_x),
            fl_y: self.fl_y.or(file.fl_y),
            cx: self.cx.or(file.cx),
            cy: self.cy.or(file.cy),
            camera_angle_x: self.camera_angle_x.or(file.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(file.camera_angle_y),
            k1,
            k2,
            k3,
            k4,
            p1,
            p2,
            camera_model: self.camera_model.clone().or_else(|| file.camera_model.clone()),
        }
    }

    fn distortion(&self) -> [f64; 6] {
        [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2]
    }

    fn view(&self, world_from_camera: DMat4) -> Result<CameraView, Problem> {
        if let Some(model) = self.camera_model.as_deref().filter(|model| !PINHOLES.contains(model)) {
            return Err((
                "camera_model",
                model.escape_debug().to_string(),
                "PINHOLE, SIMPLE_PINHOLE or OPENCV",
            ));
        }
        let [width, height] = [side("w", self.w)?, side("h", self.h)?];
        let focal = |given: Option<f64>, angle: Option<f64>, side: u32| {
            given.or_else(|| angle.map(|angle| 0.5 * f64::from(side) / portable::tan(0.5 * angle)))
        };
        let fx = focal(self.fl_x, self.camera_angle_x, width);
        let fx =
            fx.ok_or(("fl_x", "missing, and camera_angle_x too".to_owned(), "a focal length in pixels"))?;
        let fy = focal(self.fl_y, self.camera_angle_y, height);
        let flipped = DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
        let camera = Camera {
            width,
            height,
            fx,
            fy: fy.unwrap_or(fx),
            cx: self.cx.unwrap_or(0.5 * f64::from(width)),
            cy: self.cy.unwrap_or(0.5 * f64::from(height)),
            camera_from_world: (world_from_camera * flipped).inverse(),
        };
        Ok(CameraView { camera, background: None, note: self.note(fy.is_none()) })
    }

    /// What the file says and the camera leaves out, and what was guessed.
    fn note(&self, guessed_fy: bool) -> Option<String> {
        let clauses = [
            (self.distortion() != [0.0; 6], "the lens distortion of the file is left out"),
            (guessed_fy, "the file has no fl_y: that of fl_x"),
            (self.cx.is_none(), "the file has no cx: the middle of the image"),
            (self.cy.is_none(), "the file has no cy: the middle of the image"),
        ];
        let said: Vec<&str> = clauses.iter().filter(|(holds, _)| *holds).map(|(_, clause)| *clause).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }
}

const PINHOLES: [&str; 5] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL"];

fn side(name: &'static str, given: Option<f64>) -> Result<u32, Problem> {
    match given {
        Some(side) if side.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&side) => Ok(side as u32),
        Some(side) => Err((name, format!("{side}"), "a number of pixels")),
        None => Err((
            name,
            "missing".to_owned(),
            "pixels (NeRF's synthetic scenes leave them out: add w and h of their images)",
        )),
    }
}
