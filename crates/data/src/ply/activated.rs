//! Files that hold what is drawn instead of what is optimised.
//!
//! iHuman's `SavePly` (animatableGaussian/utils.py) writes standard deviations, opacities and, behind band 0, SH coefficient
//! by coefficient, under the names of the 3DGS layout. Nothing in the header tells, but its Gaussians are discs of 1 mm: the
//! first scale is 0.001 everywhere, while as a logarithm it would be a standard deviation of a metre.

use super::read::Dialect;
use glam::Vec3;
use skinsplat_core::math::portable;
use skinsplat_core::scene::Gaussians;

/// Thickness of iHuman's discs, metres.
const THICKNESS: f32 = 1e-3;
/// No disc on a body is wider, metres.
const WIDEST: f32 = 2.0;

/// True if the numbers, read as a standard file has them, are those of iHuman: every first scale is 1 mm within a
/// hundredth, the others lie above 0, and every opacity lies within \[0, 1\].
pub(super) fn recognised(stored: &Gaussians) -> bool {
    let is_disc =
        |s: &Vec3| (s.x - THICKNESS).abs() <= 0.01 * THICKNESS && s.y.min(s.z) > 0.0 && s.y.max(s.z) < WIDEST;
    !stored.is_empty() && stored.log_scales.iter().all(is_disc) && are_opacities(stored)
}

fn are_opacities(stored: &Gaussians) -> bool {
    stored.opacity_logits.iter().all(|opacity| (0.0..=1.0).contains(opacity))
}

/// The same Gaussians as a standard file has them.
pub(super) fn standard(mut stored: Gaussians) -> Gaussians {
    for scale in &mut stored.log_scales {
        *scale = scale.map(portable::ln);
    }
    for opacity in &mut stored.opacity_logits {
        *opacity = logit(f64::from(*opacity));
    }
    let (count, rest) = (stored.sh_count(), stored.sh_count() - 1);
    for coefficients in stored.sh.chunks_exact_mut(count) {
        let flat: Vec<f32> = [0, 1, 2]
            .iter()
            .flat_map(|&channel: &usize| coefficients[1..].iter().map(move |rgb| rgb[channel]))
            .collect();
        for k in 0..rest {
            coefficients[1 + k] = [flat[3 * k], flat[3 * k + 1], flat[3 * k + 2]];
        }
    }
    stored
}

/// The number whose sigmoid an opacity is; ±∞ for 1 and 0.
pub(crate) fn logit(opacity: f64) -> f32 {
    portable::ln(opacity / (1.0 - opacity)) as f32
}

/// What has to be said of how the numbers were read.
pub(super) fn note(gaussians: &Gaussians, dialect: Dialect) -> Option<String> {
    match dialect {
        Dialect::Compressed => None,
        Dialect::Activated => Some(
            "scales of 1 mm and opacities within [0, 1] in every row: read as iHuman's SavePly writes them (activated, SH \
             coefficient by coefficient), in the pose in which they were saved"
                .to_owned(),
        ),
        Dialect::Standard => {
            let are_large = |s: &Vec3| s.min_element() > 0.0;
            let odd = !gaussians.is_empty()
                && gaussians.log_scales.iter().all(are_large)
                && are_opacities(gaussians);
            odd.then(|| {
                "every scale is above 1 m and every opacity logit within [0, 1]: activated values? They were read as \
                 logarithms and logits, as 3DGS stores them"
                    .to_owned()
            })
        }
    }
}
