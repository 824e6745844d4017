//! Canonical Gaussians and how they hang on a body.

use super::{RestBody, SceneError, SkinWeights};
use crate::math::portable;
use glam::Vec3;

/// Gaussians with the parameters of a 3DGS PLY, as stored there: nothing activated, so that a file round-trips bit for
/// bit and an optimiser can step on them.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gaussians {
    /// Positions, metres, in the rest pose of the body.
    pub means: Vec<Vec3>,
    /// Quaternions (w, x, y, z), not necessarily of unit length.
    pub rotations: Vec<[f32; 4]>,
    /// Natural logarithms of the standard deviations, metres; -∞ has no extent along its axis.
    pub log_scales: Vec<Vec3>,
    /// Opacities before the sigmoid; ±∞ are an opacity of 1 and of 0.
    pub opacity_logits: Vec<f32>,
    /// SH degree, 0 to 3.
    pub sh_degree: usize,
    /// `(sh_degree + 1)^2` RGB coefficients per Gaussian: `sh[i * k + c]` is coefficient c of Gaussian i.
    pub sh: Vec<[f32; 3]>,
}

/// What most parameters have to be.
const FINITE: &str = "finite values";

impl Gaussians {
    /// Number of Gaussians.
    #[inline]
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Coefficients per Gaussian and channel: `(sh_degree + 1)^2`.
    #[inline]
    pub fn sh_count(&self) -> usize {
        (self.sh_degree + 1).pow(2)
    }

    /// Unit quaternions (w, x, y, z), normalised in f64.
    pub fn unit_rotations(&self) -> Vec<[f32; 4]> {
        (0..self.rotations.len()).map(|i| self.unit_rotation(i)).collect()
    }

    /// The unit quaternion of Gaussian `i`.
    #[inline]
    pub fn unit_rotation(&self, i: usize) -> [f32; 4] {
        let q = self.rotations[i].map(f64::from);
        let norm = (((q[0] * q[0] + q[1] * q[1]) + q[2] * q[2]) + q[3] * q[3]).sqrt();
        q.map(|c| (c / norm) as f32)
    }

    /// Opacities after the sigmoid.
    pub fn opacities(&self) -> Vec<f32> {
        (0..self.opacity_logits.len()).map(|i| self.opacity(i)).collect()
    }

    /// The opacity of Gaussian `i`.
    #[inline]
    pub fn opacity(&self, i: usize) -> f32 {
        1.0 / (1.0 + portable::exp(-self.opacity_logits[i]))
    }

    /// Checks that all arrays have the same length, that every value is finite once it is activated (a logit may be
    /// infinite, a log scale -∞), that no quaternion is zero and that scales are representable.
    ///
    /// # Errors
    /// Names the first array and index that is wrong, in the names of the PLY properties.
    pub fn validate(&self) -> Result<(), SceneError> {
        let n = self.len();
        let counts = [
            ("rot", self.rotations.len(), n),
            ("scale", self.log_scales.len(), n),
            ("opacity", self.opacity_logits.len(), n),
            ("f_dc/f_rest", self.sh.len(), n * self.sh_count()),
        ];
        for (field, found, expected) in counts {
            if found != expected {
                return Err(SceneError::new(field, format!("{found} values"), format!("{expected}")));
            }
        }
        if self.sh_degree > 3 {
            return Err(SceneError::new("f_rest", format!("degree {}", self.sh_degree), "0 to 3"));
        }
        for i in 0..n {
            let sh = &self.sh[i * self.sh_count()..(i + 1) * self.sh_count()];
            let logs = self.log_scales[i].to_array();
            let checks = [
                ("x, y, z", self.means[i].is_finite(), FINITE),
                ("rot", self.rotations[i].iter().all(|v| v.is_finite()), FINITE),
                ("scale", logs.iter().all(|v| *v < f32::INFINITY), "finite logarithms of metres, or -inf"),
                ("opacity", !self.opacity_logits[i].is_nan(), "a finite logit, inf or -inf"),
                ("f_dc/f_rest", sh.iter().flatten().all(|v| v.is_finite()), FINITE),
            ];
            if let Some((field, _, expected)) = checks.iter().find(|(_, fine, _)| !fine) {
                return Err(SceneError::new(format!("{field}[{i}]"), "NaN or infinite", *expected));
            }
            if self.rotations[i].iter().all(|&v| v == 0.0) {
                return Err(SceneError::new(format!("rot[{i}]"), "zero quaternion", "a length above 0"));
            }
            if self.log_scales[i].max_element() > 40.0 {
                let problem = format!("log scale {}", self.log_scales[i].max_element());
                return Err(SceneError::new(
                    format!("scale[{i}]"),
                    problem,
                    "the logarithm of metres, at most 40",
                ));
            }
        }
        Ok(())
    }
}

/// Where face-bound Gaussians sit: `Σ barycentric_k v_k + offset * n` on a face of the body.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceBinding {
    /// Face index per Gaussian.
    pub faces: Vec<u32>,
    /// Barycentric coordinates per Gaussian, summing to one (they may leave \[0, 1\]).
    pub barycentric: Vec<[f32; 3]>,
    /// Offset along the interpolated unit vertex normal, metres.
    pub offsets: Vec<f32>,
}

/// How Gaussians move with a body.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Binding {
    /// Not at all: a static scene.
    Static,
    /// By linear blend skinning of their means (Eq. 6), with weights of their own.
    Vertex(SkinWeights),
    /// With a face of the posed mesh.
    Face(FaceBinding),
}

/// Canonical Gaussians and their binding.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Avatar {
    /// The Gaussians in the rest pose.
    pub gaussians: Gaussians,
    /// How they move.
    pub binding: Binding,
}

impl Avatar {
    /// Checks the Gaussians and, against a body, the binding: counts, joint and face indices, finite values,
    /// barycentric coordinates that sum to one.
    ///
    /// # Errors
    /// Names the first field that is wrong.
    pub fn validate(&self, body: Option<&RestBody>) -> Result<(), SceneError> {
        self.gaussians.validate()?;
        let n = self.gaussians.len();
        match &self.binding {
            Binding::Static => Ok(()),
            Binding::Vertex(weights) => {
                if weights.len() != n {
                    return Err(SceneError::new(
                        "weights",
                        format!("{} rows", weights.len()),
                        format!("{n}"),
                    ));
                }
                let Some(body) = body else { return Ok(()) };
                weights.check_joints("joint", body.skeleton.num_joints())
            }
            Binding::Face(binding) => binding.validate(n, body),
        }
    }
}

impl FaceBinding {
    fn validate(&self, n: usize, body: Option<&RestBody>) -> Result<(), SceneError> {
        let counts = [
            ("face", self.faces.len()),
            ("barycentric", self.barycentric.len()),
            ("offset", self.offsets.len()),
        ];
        for (field, found) in counts {
            if found != n {
                return Err(SceneError::new(field, format!("{found} values"), format!("{n}")));
            }
        }
        for i in 0..n {
            let sum: f64 = self.barycentric[i].iter().map(|&b| f64::from(b)).sum();
            if !((sum - 1.0).abs() <= 1e-3 && self.barycentric[i].iter().all(|b| b.is_finite())) {
                return Err(SceneError::new(format!("barycentric[{i}]"), format!("sum {sum}"), "a sum of 1"));
            }
            if !self.offsets[i].is_finite() {
                return Err(SceneError::new(format!("offset[{i}]"), "NaN or infinite", "metres"));
            }
            if let Some(body) = body
                && self.faces[i] as usize >= body.faces.len()
            {
                let expected = format!("an index below the body's {} faces", body.faces.len());
                return Err(SceneError::new(
                    format!("face[{i}]"),
                    format!("face {}", self.faces[i]),
                    expected,
                ));
            }
        }
        Ok(())
    }
}
