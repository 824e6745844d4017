//! Joints that mirror or scale by 0: what has to be said of them, since Gaussians that rotate with a joint follow neither.

use super::{Clip, Rig};
use glam::DMat3;
use skinsplat_core::scene::{Pose, PosedBody, RestBody, SceneError};

/// A volume below this, of that of the cube over the longest axis, is none.
const FLAT: f64 = 1e-9;

/// Names of joints by what is odd about them.
#[derive(Default)]
struct Odd<'a> {
    mirrored: Vec<&'a str>,
    vanishing: Vec<&'a str>,
}

impl<'a> Odd<'a> {
    /// Notes a joint whose volume is this multiple of what it should be.
    fn add(&mut self, name: &'a str, volume: f64) {
        if volume.abs() < FLAT {
            self.vanishing.push(name);
        } else if volume < 0.0 {
            self.mirrored.push(name);
        }
    }

    fn notes(&self) -> Vec<String> {
        let note = |names: &[&str], what: &str| {
            let first = names.first()?;
            let more = if names.len() > 1 { format!(" and {} more", names.len() - 1) } else { String::new() };
            Some(format!("joint {first}{more}: {what}"))
        };
        let mirrored = "mirrored, which the shape of Gaussians does not follow (covariance=affine does)";
        let vanishing = "scaled by 0, where Gaussians vanish";
        note(&self.mirrored, mirrored).into_iter().chain(note(&self.vanishing, vanishing)).collect()
    }
}

/// The determinant for a longest axis of length 1.
fn volume(linear: DMat3) -> f64 {
    let axes = [linear.x_axis, linear.y_axis, linear.z_axis];
    let longest = axes.map(glam::DVec3::length).into_iter().fold(0.0, f64::max);
    if longest > 0.0 { (linear * longest.recip()).determinant() } else { 0.0 }
}

/// What the joints of a body at rest make of what hangs on them.
pub(super) fn of_rest(rest: &RestBody) -> Result<Vec<String>, SceneError> {
    let body = PosedBody::with_rotations(rest, &Pose::rest(&rest.skeleton), |_| false)?;
    let mut odd = Odd::default();
    for (name, joint) in rest.skeleton.names.iter().zip(&body.joints) {
        odd.add(name, volume(joint.linear));
    }
    Ok(odd.notes())
}

impl Clip {
    /// What has to be said of the clip, a clause each: joints that mirror at one of its keys as they do not at rest, or scale by 0.
    pub fn notes(&self, rig: &Rig) -> Vec<String> {
        let skeleton = &rig.body.rest.skeleton;
        let mut odd = Odd::default();
        for (node, scales) in self.scales() {
            let volumes = scales.map(|scale| volume(DMat3::from_diagonal(scale)));
            let rest = volume(DMat3::from_diagonal(skeleton.rest_locals[node].scale));
            let side = if rest < 0.0 { -1.0 } else { 1.0 };
            odd.add(&skeleton.names[node], volumes.map(|volume| volume * side).fold(1.0, f64::min));
        }
        odd.notes().iter().map(|note| format!("clip {}: {note}", self.name)).collect()
    }
}
