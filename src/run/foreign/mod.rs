//! Avatars that were made elsewhere, on the body of a subject.

mod faces;
mod mesh;
mod nearest;

use super::Error;
use super::textured::{self, TexturedFiles};
use skinsplat_core::scene::{Avatar, Binding, Pose, RestBody};
use skinsplat_data::Error as DataError;
use skinsplat_data::avatar::{Canonical, CanonicalPose, LoadedAvatar};
use skinsplat_fit::texture::TexturedBody;
use std::path::Path;

/// An avatar as it hangs on a body.
#[derive(Debug)]
pub struct OnBody {
    /// The Gaussians, bound, measured on `body`.
    pub avatar: Avatar,
    /// The body with the avatar's canonical pose in the place of its rest pose; none if that is the rest pose. It takes the
    /// poses of the body that was given.
    pub body: Option<RestBody>,
    /// The mesh that is drawn with the Gaussians, if there is one.
    pub mesh: Option<TexturedBody>,
    /// What a reader of its numbers has to know, a clause each.
    pub notes: Vec<String>,
}

/// Hangs an avatar on a body. Gaussians that name no binding take the skinning weights of the nearest points of the body's
/// surface, rotations that are canonical on another mesh are carried to the rest pose, Gaussians of a canonical pose keep it
/// (the body that they hang on rests there), Gaussians in frames of faces are put on them.
///
/// # Errors
/// An avatar that does not fit the body; a mesh beside it that cannot be read.
pub fn on_body(loaded: LoadedAvatar, body: &RestBody) -> Result<OnBody, Error> {
    let bound = loaded.is_bound();
    let LoadedAvatar { mut avatar, canonical, texture, files, mut notes, .. } = loaded;
    let path = &files[0];
    let own = match &canonical {
        Canonical::Pose(pose) => {
            notes.push(format!(
                "its canonical pose ({}) is no rest pose: joints move it relative to that pose, as its method does",
                turns(pose)
            ));
            Some(posed(body, pose, path)?)
        }
        Canonical::Rest | Canonical::Mesh(_) | Canonical::Faces => None,
    };
    let rest = own.as_ref().unwrap_or(body);
    if !bound {
        avatar.binding = Binding::Vertex(nearest::nearest_weights(&avatar.gaussians.means, rest, path)?);
        notes.push(
            "no binding in the file: skinning weights of the nearest points of the body's surface".into(),
        );
    }
    avatar.validate(Some(rest)).map_err(|error| DataError::scene(path, error))?;
    notes.extend(few_joints(&avatar, rest).filter(|_| bound));
    match (&canonical, &mut avatar.binding) {
        (Canonical::Mesh(mesh), Binding::Face(binding)) => {
            avatar.gaussians.rotations =
                mesh::at_rest(&avatar.gaussians.rotations, binding, mesh, body, path)?;
        }
        (Canonical::Faces, Binding::Face(binding)) => {
            notes.extend(faces::put(&mut avatar.gaussians, binding, body));
        }
        _ => {}
    }
    let beside = TexturedFiles::beside(path);
    let mesh = match texture {
        Some(image) => Some(textured::covered(image, body, path)?),
        None => beside.exist().then(|| beside.read(body)).transpose()?,
    };
    Ok(OnBody { avatar, body: own, mesh, notes })
}

/// What has to be said of weights that leave half of the body's joints alone: joints are told by their number.
fn few_joints(avatar: &Avatar, body: &RestBody) -> Option<String> {
    let Binding::Vertex(weights) = &avatar.binding else { return None };
    let last = (0..weights.len()).flat_map(|i| weights.row(i).0).max()?;
    let (last, joints) = (usize::from(*last), body.skeleton.num_joints());
    // Of a small rig few joints may be most of what there is.
    (joints > 8 && 2 * (last + 1) <= joints).then(|| {
        format!("its weights name joints 0 to {last} of the body's {joints}: made for another body?")
    })
}

/// The body in the canonical pose of an avatar.
fn posed(body: &RestBody, pose: &CanonicalPose, path: &Path) -> Result<RestBody, DataError> {
    let (named, nodes) = (pose.axis_angles.len(), body.skeleton.len());
    if named > nodes {
        let problem = format!("{named} joints");
        let expected = format!("at most the body's {nodes}");
        return Err(DataError::invalid(path, "canonical_pose", problem, expected));
    }
    let pose = Pose::from_axis_angles(&body.skeleton, &pose.axis_angles, pose.translation);
    body.in_pose(&pose).map_err(|error| DataError::scene(path, error))
}

/// How many joints a pose turns and how far, and where it moves the body.
fn turns(pose: &CanonicalPose) -> String {
    let angles: Vec<f64> = pose.axis_angles.iter().map(|axis| axis.length().to_degrees()).collect();
    let turned = angles.iter().filter(|angle| **angle > 0.0).count();
    let widest = angles.iter().copied().fold(0.0, f64::max);
    let moved = format!("moved by {:.3} m", pose.translation.length());
    match (turned, pose.translation.length() > 0.0) {
        (0, _) => moved,
        (_, false) => format!("{turned} joints turned by up to {widest:.0}°"),
        (_, true) => format!("{turned} joints turned by up to {widest:.0}°, {moved}"),
    }
}
