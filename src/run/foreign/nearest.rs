//! The binding of Gaussians that name none.

use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::scene::{RestBody, SkinWeights};
use skinsplat_data::Error as DataError;
use skinsplat_posing::nearest::NearestFace;
use std::path::Path;

/// Skinning weights of the points of a body's surface that are nearest to some points.
pub(super) fn nearest_weights(
    points: &[Vec3],
    body: &RestBody,
    path: &Path,
) -> Result<SkinWeights, DataError> {
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
