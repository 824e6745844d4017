//! Which parameters of a Gaussian are fitted.

use serde::{Deserialize, Serialize};

/// What is fitted. Colours always are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Free {
    /// How Gaussians may move in the rest pose.
    pub position: FreePosition,
    /// How they may turn.
    pub rotation: FreeRotation,
    /// Whether their standard deviations change.
    pub scale: FreeScale,
    /// Whether their opacities change.
    pub opacity: bool,
    /// No standard deviation grows beyond so many times that of the start; 0: no bound.
    #[serde(default, skip_serializing_if = "is_none")]
    pub scale_most: f32,
}

fn is_none(bound: &f32) -> bool {
    *bound == 0.0
}

/// How Gaussians may move in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FreePosition {
    /// Not at all.
    Fixed,
    /// Anywhere. Face-bound Gaussians slide in their triangle's plane and along the normal.
    Free,
    /// Along the normal of the surface on which they started.
    AlongNormal,
}

/// How Gaussians may turn in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FreeRotation {
    /// Not at all.
    Fixed,
    /// About the normal of the surface on which they started: one angle (iHuman).
    AboutNormal,
    /// Anyhow: a quaternion.
    Quaternion,
}

/// How the standard deviations of a Gaussian may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FreeScale {
    /// Not at all.
    Fixed,
    /// Those in the tangent plane (iHuman).
    InPlane,
    /// All three.
    All,
}
