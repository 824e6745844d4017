//! Derivatives of a scalar loss, one type per station of the road that an optimiser walks backwards: what was rendered,
//! [`Posed`], the parameters of an [`Avatar`](super::Avatar), and on a branch the posed body and its [`Pose`](super::Pose).

use super::{Gaussians, Image, Mask, Posed};
use glam::{DMat3, DVec3, Mat3, Vec3};

/// Derivatives with respect to what a renderer returned.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedGradient {
    /// With respect to the colour over the background.
    pub image: Image,
    /// With respect to alpha, `1 − final transmittance`, which does not know the background; `None` for zero.
    pub alpha: Option<Mask>,
}

/// Derivatives with respect to the fields of a [`Posed`]. All arrays have one entry per Gaussian (`sh`: one per
/// coefficient; `view_frames`: none unless `Posed` has some); Gaussians that did not reach the image have zeros.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedGradient {
    /// World positions.
    pub means: Vec<Vec3>,
    /// Every entry of M (Σ = M Mᵀ) by itself, columns as in `Posed::factors`.
    pub factors: Vec<Mat3>,
    /// Opacities after the sigmoid.
    pub opacities: Vec<f32>,
    /// SH coefficients, in the order of `Posed::sh`.
    pub sh: Vec<[f32; 3]>,
    /// Every entry of the frames in which view directions are read, by itself; empty where `Posed` has none.
    pub view_frames: Vec<Mat3>,
    /// The position on screen, per half image width and half image height (the NDC units of the original kernels, which
    /// the thresholds of densification are stated in).
    pub screen: Vec<[f32; 2]>,
    /// Radius on screen by the rule of the original kernels, pixels; 0 for Gaussians that did not reach the image.
    pub radii: Vec<f32>,
}

impl PosedGradient {
    /// Makes every array fit `posed` and fills it with zeros; keeps its memory.
    pub fn reset(&mut self, posed: &Posed) {
        let n = posed.len();
        refill(&mut self.means, n, Vec3::ZERO);
        refill(&mut self.factors, n, Mat3::ZERO);
        refill(&mut self.opacities, n, 0.0);
        refill(&mut self.sh, posed.sh.len(), [0.0; 3]);
        refill(&mut self.view_frames, posed.view_frames.map_or(0, <[_]>::len), Mat3::ZERO);
        refill(&mut self.screen, n, [0.0; 2]);
        refill(&mut self.radii, n, 0.0);
    }
}

/// Derivatives with respect to the stored (not activated) parameters of an avatar, in the order of its [`Gaussians`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AvatarGradient {
    /// Canonical positions; zeros for face-bound Gaussians, whose means are not read.
    pub means: Vec<Vec3>,
    /// Quaternions (w, x, y, z) as stored: includes the normalisation.
    pub rotations: Vec<[f32; 4]>,
    /// Logarithms of the standard deviations.
    pub log_scales: Vec<Vec3>,
    /// Opacities before the sigmoid.
    pub opacity_logits: Vec<f32>,
    /// SH coefficients.
    pub sh: Vec<[f32; 3]>,
    /// Barycentric coordinates of face-bound Gaussians, each by itself; empty for other bindings.
    pub barycentric: Vec<[f32; 3]>,
    /// Offsets of face-bound Gaussians along the interpolated unit vertex normal; empty for other bindings.
    pub offsets: Vec<f32>,
}

impl AvatarGradient {
    /// Makes every array fit and fills it with zeros; keeps its memory.
    pub fn reset(&mut self, gaussians: &Gaussians, face_bound: bool) {
        let n = gaussians.len();
        refill(&mut self.means, n, Vec3::ZERO);
        refill(&mut self.rotations, n, [0.0; 4]);
        refill(&mut self.log_scales, n, Vec3::ZERO);
        refill(&mut self.opacity_logits, n, 0.0);
        refill(&mut self.sh, gaussians.sh.len(), [0.0; 3]);
        let bound = if face_bound { n } else { 0 };
        refill(&mut self.barycentric, bound, [0.0; 3]);
        refill(&mut self.offsets, bound, 0.0);
    }
}

/// Derivatives with respect to what posing reads of a [`PosedBody`](super::PosedBody): the motions of its joints, and the mesh
/// where a strategy or a binding reads that. All summed in `f64`, in an order that no thread changes.
///
/// How large joints are counts as a constant: no rotation of a joint changes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyGradient {
    /// Per joint, every entry of [`JointTransform::linear`](super::JointTransform) by itself.
    pub linear: Vec<DMat3>,
    /// Per joint, the translation.
    pub translations: Vec<DVec3>,
    /// Per joint, a further rotation of [`JointTransform::rotation`](super::JointTransform) alone, `exp(ω) R` about the axes of
    /// the world, radians.
    pub torques: Vec<DVec3>,
    /// Per vertex of the posed mesh, its position; empty if the mesh was not read.
    pub vertices: Vec<DVec3>,
    /// Per vertex of the posed mesh, its unit normal; empty if the mesh was not read.
    pub normals: Vec<DVec3>,
}

impl BodyGradient {
    /// Zeros for a number of joints, and for no mesh; keeps its memory.
    pub fn reset(&mut self, joints: usize) {
        refill(&mut self.linear, joints, DMat3::ZERO);
        refill(&mut self.translations, joints, DVec3::ZERO);
        refill(&mut self.torques, joints, DVec3::ZERO);
        self.vertices.clear();
        self.normals.clear();
    }

    /// The derivatives with respect to vertices and normals of a mesh, zeros if they are asked for the first time.
    pub fn mesh_mut(&mut self, vertices: usize) -> (&mut [DVec3], &mut [DVec3]) {
        self.vertices.resize(vertices, DVec3::ZERO);
        self.normals.resize(vertices, DVec3::ZERO);
        (&mut self.vertices, &mut self.normals)
    }
}

/// Derivatives with respect to a [`Pose`](super::Pose) at zero of the vectors of [`Pose::turned`](super::Pose::turned).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseGradient {
    /// Per skeleton node, a further rotation `exp(ω) R` of its local rotation, about the axes of its parent, radians.
    pub rotations: Vec<DVec3>,
    /// [`Pose::translation`](super::Pose::translation), metres.
    pub translation: DVec3,
}

impl std::ops::AddAssign for PoseGradient {
    /// # Panics
    /// If the two are of other numbers of nodes.
    fn add_assign(&mut self, other: Self) {
        assert_eq!(self.rotations.len(), other.rotations.len(), "one derivative per node");
        self.rotations.iter_mut().zip(other.rotations).for_each(|(own, other)| *own += other);
        self.translation += other.translation;
    }
}

fn refill<T: Clone>(values: &mut Vec<T>, count: usize, zero: T) {
    values.clear();
    values.resize(count, zero);
}
