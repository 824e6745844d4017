//! Gaussians, joints and influences of one dispatch, and what comes back.

use super::layout::{self, Params};
use skinsplat_core::math::Quaternion;

/// Coefficients that a batch holds per Gaussian: degree 3.
pub const COEFFICIENTS: usize = 16;

/// A Gaussian of the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Metres.
    pub mean: [f32; 3],
    /// (w, x, y, z), of unit length.
    pub rotation: Quaternion<f32>,
    /// Standard deviations, metres.
    pub scale: [f32; 3],
}

/// What a dispatch reads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Motions relative to the rest pose: quaternion (w, x, y, z) of unit length, translation in metres.
    pub joints: Vec<(Quaternion<f32>, [f32; 3])>,
    /// The Gaussians.
    pub gaussians: Vec<Gaussian>,
    /// Sets of four influences per Gaussian.
    pub influence_sets: usize,
    /// Joints of each Gaussian, four per set; any valid one where the weight is 0.
    pub indices: Vec<u32>,
    /// Weights of these joints; they need not sum to one.
    pub weights: Vec<f32>,
    /// SH of each Gaussian in the order of 3DGS, [`COEFFICIENTS`] of them.
    pub sh: Vec<[[f32; 3]; COEFFICIENTS]>,
    /// World position of the eye, metres.
    pub camera: [f32; 3],
    /// Steps of [`crate::Rotation::Power`].
    pub power_steps: u32,
}

impl Batch {
    /// An empty batch with four influences per Gaussian and the paper's fifteen power steps.
    pub fn new(camera: [f32; 3]) -> Self {
        Self { influence_sets: 1, camera, power_steps: 15, ..Self::default() }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// No Gaussian.
    pub fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    /// Adds a Gaussian that hangs on joints of its own; fewer than the sets hold are padded with weight 0.
    ///
    /// # Panics
    /// If there are more bones than the sets hold.
    pub fn push(
        &mut self,
        gaussian: Gaussian,
        bones: &[(Quaternion<f32>, [f32; 3])],
        weights: &[f32],
        sh: [[f32; 3]; COEFFICIENTS],
    ) {
        let places = 4 * self.influence_sets;
        assert!(bones.len() <= places && bones.len() == weights.len(), "at most {places} influences");
        let first = self.joints.len() as u32;
        self.joints.extend(bones);
        for k in 0..places {
            let counts = k < bones.len();
            self.indices.push(if counts { first + k as u32 } else { first });
            self.weights.push(if counts { weights[k] } else { 0.0 });
        }
        self.gaussians.push(gaussian);
        self.sh.push(sh);
    }

    /// The influences of a Gaussian: joints and weights.
    pub fn influences(&self, i: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let row = 4 * self.influence_sets * i..4 * self.influence_sets * (i + 1);
        let weights = self.weights[row.clone()].iter().copied();
        self.indices[row].iter().map(|&joint| joint as usize).zip(weights)
    }

    /// The uniform block of a dispatch of all Gaussians, SH stored coefficient by coefficient.
    pub fn params(&self) -> Params {
        Params {
            count: self.len() as u32,
            first: 0,
            influence_sets: self.influence_sets as u32,
            power_steps: self.power_steps,
            camera: self.camera,
            sh_degree: 3,
            sh_stride: 3,
            sh_coefficient_stride: 3 * self.len() as u32,
        }
    }

    /// The joints' buffer.
    pub fn joint_words(&self) -> Vec<[f32; 8]> {
        self.joints.iter().map(|&(q, t)| layout::joint(q, t)).collect()
    }

    /// The Gaussians' buffer.
    pub fn gaussian_words(&self) -> Vec<[f32; 12]> {
        self.gaussians.iter().map(|g| layout::gaussian(g.mean, g.rotation, g.scale)).collect()
    }

    /// The SH's buffer, coefficient by coefficient.
    pub fn sh_words(&self) -> Vec<[f32; 3]> {
        (0..COEFFICIENTS).flat_map(|k| self.sh.iter().map(move |own| own[k])).collect()
    }
}

/// What came back. Vectors of what an entry point does not write are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Posed {
    /// World positions.
    pub means: Vec<[f32; 3]>,
    /// xx, xy, xz, yy, yz, zz.
    pub covariances: Vec<[f32; 6]>,
    /// Posed rotations (w, x, y, z).
    pub quaternions: Vec<Quaternion<f32>>,
    /// Rotations relative to the rest pose (w, x, y, z).
    pub relatives: Vec<Quaternion<f32>>,
    /// View directions in the frame of the rest pose.
    pub views: Vec<[f32; 3]>,
    /// Turned SH.
    pub turned_sh: Vec<[[f32; 3]; COEFFICIENTS]>,
    /// RGB, not below 0.
    pub colours: Vec<[f32; 3]>,
}
