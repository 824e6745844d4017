//! The surface whose vertices move along their normals.

use crate::silhouette::Topology;
use crate::subdivide::Subdivided;
use glam::DVec3;
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{RestBody, SceneError};

/// A body's mesh, subdivided once.
pub(super) struct Surface {
    pub(super) body: RestBody,
    /// Unit vertex normals of the rest mesh; zero where there is no face.
    pub(super) normals: Vec<DVec3>,
    pub(super) topology: Topology,
}

impl Surface {
    /// The surface of a body, and offsets on it that are linear between those at the body's vertices.
    pub(super) fn new(body: &RestBody, offsets: &[f32]) -> Result<(Self, Vec<f32>), SceneError> {
        let fine = Subdivided::new(body)?;
        let offsets = fine.interpolated(offsets);
        let normals = vertex_normals(&fine.body.vertices, &fine.body.faces);
        let topology = Topology::new(&fine.body.faces);
        Ok((Self { body: fine.body, normals, topology }, offsets))
    }
}
