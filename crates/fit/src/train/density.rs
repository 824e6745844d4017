//! Gaussians that come and go: adaptive density control as in 3DGS (Kerbl et al. 2023, section 5.2), on a body, without
//! its resets of opacity. Clones and halves are placed without random numbers: a half sits half a standard deviation along
//! the longest axis from where the whole was.

use super::parameters::{Origin, Parameters};
use super::walk::{self, Neighbours};
use crate::recipe::Densify;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, PosedGradient, RestBody, SceneError, SkinWeights};
use skinsplat_posing::nearest::NearestFace;

/// Mean gradients on screen since the last change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Density {
    sums: Vec<f32>,
    counts: Vec<u32>,
    /// Number of Gaussians before the first change.
    first: usize,
}

impl Density {
    pub(super) fn new(n: usize) -> Self {
        Self { sums: vec![0.0; n], counts: vec![0; n], first: n }
    }

    /// True if it is of so many Gaussians: a checkpoint may say something else.
    pub(super) fn is_for(&self, n: usize) -> bool {
        self.sums.len() == n && self.counts.len() == n
    }

    /// Takes note of an iteration.
    pub(super) fn observe(&mut self, gradient: &PosedGradient) {
        let seen = gradient.screen.par_iter().zip(&gradient.radii);
        let known = self.sums.par_iter_mut().zip(&mut self.counts);
        known.zip(seen).with_min_len(4096).for_each(|((sum, count), (slope, &radius))| {
            if radius > 0.0 {
                *sum += portable::hypot(slope[0], slope[1]);
                *count += 1;
            }
        });
    }

    fn mean(&self, i: usize) -> f32 {
        if self.counts[i] == 0 { 0.0 } else { self.sums[i] / self.counts[i] as f32 }
    }
}

/// True if the number of Gaussians changes after this many iterations.
pub(super) fn is_due(settings: &Densify, done: u32, iterations: u32) -> bool {
    let share = f64::from(settings.until - settings.from);
    let spaced = (share * f64::from(iterations)) as u32 / settings.interval.max(1);
    let rounds = if settings.interval == 0 { settings.rounds } else { settings.rounds.max(spaced) };
    let share = share / f64::from(rounds.max(1));
    (0..rounds).any(|round| {
        let at = f64::from(settings.from) + share * f64::from(round);
        (at * f64::from(iterations)).round() as u32 == done
    })
}

/// The skinning weights of the points of the body nearest to each mean.
fn nearest_weights(
    means: &[Vec3],
    body: &RestBody,
    faces: Option<&NearestFace<'_>>,
) -> Result<SkinWeights, SceneError> {
    let faces =
        faces.ok_or_else(|| SceneError::new("body.faces", "none", "faces to take skinning weights from"))?;
    let row = |mean: &Vec3| {
        let point = faces.nearest(mean.as_dvec3(), None);
        body.weights_at(point.face, point.barycentric)
    };
    let rows: Vec<_> = means.par_iter().map(row).collect();
    SkinWeights::from_rows(rows, body.skeleton.num_joints())
}

/// What becomes of a Gaussian.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Stay,
    Clone,
    Split,
    Go,
}

/// Removes, clones and splits Gaussians; then those with weights of their own take those of the nearest point of the body,
/// and face-bound ones walk onto the triangle they have slid into.
pub(super) fn change(
    settings: &Densify,
    parameters: &mut Parameters,
    density: &mut Density,
    body: &RestBody,
    faces: Option<&NearestFace<'_>>,
) -> Result<(), SceneError> {
    let fates = fates(settings, &parameters.avatar.gaussians, density);
    let mut next = Next::default();
    for (i, fate) in fates.iter().enumerate() {
        match fate {
            Fate::Go => {}
            Fate::Stay => next.take(parameters, i, Some(i), None),
            Fate::Clone => {
                next.take(parameters, i, Some(i), None);
                next.take(parameters, i, None, None);
            }
            Fate::Split => {
                next.take(parameters, i, None, Some((settings.apart, settings.shrink)));
                next.take(parameters, i, None, Some((-settings.apart, settings.shrink)));
            }
        }
    }
    let Next { gaussians, sources, parents, origins, shifts } = next;
    let binding = match &parameters.avatar.binding {
        Binding::Static => Binding::Static,
        Binding::Vertex(_) => Binding::Vertex(nearest_weights(&gaussians.means, body, faces)?),
        Binding::Face(binding) => {
            let mut moved = walk::inherited(binding, &parents, &shifts, body);
            if settings.walk {
                walk::walk(&mut moved, body, &Neighbours::new(body), settings.most_crossings);
            }
            Binding::Face(moved)
        }
    };
    let count = gaussians.len();
    parameters.rearrange(Avatar { gaussians, binding }, origins, &sources);
    *density = Density { first: density.first, ..Density::new(count) };
    Ok(())
}

fn fates(settings: &Densify, gaussians: &Gaussians, density: &Density) -> Vec<Fate> {
    let opacities = gaussians.opacities();
    let mut fates: Vec<Fate> = opacities
        .iter()
        .map(|&opacity| if opacity < settings.prune_opacity { Fate::Go } else { Fate::Stay })
        .collect();
    if fates.iter().all(|&fate| fate == Fate::Go) {
        // An avatar without Gaussians cannot recover.
        fates.fill(Fate::Stay);
    }
    let kept = fates.iter().filter(|&&fate| fate == Fate::Stay).count();
    let most = (f64::from(settings.most) * density.first as f64) as usize;
    let mut wanted: Vec<usize> = (0..gaussians.len())
        .filter(|&i| fates[i] == Fate::Stay && density.mean(i) > settings.gradient)
        .collect();
    wanted.sort_by(|&a, &b| density.mean(b).total_cmp(&density.mean(a)).then(a.cmp(&b)));
    for i in wanted.into_iter().take(most.saturating_sub(kept)) {
        let large = portable::exp(gaussians.log_scales[i].max_element()) > settings.split_above;
        fates[i] = if large { Fate::Split } else { Fate::Clone };
    }
    fates
}

/// The Gaussians after a change.
#[derive(Default)]
struct Next {
    gaussians: Gaussians,
    /// Which moments each continues.
    sources: Vec<Option<usize>>,
    parents: Vec<usize>,
    origins: Vec<Origin>,
    /// From the parent, metres in the rest pose.
    shifts: Vec<Vec3>,
}

impl Next {
    /// Takes over Gaussian `i`, or one of its halves: so many standard deviations along its longest axis, and so many times
    /// smaller.
    fn take(&mut self, parameters: &Parameters, i: usize, source: Option<usize>, half: Option<(f32, f32)>) {
        let from = &parameters.avatar.gaussians;
        let count = from.sh_count();
        let log_scale = from.log_scales[i];
        let longest = if log_scale.x >= log_scale.y && log_scale.x >= log_scale.z {
            Vec3::X
        } else if log_scale.y >= log_scale.z {
            Vec3::Y
        } else {
            Vec3::Z
        };
        let [w, x, y, z] = from.rotations[i];
        let axis = Quat::from_xyzw(x, y, z, w).normalize() * longest;
        let (apart, shrink) = half.map_or((0.0, 0.0), |(apart, shrink)| (apart, portable::ln(shrink)));
        let shift = axis * (apart * portable::exp(log_scale.max_element()));
        let to = &mut self.gaussians;
        to.sh_degree = from.sh_degree;
        to.means.push(from.means[i] + shift);
        to.rotations.push(from.rotations[i]);
        to.log_scales.push(log_scale - Vec3::splat(shrink));
        to.opacity_logits.push(from.opacity_logits[i]);
        to.sh.extend_from_slice(&from.sh[i * count..(i + 1) * count]);
        self.sources.push(source);
        self.parents.push(i);
        self.shifts.push(shift);
        let origin = parameters.start[i];
        let log_scale = origin.log_scale - Vec3::splat(shrink);
        self.origins.push(Origin { mean: origin.mean + shift, log_scale, ..origin });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_spread_over_their_share_of_the_iterations() {
        let settings = Densify {
            from: 0.2,
            until: 0.8,
            rounds: 3,
            gradient: 1.0,
            split_above: 1.0,
            prune_opacity: 0.1,
            most: 2.0,
            walk: false,
            interval: 0,
            ..crate::recipe::RECIPES
                .iter()
                .find_map(|recipe| recipe.densify.clone())
                .expect("one that densifies")
        };
        let due: Vec<u32> = (0..=100).filter(|&done| is_due(&settings, done, 100)).collect();
        assert_eq!(due, [20, 40, 60]);
        let spaced = Densify { interval: 10, ..settings };
        let count = |of: u32| (0..=of).filter(|&done| is_due(&spaced, done, of)).count();
        assert_eq!([count(40), count(100)], [3, 6]);
    }
}
