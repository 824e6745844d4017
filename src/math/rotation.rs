//! Rotations of 3-space: conversions, projections of a blended matrix onto the rotations.

use glam::{DMat3, DQuat};

/// The rotation nearest to `m` (Frobenius norm), as a unit quaternion.
pub fn nearest_rotation(m: DMat3) -> DQuat {
    DQuat::from_mat3(&m)
}
