//! Posed Gaussians as plain static ones: what any rasterizer draws without knowing about bodies.

use glam::{DMat3, Mat3, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::math::{Matrix3, rotation, sh};
use skinsplat_core::scene::{ColourClamp, Gaussians, Posed};

/// Static Gaussians, and what they could not keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Baked {
    /// In world space, with unit quaternions.
    pub gaussians: Gaussians,
    /// What static Gaussians cannot express of the strategy, if anything.
    pub loss: Option<&'static str>,
}

/// View frames that are further than this from a rotation (Frobenius norm of FᵀF − I) lose something.
const FRAME_TOLERANCE: f32 = 1e-4;

/// Bakes a pose into static Gaussians. `canonical` is what was posed: opacities, and scales where only rotations changed,
/// keep its bits.
///
/// A view direction that is read in a frame F becomes SH rotated by Fᵀ (Eq. 9); exact where F is a rotation. A covariance
/// that is not rotated but deformed becomes the rotation and scales of its principal axes: exact.
pub fn bake(posed: &Posed<'_>, canonical: &Gaussians) -> Baked {
    let mut loss = None;
    let mut gaussians = Gaussians {
        means: posed.means.to_vec(),
        rotations: Vec::with_capacity(posed.len()),
        log_scales: Vec::with_capacity(posed.len()),
        opacity_logits: canonical.opacity_logits.clone(),
        sh_degree: posed.sh_degree,
        sh: posed.sh.to_vec(),
    };
    for (i, &factor) in posed.factors.iter().enumerate() {
        let (rotation, log_scale) = match posed.rotations {
            Some(rotations) => (rotations[i], log_norms(factor, canonical.log_scales[i])),
            None => {
                let (rotation, lengths) = principal_axes(factor);
                // A disc without thickness stays one.
                let flat = canonical.log_scales[i].min_element() == f32::NEG_INFINITY;
                let length = |ln: f32| if flat && ln <= NO_LENGTH { f32::NEG_INFINITY } else { ln };
                (rotation, Vec3::from_array(lengths.to_array().map(length)))
            }
        };
        gaussians.rotations.push(rotation);
        gaussians.log_scales.push(log_scale);
    }
    if posed.colour_clamp != ColourClamp::NonNegative {
        loss = Some("colours above 1 are not clamped in a static file");
    }
    if let Some(frames) = posed.view_frames {
        let count = (posed.sh_degree + 1).pow(2);
        for (coefficients, &frame) in gaussians.sh.chunks_exact_mut(count).zip(frames) {
            if !is_rotation(frame) {
                loss = Some(
                    "view directions were read in frames that are no rotations; SH are rotated by the nearest",
                );
            }
            let rotation = nearest(frame.transpose());
            sh::Rotation::<f32>::new(rotation, posed.sh_degree).apply(coefficients);
        }
    }
    Baked { gaussians, loss }
}

/// The logarithm of the smallest length that [`principal_axes`] gives, and a little.
const NO_LENGTH: f32 = -87.33;

/// Logarithms of the column norms of M = R diag(s): the canonical ones, bit for bit, unless the strategy changed sizes. What has no
/// length (a flat Gaussian's -inf) keeps it.
fn log_norms(factor: Mat3, canonical: Vec3) -> Vec3 {
    let columns = [factor.x_axis, factor.y_axis, factor.z_axis];
    let measured = columns.map(|c| portable::ln(c.as_dvec3().length()) as f32);
    let sizes = measured.iter().zip(canonical.to_array()).filter(|(measured, _)| measured.is_finite());
    if sizes.clone().all(|(measured, canonical)| (measured - canonical).abs() <= 1e-4) {
        return canonical;
    }
    let kept = |axis: usize| if measured[axis].is_finite() { measured[axis] } else { canonical[axis] };
    Vec3::new(kept(0), kept(1), kept(2))
}

/// Rotation (w, x, y, z) and log scales with R diag(s)² Rᵀ = M Mᵀ.
fn principal_axes(factor: Mat3) -> ([f32; 4], Vec3) {
    // One-sided Jacobi on the rows: W M has orthogonal rows, which are the axes' lengths.
    let mut rows = factor.as_dmat3().transpose();
    let mut axes = DMat3::IDENTITY;
    for _ in 0..30 {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (rows.col(p), rows.col(q));
            let (alpha, beta, gamma) = (a.length_squared(), b.length_squared(), a.dot(b));
            if gamma.abs() <= 1e-15 * (alpha * beta).sqrt() {
                continue;
            }
            rotated = true;
            let zeta = (beta - alpha) / (2.0 * gamma);
            let t = 1f64.copysign(zeta) / (zeta.abs() + portable::hypot(zeta, 1.0));
            let (c, s) = (portable::hypot(t, 1.0).recip(), t / portable::hypot(t, 1.0));
            (*rows.col_mut(p), *rows.col_mut(q)) = (a * c - b * s, a * s + b * c);
            let (a, b) = (axes.col(p), axes.col(q));
            (*axes.col_mut(p), *axes.col_mut(q)) = (a * c - b * s, a * s + b * c);
        }
        if !rotated {
            break;
        }
    }
    let lengths =
        [0, 1, 2].map(|k| portable::ln(rows.col(k).length().max(f64::from(f32::MIN_POSITIVE))) as f32);
    let row_major: Matrix3<f64> = axes.transpose().to_cols_array_2d();
    (rotation::matrix_to_quaternion(row_major).map(|c| c as f32), Vec3::from_array(lengths))
}

fn is_rotation(m: Mat3) -> bool {
    let gram = m.transpose() * m - Mat3::IDENTITY;
    m.determinant() > 0.0 && gram.to_cols_array().iter().all(|v| v.abs() <= FRAME_TOLERANCE)
}

/// The rotation nearest to m, row-major.
fn nearest(m: Mat3) -> Matrix3<f32> {
    let q = rotation::nearest_rotation(m.as_dmat3());
    Mat3::from_quat(q.as_quat()).transpose().to_cols_array_2d()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use skinsplat_core::math::matrix3;

    fn covariance(rotation: [f32; 4], log_scale: Vec3) -> Mat3 {
        let [w, x, y, z] = rotation;
        let m = Mat3::from_quat(Quat::from_xyzw(x, y, z, w)) * Mat3::from_diagonal(log_scale.map(f32::exp));
        m * m.transpose()
    }

    #[test]
    fn principal_axes_keep_the_covariance() {
        for seed in 1..200u32 {
            let value = |k: u32| ((seed * 7919 + k * 104_729) % 1000) as f32 / 500.0 - 1.0;
            let columns: [f32; 9] = std::array::from_fn(|k| value(k as u32));
            let factor = Mat3::from_cols_array(&columns);
            let (rotation, log_scale) = principal_axes(factor);
            let error = covariance(rotation, log_scale) - factor * factor.transpose();
            assert!(error.to_cols_array().iter().all(|e| e.abs() < 3e-6), "{error} for {factor}");
            assert!(matrix3::is_finite(rotation::quaternion_to_matrix(rotation)), "{rotation:?}");
        }
    }

    #[test]
    fn a_flat_gaussian_grows_where_it_has_a_length() {
        let canonical = Vec3::new(-2.5, -2.0, f32::NEG_INFINITY);
        let factor = |s: f32| Mat3::from_diagonal(canonical.map(|ln| s * ln.exp()));
        assert_eq!(log_norms(factor(1.0), canonical), canonical);
        let small = log_norms(factor(0.01), canonical);
        assert!((small.x - (-2.5 + 0.01f32.ln())).abs() < 1e-5, "{small}");
        assert_eq!(small.z, f32::NEG_INFINITY);
    }

    #[test]
    fn flat_and_empty_factors_stay_finite() {
        for factor in [Mat3::ZERO, Mat3::from_diagonal(Vec3::new(1.0, 0.0, 0.0))] {
            let (rotation, log_scale) = principal_axes(factor);
            assert!(log_scale.is_finite() && rotation.iter().all(|c| c.is_finite()));
        }
    }
}
