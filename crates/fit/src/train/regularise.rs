//! Terms of the loss that look at the parameters and not at images, with their derivatives.

use super::parameters::Origin;
use crate::recipe::{LongThin, LossTerms};
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, AvatarGradient, Binding};

/// Which Gaussians the loss of a frame depends on, as its derivative says.
pub(super) fn seen(gradient: &AvatarGradient) -> Vec<bool> {
    gradient.opacity_logits.iter().map(|&slope| slope != 0.0).collect()
}

/// Adds the derivatives of all terms to `gradient` and returns their weighted sum. Sizes and opacities count of the Gaussians that are
/// `seen`: nothing would hold the others, and steps of Adam are as long for small derivatives as for large ones.
pub(super) fn add(
    terms: &LossTerms,
    avatar: &Avatar,
    origins: &[Origin],
    seen: &[bool],
    gradient: &mut AvatarGradient,
) -> f64 {
    let n = avatar.gaussians.len() as f32;
    let mut total = 0.0;
    if terms.long_thin > 0.0 || terms.scale > 0.0 {
        let weight = terms.scale / (3.0 * n);
        total += in_parts(&avatar.gaussians.log_scales, seen, &mut gradient.log_scales, |log_scale, out| {
            let scale = log_scale.map(portable::exp);
            let square = scale * scale;
            *out += 2.0 * weight * square;
            let long = match terms.long_thin_form {
                LongThin::Excess => excess(terms, scale, terms.long_thin / n, out),
                LongThin::SplattingAvatar => 0.0,
            };
            f64::from(weight * square.element_sum()) + f64::from(long)
        });
    }
    if terms.long_thin > 0.0 && terms.long_thin_form == LongThin::SplattingAvatar {
        total += needles(terms, avatar, gradient);
    }
    if terms.opacity > 0.0 {
        let weight = terms.opacity / n;
        total +=
            in_parts(&avatar.gaussians.opacity_logits, seen, &mut gradient.opacity_logits, |logit, out| {
                let opacity = 1.0 / (1.0 + portable::exp(-logit));
                *out += 2.0 * weight * opacity * opacity * (1.0 - opacity);
                f64::from(weight * opacity * opacity)
            });
    }
    if terms.sh_rest > 0.0 {
        total += sh_rest(terms.sh_rest / n, avatar, gradient);
    }
    if terms.displacement > 0.0 {
        total += displacement(terms.displacement / n, avatar, origins, gradient);
    }
    total
}

/// Rows of parameters per unit of parallel work: fixed, so that sums do not depend on the number of threads.
const PART: usize = 4096;

/// The sum of a term over the Gaussians that are seen, which adds its derivatives on the way.
fn in_parts<P: Sync, D: Send>(
    parameters: &[P],
    seen: &[bool],
    gradient: &mut [D],
    term: impl Fn(&P, &mut D) -> f64 + Sync,
) -> f64 {
    let parts = parameters.par_chunks(PART).zip(seen.par_chunks(PART)).zip(gradient.par_chunks_mut(PART));
    let sums: Vec<f64> = parts
        .map(|((own, seen), out)| {
            let all = own.iter().zip(seen).zip(out);
            all.filter(|((_, seen), _)| **seen).map(|((own, _), out)| term(own, out)).sum()
        })
        .collect();
    sums.iter().sum()
}

/// `weight` times `max(a/b - ratio, 0) + max(a - limit, 0)` for the largest standard deviation a and the second b.
fn excess(terms: &LossTerms, scale: Vec3, weight: f32, out: &mut Vec3) -> f32 {
    if weight == 0.0 {
        return 0.0;
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| scale[j].total_cmp(&scale[i]));
    let [first, second, _] = order;
    let (long, short) = (scale[first], scale[second]);
    let (excess, beyond) = (long / short - terms.long_thin_ratio, long - terms.long_thin_limit);
    let mut value = 0.0;
    if excess > 0.0 {
        value += weight * excess;
        out[first] += weight * long / short;
        out[second] -= weight * long / short;
    }
    if beyond > 0.0 {
        value += weight * beyond;
        out[first] += weight * long;
    }
    value
}

/// [`LongThin::SplattingAvatar`].
fn needles(terms: &LossTerms, avatar: &Avatar, gradient: &mut AvatarGradient) -> f64 {
    let scales = avatar.gaussians.log_scales.iter().map(|log_scale| log_scale.map(portable::exp));
    let found: Vec<(usize, f32, usize)> = scales
        .enumerate()
        .filter_map(|(i, scale)| {
            let (longest, shortest) = (scale.max_element(), scale.min_element());
            let counts = longest > terms.long_thin_limit && longest > terms.long_thin_ratio * shortest;
            counts.then(|| (i, longest, scale.max_position()))
        })
        .collect();
    let weight = terms.long_thin / found.len().max(1) as f32;
    for &(i, longest, axis) in &found {
        gradient.log_scales[i][axis] += weight * longest;
    }
    found.iter().map(|&(_, longest, _)| f64::from(weight * longest)).sum()
}

/// `weight` times the sum of the squared SH coefficients beyond degree 0.
fn sh_rest(weight: f32, avatar: &Avatar, gradient: &mut AvatarGradient) -> f64 {
    let count = avatar.gaussians.sh_count();
    let parts = avatar.gaussians.sh.par_chunks(PART * count).zip(gradient.sh.par_chunks_mut(PART * count));
    let sums: Vec<f64> = parts
        .map(|(own, out)| {
            let rows = own.chunks_exact(count).zip(out.chunks_exact_mut(count));
            rows.map(|(own, out)| {
                let mut sum = 0.0;
                for (own, out) in own[1..].as_flattened().iter().zip(out[1..].as_flattened_mut()) {
                    sum += own * own;
                    *out += 2.0 * weight * own;
                }
                f64::from(sum)
            })
            .sum()
        })
        .collect();
    f64::from(weight) * sums.iter().sum::<f64>()
}

/// `weight` times the sum of the squared distances from the start (of face-bound Gaussians: along the normal).
fn displacement(weight: f32, avatar: &Avatar, origins: &[Origin], gradient: &mut AvatarGradient) -> f64 {
    let from_start = |mean: &Vec3, origin: &Origin, out: &mut Vec3| {
        let way = *mean - origin.mean;
        *out += 2.0 * weight * way;
        f64::from(weight * way.length_squared())
    };
    let along_normal = |offset: &f32, origin: &Origin, out: &mut f32| {
        let way = offset - origin.height;
        *out += 2.0 * weight * way;
        f64::from(weight * way * way)
    };
    match &avatar.binding {
        Binding::Static => 0.0,
        Binding::Vertex(_) => with_origins(&avatar.gaussians.means, origins, &mut gradient.means, from_start),
        Binding::Face(binding) => {
            with_origins(&binding.offsets, origins, &mut gradient.offsets, along_normal)
        }
    }
}

/// [`in_parts`] of a term that knows where each Gaussian started.
fn with_origins<P: Sync, D: Send>(
    parameters: &[P],
    origins: &[Origin],
    gradient: &mut [D],
    term: impl Fn(&P, &Origin, &mut D) -> f64 + Sync,
) -> f64 {
    let parts = parameters.par_chunks(PART).zip(origins.par_chunks(PART)).zip(gradient.par_chunks_mut(PART));
    let sums: Vec<f64> = parts
        .map(|((own, origins), out)| {
            own.iter().zip(origins).zip(out).map(|((own, origin), out)| term(own, origin, out)).sum()
        })
        .collect();
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::Recipe;
    use skinsplat_core::scene::{FaceBinding, Gaussians};

    fn avatar() -> Avatar {
        let scales = [[0.02f32, 0.001, 0.0004], [0.0025, 0.03, 0.001], [0.004, 0.0041, 0.0039]];
        let gaussians = Gaussians {
            means: vec![Vec3::new(0.1, 0.2, 0.3); 3],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; 3],
            log_scales: scales.map(|s| Vec3::from_array(s).map(f32::ln)).to_vec(),
            opacity_logits: vec![0.5, -1.0, 3.0],
            sh_degree: 1,
            sh: (0..12).map(|i| [0.1 * i as f32, -0.3, 0.2]).collect(),
        };
        let binding = Binding::Face(FaceBinding {
            faces: vec![0; 3],
            barycentric: vec![[1.0, 0.0, 0.0]; 3],
            offsets: vec![0.01, -0.02, 0.0],
        });
        Avatar { gaussians, binding }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let changes = "loss.long_thin=0.3+loss.scale=40.0+loss.opacity=0.2+loss.sh_rest=0.7";
        for form in ["excess", "splatting-avatar"] {
            let recipe = format!("pure-skinned+{changes}+loss.long_thin_form=\"{form}\"");
            derivatives_of(Recipe::parse(&recipe).expect("known"));
        }
    }

    #[test]
    fn needles_are_counted_as_splatting_avatar_counts_them() {
        let recipe =
            Recipe::parse("pure-skinned+loss.long_thin=0.5+loss.long_thin_form=\"splatting-avatar\"");
        let terms = LossTerms { scale: 0.0, ..recipe.expect("known").loss };
        let own = avatar();
        let mut gradient = AvatarGradient::default();
        gradient.reset(&own.gaussians, true);
        // The third is neither longer than 8 mm nor ten times as long as thick.
        let value = needles(&terms, &own, &mut gradient);
        assert!((value - 0.5 * (0.02 + 0.03) / 2.0).abs() < 1e-8, "{value}");
        assert_eq!(gradient.log_scales[2], Vec3::ZERO);
        assert!(gradient.log_scales[0].x > 0.0 && gradient.log_scales[1].y > 0.0);
    }

    #[test]
    fn sizes_and_opacities_count_of_what_is_seen() {
        let recipe = Recipe::parse("pure-skinned+loss.scale=40.0+loss.opacity=0.2").expect("known");
        let (own, mut gradient) = (avatar(), AvatarGradient::default());
        gradient.reset(&own.gaussians, true);
        gradient.opacity_logits[1] = 1e-30;
        let seen = seen(&gradient);
        assert_eq!(seen, [false, true, false]);
        add(&recipe.loss, &own, &Origin::of(&own), &seen, &mut gradient);
        for i in 0..3 {
            assert_eq!(gradient.log_scales[i] != Vec3::ZERO, seen[i]);
            assert_eq!(gradient.opacity_logits[i] != 0.0, seen[i]);
        }
    }

    fn derivatives_of(recipe: Recipe) {
        let terms = LossTerms { displacement: 5.0, ..recipe.loss };
        let mut moved = avatar();
        let origins = Origin::of(&moved);
        if let Binding::Face(binding) = &mut moved.binding {
            binding.offsets = vec![0.015, -0.01, 0.002];
        }
        let value = |avatar: &Avatar| {
            let mut gradient = AvatarGradient::default();
            gradient.reset(&avatar.gaussians, true);
            (add(&terms, avatar, &origins, &[true; 3], &mut gradient), gradient)
        };
        let (_, gradient) = value(&moved);
        let step = 1e-2f32;
        let check = |change: &dyn Fn(&mut Avatar, f32), found: f32| {
            let at = |h: f32| {
                let mut other = moved.clone();
                change(&mut other, h);
                value(&other).0
            };
            let expected = (at(step) - at(-step)) / f64::from(2.0 * step);
            assert!(
                (f64::from(found) - expected).abs() < 1e-3 * expected.abs().max(1e-3),
                "{found} {expected}"
            );
        };
        for i in 0..3 {
            for axis in 0..3 {
                let change = |a: &mut Avatar, h: f32| a.gaussians.log_scales[i][axis] += h;
                check(&change, gradient.log_scales[i][axis]);
            }
            check(&|a, h| a.gaussians.opacity_logits[i] += h, gradient.opacity_logits[i]);
            for k in 4 * i..4 * i + 4 {
                check(&|a, h| a.gaussians.sh[k][1] += h, gradient.sh[k][1]);
            }
            let change = |a: &mut Avatar, h: f32| {
                if let Binding::Face(binding) = &mut a.binding {
                    binding.offsets[i] += h;
                }
            };
            check(&change, gradient.offsets[i]);
        }
    }
}
