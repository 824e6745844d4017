//! Avatars, bodies, poses and cameras.

use crate::arrays::{array, invalid, rows, values};
use glam::{DMat4, DVec3, Vec3};
use numpy::{AllowTypeChange, PyArrayDyn, PyArrayLikeDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{self, Binding, Gaussians, RestBody, SkinWeights};
use skinsplat_data::avatar::{self, Canonical, Format, LoadedAvatar};
use skinsplat_data::{body, camera, ply, poses};
use std::path::PathBuf;
use std::sync::Arc;

/// Canonical Gaussians, as their file has them.
#[pyclass(frozen, module = "skinsplat")]
pub struct Avatar {
    pub(crate) loaded: LoadedAvatar,
}

impl Avatar {
    /// Gaussians without a file.
    pub(crate) fn made(avatar: scene::Avatar) -> Self {
        let loaded = LoadedAvatar {
            format: Format::Ply,
            avatar,
            canonical: Canonical::Rest,
            texture: None,
            betas: None,
            body: None,
            comments: Vec::new(),
            files: vec![PathBuf::from("<arrays>")],
            ignored: Vec::new(),
            notes: Vec::new(),
        };
        Self { loaded }
    }

    fn gaussians(&self) -> &Gaussians {
        &self.loaded.avatar.gaussians
    }
}

#[pymethods]
impl Avatar {
    #[new]
    #[pyo3(signature = (means, rotations, scales, opacities, sh, joints=None, weights=None))]
    fn new(
        means: PyReadonlyArrayDyn<'_, f32>,
        rotations: PyReadonlyArrayDyn<'_, f32>,
        scales: PyReadonlyArrayDyn<'_, f32>,
        opacities: PyReadonlyArrayDyn<'_, f32>,
        sh: PyReadonlyArrayDyn<'_, f32>,
        joints: Option<PyReadonlyArrayDyn<'_, i64>>,
        weights: Option<PyReadonlyArrayDyn<'_, f32>>,
    ) -> PyResult<Self> {
        let vectors = |values: &[f32]| rows::<f32, 3>(values).into_iter().map(Vec3::from_array).collect();
        let (coefficients, shape) = values(&sh, "sh", &[3])?;
        let sh_degree = match shape[..] {
            [_, 1] => 0,
            [_, 4] => 1,
            [_, 9] => 2,
            [_, 16] => 3,
            _ => {
                return Err(invalid(format!(
                    "sh: shape {shape:?} of RGB; expected (n, 1, 4, 9 or 16) of RGB"
                )));
            }
        };
        let logit = |p: f32| {
            let p = f64::from(p);
            (portable::ln(p) - portable::ln(1.0 - p)) as f32
        };
        let opacities = values(&opacities, "opacities", &[])?.0;
        if let Some(i) = opacities.iter().position(|p| !(0.0..=1.0).contains(p)) {
            return Err(invalid(format!("opacities[{i}]: {}; expected 0 to 1", opacities[i])));
        }
        let scales = values(&scales, "scales", &[3])?.0;
        if let Some(i) = scales.iter().position(|s| s.is_nan() || *s < 0.0) {
            return Err(invalid(format!("scales[{}]: {}; expected metres, 0 or more", i / 3, scales[i])));
        }
        let gaussians = Gaussians {
            means: vectors(&values(&means, "means", &[3])?.0),
            rotations: rows(&values(&rotations, "rotations", &[4])?.0),
            log_scales: vectors(
                &scales.iter().map(|&s| portable::ln(f64::from(s)) as f32).collect::<Vec<_>>(),
            ),
            opacity_logits: opacities.into_iter().map(logit).collect(),
            sh_degree,
            sh: rows(&coefficients),
        };
        gaussians.validate().map_err(invalid)?;
        let binding = match (joints, weights) {
            (Some(joints), Some(weights)) => Binding::Vertex(bound(&joints, &weights, gaussians.len())?),
            (None, None) => Binding::Static,
            _ => return Err(invalid("joints and weights: one without the other; expected both or none")),
        };
        Ok(Self::made(scene::Avatar { gaussians, binding }))
    }

    /// Reads an avatar of any format.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let loaded = py.detach(|| avatar::read_avatar(&path)).map_err(invalid)?;
        Ok(Self { loaded })
    }

    /// Writes a 3DGS PLY with its binding.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (avatar, metadata) = (&self.loaded.avatar, ply::Metadata::default());
        py.detach(|| ply::write_avatar(&path, avatar, &metadata, ply::Encoding::LittleEndian))
            .map_err(invalid)
    }

    fn __len__(&self) -> usize {
        self.gaussians().len()
    }

    fn __repr__(&self) -> String {
        let bound = if self.loaded.is_bound() { "" } else { ", unbound" };
        format!(
            "<skinsplat.Avatar: {} Gaussians, SH degree {}{bound}>",
            self.__len__(),
            self.gaussians().sh_degree
        )
    }

    /// How it was stored.
    #[getter]
    fn format(&self) -> &'static str {
        self.loaded.format.title()
    }

    /// What whoever uses it has to know.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.loaded.notes.clone()
    }

    #[getter]
    fn sh_degree(&self) -> usize {
        self.gaussians().sh_degree
    }

    #[getter]
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, flat(&self.gaussians().means), &[self.__len__(), 3])
    }

    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, self.gaussians().unit_rotations().concat(), &[self.__len__(), 4])
    }

    #[getter]
    fn scales<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let scales = flat(&self.gaussians().log_scales).into_iter().map(portable::exp).collect();
        array(py, scales, &[self.__len__(), 3])
    }

    #[getter]
    fn opacities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, self.gaussians().opacities(), &[self.__len__()])
    }

    #[getter]
    fn sh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, self.gaussians().sh.concat(), &[self.__len__(), self.gaussians().sh_count(), 3])
    }
}

/// Skinning weights: joints (n, k), weights (n, k).
fn bound(
    joints: &PyReadonlyArrayDyn<'_, i64>,
    weights: &PyReadonlyArrayDyn<'_, f32>,
    n: usize,
) -> PyResult<SkinWeights> {
    let (joints, shape) = values(joints, "joints", &[])?;
    let (weights, weights_shape) = values(weights, "weights", &[])?;
    if shape != weights_shape || shape.len() != 2 || shape[0] != n {
        let found = format!("{shape:?} and {weights_shape:?}");
        return Err(invalid(format!("joints, weights: shapes {found}; expected ({n}, k) both")));
    }
    if let Some(i) = joints.iter().position(|joint| !(0..=i64::from(u16::MAX)).contains(joint)) {
        return Err(invalid(format!("joints[{}]: {}; expected 0 to 65535", i / shape[1].max(1), joints[i])));
    }
    let most = joints.iter().max().map_or(0, |&joint| joint as usize + 1);
    let row = |i: usize| (i * shape[1]..(i + 1) * shape[1]).map(|at| (joints[at] as usize, weights[at]));
    let rows = (0..n).map(|i| row(i).filter(|(_, weight)| *weight != 0.0).collect::<Vec<_>>());
    SkinWeights::from_rows(rows, most).map_err(invalid)
}

/// The components of vectors.
pub(crate) fn flat(vectors: &[Vec3]) -> Vec<f32> {
    vectors.iter().flat_map(|v| v.to_array()).collect()
}

/// A body of one shape at rest.
#[pyclass(frozen, module = "skinsplat")]
pub struct Body {
    pub(crate) rest: Arc<RestBody>,
    notes: Vec<String>,
}

#[pymethods]
impl Body {
    /// Reads a body model and gives it a shape.
    #[staticmethod]
    #[pyo3(signature = (path, betas=None, expression=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        betas: Option<Vec<f64>>,
        expression: Option<Vec<f64>>,
    ) -> PyResult<Self> {
        let model = py.detach(|| body::read(&path)).map_err(invalid)?;
        let shaped = body::shape(&model.body, &betas.unwrap_or_default(), &expression.unwrap_or_default());
        let (rest, more) = shaped.map_err(|error| invalid(format!("{}: {error}", path.display())))?;
        Ok(Self { rest: Arc::new(rest), notes: [model.notes, more].concat() })
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.rest.skeleton.names.clone()
    }

    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values = self.rest.vertices.iter().flat_map(|v| v.to_array()).collect();
        array(py, values, &[self.rest.vertices.len(), 3])
    }

    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<u32>>> {
        array(py, self.rest.faces.concat(), &[self.rest.faces.len(), 3])
    }

    /// The pose at rest.
    fn rest_pose(&self) -> Pose {
        Pose { pose: scene::Pose::rest(&self.rest.skeleton) }
    }

    /// A pose of axis-angle vectors (j, 3), radians, and a translation, metres.
    #[pyo3(signature = (axis_angles, translation=None))]
    fn pose(
        &self,
        axis_angles: PyArrayLikeDyn<'_, f64, AllowTypeChange>,
        translation: Option<[f64; 3]>,
    ) -> PyResult<Pose> {
        let (angles, shape) = values(&axis_angles, "axis_angles", &[3])?;
        let joints = self.rest.skeleton.len();
        if shape != [joints] {
            return Err(invalid(format!(
                "axis_angles: {shape:?} vectors; expected the body's {joints} joints"
            )));
        }
        let angles: Vec<DVec3> = rows::<f64, 3>(&angles).into_iter().map(DVec3::from_array).collect();
        let translation = DVec3::from_array(translation.unwrap_or_default());
        Ok(Pose { pose: scene::Pose::from_axis_angles(&self.rest.skeleton, &angles, translation) })
    }

    /// Every pose of a file.
    #[pyo3(signature = (path, clip=None))]
    fn poses(&self, py: Python<'_>, path: PathBuf, clip: Option<&str>) -> PyResult<Vec<Pose>> {
        let track = py.detach(|| poses::load_clip(&path, clip)).map_err(invalid)?;
        let poses = track.poses(&self.rest.skeleton).map_err(invalid)?;
        Ok(poses.iter().map(|pose| Pose { pose: pose.clone() }).collect())
    }
}

/// A pose of a body.
#[pyclass(frozen, module = "skinsplat")]
pub struct Pose {
    pub(crate) pose: scene::Pose,
}

/// A pinhole camera, OpenCV axes.
#[pyclass(frozen, module = "skinsplat")]
pub struct Camera {
    pub(crate) camera: scene::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    fn new(
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        world_to_camera: PyArrayLikeDyn<'_, f64, AllowTypeChange>,
    ) -> PyResult<Self> {
        let (matrix, _) = values(&world_to_camera, "world_to_camera", &[4, 4])?;
        let matrix: [f64; 16] = matrix
            .try_into()
            .map_err(|_several| invalid("world_to_camera: several matrices; expected (4, 4)"))?;
        let camera_from_world = DMat4::from_cols_array(&matrix).transpose();
        let camera = scene::Camera { width, height, fx, fy, cx, cy, camera_from_world };
        camera.validate().map_err(invalid)?;
        Ok(Self { camera })
    }

    /// Every camera of a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Self>> {
        let cameras = py.detach(|| camera::load(&path)).map_err(invalid)?;
        Ok(cameras.into_iter().map(|camera| Self { camera }).collect())
    }

    #[getter]
    fn width(&self) -> u32 {
        self.camera.width
    }

    #[getter]
    fn height(&self) -> u32 {
        self.camera.height
    }
}
