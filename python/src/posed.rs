//! Posing and drawing.

use crate::arrays::{array, invalid};
use crate::scene::{Avatar, Body, Camera, Pose, flat};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use skinsplat::run::foreign::{OnBody, on_body};
use skinsplat_core::scene::{self, Binding, Gaussians, OwnedPosed, PosedBody};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy, bake};
use skinsplat_render::{View, splat};

/// Gaussians in world space, ready to draw.
#[pyclass(frozen, module = "skinsplat")]
pub struct Posed {
    posed: OwnedPosed,
    canonical: Gaussians,
    notes: Vec<String>,
}

/// Poses an avatar on a body.
#[pyfunction]
pub fn pose(py: Python<'_>, avatar: &Avatar, body: &Body, pose: &Pose, strategy: &str) -> PyResult<Posed> {
    let strategy: Strategy = strategy.parse().map_err(invalid)?;
    py.detach(|| posed(avatar, body, pose, &strategy)).map_err(invalid)
}

fn posed(
    avatar: &Avatar,
    body: &Body,
    pose: &Pose,
    strategy: &Strategy,
) -> Result<Posed, Box<dyn std::error::Error + Send + Sync>> {
    let OnBody { avatar, body: own, mesh, mut notes } = on_body(avatar.loaded.clone(), &body.rest)?;
    let rest = own.as_ref().unwrap_or(&body.rest);
    let bound = BoundAvatar::new(&avatar, rest)?;
    let in_pose = PosedBody::new(rest, &pose.pose)?;
    if mesh.is_some() {
        notes.push("its textured mesh is not posed: these are its Gaussians".to_owned());
    }
    let posed = Poser::new().pose(&bound, &in_pose, strategy, &PoseOptions::default())?.into_owned();
    Ok(Posed { posed, canonical: avatar.gaussians, notes })
}

/// Draws posed Gaussians: (h, w, 3), not clamped.
#[pyfunction]
pub fn render<'py>(
    py: Python<'py>,
    posed: &Posed,
    camera: &Camera,
    background: [f32; 3],
    antialiased: bool,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    if let Some(value) = background.iter().find(|value| !(0.0..=1.0).contains(*value)) {
        return Err(invalid(format!("background: {value}; expected sRGB values in [0, 1]")));
    }
    let view = View::new(&camera.camera).over(background).antialiased(antialiased);
    let drawn = py.detach(|| splat::render(&posed.posed.as_posed(), &view)).map_err(invalid)?;
    let (width, height) = (drawn.image.width(), drawn.image.height());
    array(py, drawn.image.pixels().concat(), &[height, width, 3])
}

#[pymethods]
impl Posed {
    /// Gaussians that are drawn as they stand.
    #[staticmethod]
    fn static_(avatar: &Avatar) -> Self {
        let gaussians = &avatar.loaded.avatar.gaussians;
        Self { posed: OwnedPosed::from_static(gaussians), canonical: gaussians.clone(), notes: Vec::new() }
    }

    fn __len__(&self) -> usize {
        self.posed.len()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    #[getter]
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, flat(&self.posed.means), &[self.__len__(), 3])
    }

    /// M with covariance M Mᵀ.
    #[getter]
    fn factors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let values = self.posed.factors.iter().flat_map(|m| m.transpose().to_cols_array()).collect();
        array(py, values, &[self.__len__(), 3, 3])
    }

    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let covariance = |m: &glam::Mat3| (*m * m.transpose()).to_cols_array();
        array(py, self.posed.factors.iter().flat_map(covariance).collect(), &[self.__len__(), 3, 3])
    }

    /// Unit quaternions, where the strategy has them.
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let rotations = self.posed.rotations.as_ref();
        rotations.map(|rotations| array(py, rotations.concat(), &[self.__len__(), 4])).transpose()
    }

    #[getter]
    fn opacities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, self.posed.opacities.clone(), &[self.__len__()])
    }

    #[getter]
    fn sh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let count = (self.posed.sh_degree + 1).pow(2);
        array(py, self.posed.sh.concat(), &[self.__len__(), count, 3])
    }

    /// As a static avatar, which any viewer draws, and what that loses.
    fn bake(&self) -> (Avatar, Option<&'static str>) {
        let baked = bake(&self.posed.as_posed(), &self.canonical);
        let avatar = scene::Avatar { gaussians: baked.gaussians, binding: Binding::Static };
        (Avatar::made(avatar), baked.loss)
    }
}
