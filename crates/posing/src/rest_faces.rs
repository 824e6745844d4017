//! The faces of the rest mesh as face strategies need them.

use super::face_frame::{self, FaceFrame, Frame};
use glam::Vec3;
use skinsplat_core::scene::{PosedMesh, RestBody, body};

/// The rest mesh, and frames, areas and sizes, one per face of a body.
#[derive(Clone, Debug)]
pub(crate) struct RestFaces {
    /// Vertices and vertex normals.
    pub(crate) mesh: PosedMesh,
    /// Vertex indices.
    pub(crate) corners: Vec<[u32; 3]>,
    /// The frame along v0→v1 (SplattingAvatar's; iHuman's differs from it by a constant); `None` without area.
    pub(crate) edge01: Vec<Option<Frame>>,
    /// The frame along v1→v2 (HAHA's).
    pub(crate) edge12: Vec<Option<Frame>>,
    /// Square metres.
    pub(crate) areas: Vec<f32>,
    /// Metres; what the means of [`FaceFrame::HahaScaled`] are measured from.
    pub(crate) centroids: Vec<Vec3>,
    /// HAHA's k.
    pub(crate) sizes: Vec<f32>,
}

impl RestFaces {
    /// Reads every face of a body.
    pub(crate) fn new(body: &RestBody) -> Self {
        let vertices: Vec<Vec3> = body.vertices.iter().map(|v| v.as_vec3()).collect();
        let triangles: Vec<[Vec3; 3]> = body.faces.iter().map(|f| f.map(|v| vertices[v as usize])).collect();
        let normals = body::vertex_normals(&body.vertices, &body.faces);
        let frames = |kind| triangles.iter().map(|&t| face_frame::frame(kind, t)).collect();
        Self {
            corners: body.faces.clone(),
            edge01: frames(FaceFrame::SplattingAvatar),
            edge12: frames(FaceFrame::Haha),
            areas: triangles.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).collect(),
            centroids: triangles.iter().map(face_frame::centroid).collect(),
            sizes: triangles.iter().map(face_frame::haha_size).collect(),
            mesh: PosedMesh { vertices, normals: normals.iter().map(|n| n.as_vec3()).collect() },
        }
    }

    /// The rest frames that a kind of frame is rotated from, and the kind that they were built as. iHuman's frame is
    /// SplattingAvatar's times a constant, which cancels between two poses.
    pub(crate) fn frames(&self, kind: FaceFrame) -> (FaceFrame, &[Option<Frame>]) {
        match kind {
            FaceFrame::SplattingAvatar | FaceFrame::IHuman => (FaceFrame::SplattingAvatar, &self.edge01),
            FaceFrame::Haha | FaceFrame::HahaScaled => (FaceFrame::Haha, &self.edge12),
        }
    }
}
