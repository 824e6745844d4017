//! Rotations that are canonical on another mesh than the body's at rest (SplattingAvatar).

use glam::DVec3;
use rayon::prelude::*;
use skinsplat_core::math::{matrix3, rotation};
use skinsplat_core::scene::{FaceBinding, RestBody};
use skinsplat_data::Error as DataError;
use skinsplat_data::avatar::CanonicalMesh;
use skinsplat_posing::FaceFrame;
use skinsplat_posing::face_frame::frame;
use std::path::Path;

/// Rotations that are canonical on a mesh, each carried by its face to the body in its rest pose.
pub(super) fn at_rest(
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
