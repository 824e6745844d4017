//! True images: the linearly blended mesh (Eq. 6), drawn by the triangle rasterizer with the material and the lights.

use super::figure::Figure;
use super::lighting::{self, Finish};
use super::material::Material;
use super::parameters::{Lights, Rig};
use crate::math::rotation::nearest_rotation;
use crate::render::mesh::{self, Drawing, Fragment, SamplePattern};
use crate::scene::{Camera, Pose, PosedBody, SceneError};
use glam::{DMat3, Quat, Vec3};

/// A subject as seen by a camera: everything that a frame needs besides pose and camera.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) figure: Figure,
    pub(super) material: Material,
    pub(super) lights: Lights,
    pub(super) rig: Rig,
    pub(super) samples: u32,
}

impl Model {
    /// Straight colour and coverage of a frame.
    ///
    /// # Errors
    /// A pose of another skeleton or an invalid camera.
    pub(super) fn draw(&self, pose: &Pose, camera: &Camera) -> Result<Drawing, SceneError> {
        let body = &self.figure.body;
        let posed = PosedBody::new(body, pose)?;
        let surface = posed.mesh();
        let to_rest = match self.lights {
            Lights::World => None,
            Lights::Body => Some(rest_from_world_rotations(&posed)),
        };
        let eye = camera.position().as_vec3();
        let mesh = mesh::Mesh::new(&surface.vertices, &body.faces)?;
        let shade = |fragment: &Fragment| {
            let corners = body.faces[fragment.face as usize].map(|i| i as usize);
            let blend = |values: &[Vec3]| -> Vec3 {
                (0..3).map(|k| values[corners[k]] * fragment.barycentric[k]).sum()
            };
            let openness = (0..3).map(|k| self.figure.openness[corners[k]] * fragment.barycentric[k]).sum();
            let finish = self.finish(blend(&self.figure.material_positions));
            let to_eye = (eye - fragment.position).normalize_or_zero();
            let (normal, view) = match &to_rest {
                None => (blend(&surface.normals), to_eye),
                Some(turns) => {
                    let view = (0..3).map(|k| (turns[corners[k]] * to_eye) * fragment.barycentric[k]).sum();
                    (blend(&self.figure.rest_normals), view)
                }
            };
            let radiance =
                lighting::shade(finish, normal.normalize_or_zero(), Vec3::normalize_or_zero(view), openness);
            lighting::to_srgb(radiance)
        };
        mesh::draw(&mesh, camera, SamplePattern::new(self.samples as usize), shade)
    }

    fn finish(&self, position: Vec3) -> Finish {
        match self.rig {
            Rig::Figure(_) => self.material.figure(position),
            Rig::Arm(shape) => {
                let metres = position * Vec3::new((shape.length / f64::from(shape.bones)) as f32, 1.0, 1.0);
                self.material.arm(metres, position.x, position.y.atan2(position.z))
            }
        }
    }
}

/// Per vertex, the inverse of the rotation nearest to its blend: from world to rest directions.
fn rest_from_world_rotations(posed: &PosedBody<'_>) -> Vec<Quat> {
    let weights = &posed.rest.weights;
    let inverse = |i: usize| {
        let (joints, shares) = weights.row(i);
        let blend = joints
            .iter()
            .zip(shares)
            .map(|(&j, &w)| posed.joints[usize::from(j)].linear * f64::from(w))
            .fold(DMat3::ZERO, |sum, m| sum + m);
        nearest_rotation(blend).inverse().as_quat()
    };
    (0..weights.len()).map(inverse).collect()
}
