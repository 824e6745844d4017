//! Are the axes of a camera a rotation?

use glam::DMat3;
use skinsplat_core::math::portable;

/// How far an entry of RᵀR may be from the identity's: files hold f32, and text that somebody rounded.
const TOLERANCE: f64 = 1e-2;

/// What the axes of a camera should be.
pub(crate) const RIGID: &str = "a rotation: axes of length 1 at right angles, determinant 1 (within 0.01)";

/// What is wrong with the axes of a camera, if they are no rotation.
pub(crate) fn fault(axes: DMat3) -> Option<String> {
    let is_orthonormal = |m: DMat3| (m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, TOLERANCE);
    let determinant = axes.determinant();
    let factor = portable::cbrt(determinant.abs());
    let mirrored = if determinant < 0.0 { "a mirror image of a rotation" } else { "a rotation" };
    match is_orthonormal(axes) {
        true if determinant > 0.0 => None,
        true => Some(format!("{mirrored} (determinant {determinant:.3})")),
        false if is_orthonormal(axes * factor.recip()) => {
            Some(format!("{mirrored} times {factor:.4}: of a world in other units"))
        }
        false => {
            let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(glam::DVec3::length);
            Some(format!("no rotation: axes of lengths {x:.3}, {y:.3}, {z:.3}, determinant {determinant:.3}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn rotations_pass_as_files_hold_them_and_nothing_else_does() {
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.1));
        assert_eq!(fault(turn), None);
        assert_eq!(fault(turn.as_mat3().as_dmat3()), None);
        let rounded = turn.to_cols_array().map(|v| (v * 1e3).round() / 1e3);
        assert_eq!(fault(DMat3::from_cols_array(&rounded)), None, "three decimals");
        let along = |x, y, z| fault(turn * DMat3::from_diagonal(DVec3::new(x, y, z))).unwrap();
        assert!(along(3.0, 1.0, 1.0).starts_with("no rotation: axes of lengths 3.000, 1.000"));
        assert!(along(2.0, 2.0, 2.0).starts_with("a rotation times 2.0000"));
        assert!(along(-1.0, 1.0, 1.0).starts_with("a mirror image of a rotation (determinant -1.000)"));
        assert!(along(-0.5, 0.5, 0.5).starts_with("a mirror image of a rotation times 0.5000"));
        for odd in [0.0, 1e300, f64::NAN] {
            assert!(along(odd, odd, odd).starts_with("no rotation"), "{odd}");
        }
    }
}
