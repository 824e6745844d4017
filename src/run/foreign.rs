//! Avatars that were made elsewhere, on the body of a subject.

use super::Error;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use skinsplat_core::math::{matrix3, rotation};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, RestBody, SkinWeights};
use skinsplat_data::Error as DataError;
use skinsplat_data::avatar::{CanonicalMesh, LoadedAvatar};
use skinsplat_posing::FaceFrame;
use skinsplat_posing::face_frame::frame;
use skinsplat_posing::nearest::NearestFace;
use std::path::Path;

/// The avatar as it hangs on a body, and what a reader of its numbers has to know: Gaussians that name no binding take the
/// skinning weights of the nearest points of the body's surface, rotations that are canonical on another mesh are carried to
/// the rest pose.
///
/// # Errors
/// An avatar that does not fit the body.
pub fn on_body(loaded: LoadedAvatar, body: &RestBody) -> Result<(Avatar, Vec<String>), Error> {
    let bound = loaded.is_bound();
    let LoadedAvatar { mut avatar, canonical, files, mut notes, .. } = loaded;
    let path = &files[0];
    if !bound {
        avatar.binding = Binding::Vertex(nearest_weights(&avatar.gaussians.means, body, path)?);
        notes.push(
            "no binding in the file: skinning weights of the nearest points of the body's surface".into(),
        );
    }
    avatar.validate(Some(body)).map_err(|error| DataError::scene(path, error))?;
    if let (Some(mesh), Binding::Face(binding)) = (&canonical, &avatar.binding) {
        avatar.gaussians.rotations = at_rest(&avatar.gaussians.rotations, binding, mesh, body, path)?;
    }
    Ok((avatar, notes))
}

/// Skinning weights of the points of a body's surface that are nearest to some points.
fn nearest_weights(points: &[Vec3], body: &RestBody, path: &Path) -> Result<SkinWeights, DataError> {
    let no_faces = || {
        let expected = "joint_* and weight_* properties, or a body with faces to take them from";
        DataError::invalid(path, "joint_0", "no binding, and the body has no faces", expected)
    };
    let surface = NearestFace::new(body).ok_or_else(no_faces)?;
    let row = |point: &Vec3| {
        let nearest = surface.nearest(point.as_dvec3(), None);
        body.weights_at(nearest.face, nearest.barycentric)
    };
    let rows: Vec<_> = points.par_iter().map(row).collect();
    SkinWeights::from_rows(rows, body.skeleton.num_joints()).map_err(|error| DataError::scene(path, error))
}

/// Rotations that are canonical on a mesh, each carried by its face to the body in its rest pose.
fn at_rest(
    rotations: &[[f32; 4]],
    binding: &FaceBinding,
    mesh: &CanonicalMesh,
    body: &RestBody,
    path: &Path,
) -> Result<Vec<[f32; 4]>, DataError> {
    if mesh.faces != body.faces {
        let found = format!("{} faces, {} vertices", mesh.faces.len(), mesh.vertices.len());
        let expected =
            format!("those of the body, in its order: {} faces, {}", body.faces.len(), body.vertices.len());
        return Err(DataError::invalid(path, "cano_mesh", found, format!("{expected} vertices")));
    }
    let frame_on = |vertices: &[DVec3], face: u32| {
        let corners = body.faces[face as usize].map(|v| vertices[v as usize].as_vec3());
        frame(FaceFrame::SplattingAvatar, corners)
    };
    let carried = |(rotation, &face): (&[f32; 4], &u32)| {
        let frames = frame_on(&mesh.vertices, face).zip(frame_on(&body.vertices, face));
        frames.map_or(*rotation, |(from, to)| {
            let turn = rotation::matrix_to_quaternion(matrix3::multiply(to, matrix3::transpose(from)));
            rotation::multiply(turn, *rotation)
        })
    };
    Ok(rotations.par_iter().zip(&binding.faces).map(carried).collect())
}
