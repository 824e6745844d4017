//! True images: the linearly blended mesh (Eq. 6), drawn by the triangle rasterizer with the material and the lights.

use super::figure::Figure;
use super::lighting::{self, Finish};
use super::material::Material;
use super::parameters::{Lights, Rig};
use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::math::rotation::nearest_rotation;
use skinsplat_core::scene::{Camera, Pose, PosedBody, SceneError};
use skinsplat_render::mesh::{self, Drawing, Fragment, SamplePattern};

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
            Lights::World | Lights::Camera => None,
            Lights::Body => Some(rest_from_world_rotations(&posed)),
        };
        let to_studio = match self.lights {
            Lights::World | Lights::Body => Mat3::IDENTITY,
            Lights::Camera => studio_from_world(camera),
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
                None => (to_studio * blend(&surface.normals), to_studio * to_eye),
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
                self.material.arm(metres, position.x, portable::atan2(position.y, position.z))
            }
        }
    }
}

/// From world directions to those of a studio whose lights are where a camera at +Z that looks along -Z has them: camera axes
/// (x right, y down, z forward) are its X, -Y, -Z.
fn studio_from_world(camera: &Camera) -> Mat3 {
    let turn = DMat3::from_mat4(camera.camera_from_world);
    (DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * turn).as_mat3()
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

#[cfg(test)]
mod tests {
    use super::super::figure;
    use super::super::motion::{self, Track};
    use super::super::parameters::Parameters;
    use super::super::stage::{self, Role};
    use super::*;
    use glam::{DMat4, DQuat};

    fn model(lights: Lights) -> (Model, Pose, Camera) {
        let parameters = Parameters { resolution: 96, samples: 1, ..Parameters::default() };
        let model = Model {
            figure: figure::build(&parameters).unwrap(),
            material: Material::new(parameters.look, parameters.seed),
            lights,
            rig: parameters.rig,
            samples: parameters.samples,
        };
        let skeleton = &model.figure.body.skeleton;
        let pose = motion::poses(Track::Bend, &parameters.motion, 1, skeleton, 8).remove(2);
        (model, pose, stage::cameras(&parameters, Role::Train).remove(0))
    }

    /// The fraction of covered pixels that change when subject and camera turn together.
    fn change_under_a_turn(lights: Lights) -> f64 {
        let (model, mut pose, mut camera) = model(lights);
        let before = model.draw(&pose, &camera).unwrap();
        let turn = DQuat::from_rotation_y(1.1);
        pose.locals[0].rotation = turn * pose.locals[0].rotation;
        // The root turns about its own joint.
        let pivot = pose.locals[0].translation;
        pose.translation = turn * (pivot + pose.translation) - pivot;
        camera.camera_from_world *= DMat4::from_quat(turn.inverse());
        let after = model.draw(&pose, &camera).unwrap();
        let covered = before.coverage.values().iter().zip(after.coverage.values());
        let covered: Vec<bool> = covered.map(|(&a, &b)| a > 0.0 && b > 0.0).collect();
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 0.01);
        let pairs = before.colour.pixels().iter().zip(after.colour.pixels());
        let changed = pairs.zip(&covered).filter(|&(pair, &seen)| seen && differs(pair)).count();
        changed as f64 / covered.iter().filter(|&&seen| seen).count() as f64
    }

    #[test]
    fn lights_on_the_body_turn_with_it_and_lights_in_the_world_do_not() {
        // Rounding moves a sample across an edge of the pattern here and there.
        let on_body = change_under_a_turn(Lights::Body);
        assert!(on_body < 0.06, "{on_body}");
        let in_world = change_under_a_turn(Lights::World);
        assert!(in_world > 0.6, "{in_world}");
    }

    #[test]
    fn lights_on_the_camera_turn_with_it() {
        let with_camera = change_under_a_turn(Lights::Camera);
        assert!(with_camera < 0.06, "{with_camera}");
    }

    #[test]
    fn a_camera_in_front_has_the_lights_of_the_world() {
        let (world, pose, camera) = model(Lights::World);
        let front = Camera {
            camera_from_world: DMat4::from_diagonal(glam::DVec4::new(1.0, -1.0, -1.0, 1.0))
                * DMat4::from_translation(DVec3::new(0.0, -0.9, -3.0)),
            ..camera
        };
        let on_camera = Model { lights: Lights::Camera, ..world.clone() };
        let images = [world, on_camera].map(|model| model.draw(&pose, &front).unwrap().colour);
        assert!(images[0].pixels().iter().any(|p| p[0] > 0.1), "the subject is in view");
        assert_eq!(images[0].pixels(), images[1].pixels());
    }
}
