//! Gaussians follow their neighbours: a term of the loss over pairs of Gaussians that started side by side.

use super::parameters::Origin;
use crate::fill::Neighbours;
use crate::options::Coupling;
use glam::Vec3;
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use skinsplat_core::scene::{Avatar, AvatarGradient, Binding};

/// The cosine of the largest angle between the normals of neighbours: what lies behind a thin part is none.
const LEAST_AGREEMENT: f32 = 0.5;

/// Among so many times as many Gaussians as wanted neighbours are looked for.
const LOOKED_AT: usize = 3;

/// Gaussians per unit of parallel work: fixed, so that sums do not depend on the number of threads.
const PART: usize = 2048;

/// Who is next to whom.
pub(super) struct Coupled(Neighbours);

/// Columns of a table: `width` of `stride`, from `first` on.
#[derive(Clone, Copy)]
struct Columns {
    stride: usize,
    first: usize,
    width: usize,
}

impl Columns {
    /// All of so many.
    fn all(width: usize) -> Self {
        Self { stride: width, first: 0, width }
    }

    #[inline(always)]
    fn of(self, table: &[f32], row: usize) -> &[f32] {
        &table[row * self.stride + self.first..][..self.width]
    }

    #[inline(always)]
    fn of_mut(self, table: &mut [f32], row: usize) -> &mut [f32] {
        &mut table[row * self.stride + self.first..][..self.width]
    }
}

impl Coupled {
    /// The neighbours of Gaussians by where they started, in either direction; `None` if nothing is coupled.
    pub(super) fn new(options: &Coupling, start: &[Origin]) -> Option<Self> {
        if options.is_off() {
            return None;
        }
        let place = |(i, origin): (usize, &Origin)| GeomWithData::new(origin.mean.to_array(), i as u32);
        let tree = RTree::bulk_load(start.iter().enumerate().map(place).collect());
        let wanted = options.neighbours as usize;
        let around = |(i, origin): (usize, &Origin)| {
            let others = tree.nearest_neighbor_iter(origin.mean.to_array()).map(|other| other.data);
            let agrees = |&other: &u32| {
                other as usize != i && origin.normal.dot(start[other as usize].normal) > LEAST_AGREEMENT
            };
            let near = others.take(LOOKED_AT * wanted).filter(agrees).take(wanted);
            near.flat_map(|other| [(i as u32, other), (other, i as u32)]).collect::<Vec<_>>()
        };
        let pairs: Vec<(u32, u32)> = start.par_iter().enumerate().flat_map_iter(around).collect();
        Some(Self(Neighbours::from_pairs(start.len(), pairs)))
    }

    /// Adds the derivatives of the term to `gradient` and returns its value.
    pub(super) fn add(
        &self,
        options: &Coupling,
        avatar: &Avatar,
        start: &[Origin],
        gradient: &mut AvatarGradient,
    ) -> f64 {
        let gaussians = &avatar.gaussians;
        let share = 1.0 / (start.len() as f32 * options.neighbours as f32);
        let weight = |weight: f32| (weight > 0.0).then_some(weight * share);
        let mut total = 0.0;
        if let Some(weight) = weight(options.position) {
            total += self.positions(weight, avatar, start, gradient);
        }
        if let Some(weight) = weight(options.scale) {
            let changes = vectors(&gaussians.log_scales, start, |origin| origin.log_scale);
            let gradient = bytemuck::cast_slice_mut(&mut gradient.log_scales);
            total += self.group(weight, (&changes, Columns::all(3)), (gradient, Columns::all(3)));
        }
        if let Some(weight) = weight(options.opacity) {
            let own = gaussians.opacity_logits.iter().zip(start);
            let changes: Vec<f32> = own.map(|(logit, origin)| logit - origin.opacity_logit).collect();
            let gradient = (&mut *gradient.opacity_logits, Columns::all(1));
            total += self.group(weight, (&changes, Columns::all(1)), gradient);
        }
        let (stride, sh) = (3 * gaussians.sh_count(), gaussians.sh.as_flattened());
        if let Some(weight) = weight(options.colour) {
            let own = sh.chunks_exact(stride).zip(start);
            let changes: Vec<[f32; 3]> =
                own.map(|(row, origin)| [0, 1, 2].map(|c| row[c] - origin.colour[c])).collect();
            let gradient = (gradient.sh.as_flattened_mut(), Columns { stride, first: 0, width: 3 });
            total += self.group(weight, (changes.as_flattened(), Columns::all(3)), gradient);
        }
        if let Some(weight) = weight(options.colour_rest).filter(|_| stride > 3) {
            let rest = Columns { stride, first: 3, width: stride - 3 };
            total += self.group(weight, (sh, rest), (gradient.sh.as_flattened_mut(), rest));
        }
        total
    }

    fn positions(
        &self,
        weight: f32,
        avatar: &Avatar,
        start: &[Origin],
        gradient: &mut AvatarGradient,
    ) -> f64 {
        match &avatar.binding {
            Binding::Static => 0.0,
            Binding::Vertex(_) => {
                let changes = vectors(&avatar.gaussians.means, start, |origin| origin.mean);
                let gradient = (bytemuck::cast_slice_mut(&mut gradient.means), Columns::all(3));
                self.group(weight, (&changes, Columns::all(3)), gradient)
            }
            Binding::Face(binding) => {
                let own = binding.offsets.iter().zip(start);
                let changes: Vec<f32> = own.map(|(offset, origin)| offset - origin.height).collect();
                let gradient = (&mut *gradient.offsets, Columns::all(1));
                self.group(weight, (&changes, Columns::all(1)), gradient)
            }
        }
    }

    /// Half the sum of `weight` times the squared differences over all rows and their neighbours, each pair seen from either side: what
    /// has changed about each Gaussian in a table with a row each, its derivative added in another.
    fn group(&self, weight: f32, changes: (&[f32], Columns), (gradient, into): (&mut [f32], Columns)) -> f64 {
        let parts = gradient.par_chunks_mut(PART * into.stride).enumerate();
        let sums: Vec<f64> = parts
            .map(|(part, gradient)| {
                let (neighbours, first) = (&self.0, part * PART);
                let gradient = (gradient, into);
                skinsplat_simd::arch().dispatch(Part { neighbours, first, weight, changes, gradient })
            })
            .collect();
        0.5 * f64::from(weight) * sums.iter().sum::<f64>()
    }
}

/// Sums are kept apart in so many lanes: a vector's.
const LANES: usize = 8;

/// Rows from `first` on, and their neighbours.
struct Part<'a> {
    neighbours: &'a Neighbours,
    first: usize,
    weight: f32,
    changes: (&'a [f32], Columns),
    gradient: (&'a mut [f32], Columns),
}

impl pulp::NullaryFnOnce for Part<'_> {
    /// The sum of the squared differences.
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let Self { neighbours, first, weight, changes: (changes, columns), gradient: (gradient, into) } =
            self;
        let mut lanes = [0.0; LANES];
        for row in 0..gradient.len() / into.stride {
            let (i, out) = (first + row, into.of_mut(gradient, row));
            let own = columns.of(changes, i);
            for &other in neighbours.of(i) {
                follow(2.0 * weight, own, columns.of(changes, other as usize), out, &mut lanes);
            }
        }
        lanes.iter().map(|&lane| f64::from(lane)).sum()
    }
}

/// Adds `weight` times the differences of two rows to `out`, and their squares to `lanes`.
#[inline(always)]
fn follow(weight: f32, own: &[f32], theirs: &[f32], out: &mut [f32], lanes: &mut [f32; LANES]) {
    let rest = in_vectors::<LANES>(weight, (own, theirs, out), lanes);
    let rest = in_vectors::<4>(weight, rest, lanes);
    in_vectors::<1>(weight, rest, lanes);
}

/// What a row, another and a gradient have from some place on.
type Rest<'a> = (&'a [f32], &'a [f32], &'a mut [f32]);

/// [`follow`], as far as whole vectors of `N` go.
#[inline(always)]
fn in_vectors<'a, const N: usize>(
    weight: f32,
    (own, theirs, out): Rest<'a>,
    lanes: &mut [f32; LANES],
) -> Rest<'a> {
    let (own, own_rest) = own.as_chunks::<N>();
    let (theirs, theirs_rest) = theirs.as_chunks::<N>();
    let (out, out_rest) = out.as_chunks_mut::<N>();
    for ((own, theirs), out) in own.iter().zip(theirs).zip(out) {
        for k in 0..N {
            let difference = own[k] - theirs[k];
            lanes[k] += difference * difference;
            out[k] += weight * difference;
        }
    }
    (own_rest, theirs_rest, out_rest)
}

/// How vectors differ from those of the start.
fn vectors(now: &[Vec3], start: &[Origin], of: impl Fn(&Origin) -> Vec3) -> Vec<f32> {
    let changes: Vec<[f32; 3]> =
        now.iter().zip(start).map(|(now, origin)| (*now - of(origin)).to_array()).collect();
    changes.into_flattened()
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::scene::{FaceBinding, Gaussians};

    /// A strip of Gaussians a centimetre apart, and behind each another that looks the other way.
    fn avatar() -> Avatar {
        let (n, back) = (8, [0.0, 1.0, 0.0, 0.0]);
        let place = |i: usize| Vec3::new(0.01 * (i / 2) as f32, 0.0, -0.002 * (i % 2) as f32);
        let gaussians = Gaussians {
            means: (0..n).map(place).collect(),
            rotations: (0..n).map(|i| if i % 2 == 0 { [1.0, 0.0, 0.0, 0.0] } else { back }).collect(),
            log_scales: vec![Vec3::new(-5.0, -5.5, -7.0); n],
            opacity_logits: vec![2.0; n],
            sh_degree: 1,
            sh: (0..4 * n).map(|i| [0.01 * i as f32, -0.2, 0.1]).collect(),
        };
        let binding = Binding::Face(FaceBinding {
            faces: vec![0; n],
            barycentric: vec![[1.0, 0.0, 0.0]; n],
            offsets: vec![0.001; n],
        });
        Avatar { gaussians, binding }
    }

    fn options() -> Coupling {
        Coupling { neighbours: 2, position: 3e3, scale: 0.4, opacity: 0.2, colour: 0.7, colour_rest: 0.3 }
    }

    #[test]
    fn neighbours_are_near_and_look_the_same_way() {
        let coupled = Coupled::new(&options(), &Origin::of(&avatar())).expect("coupled");
        assert_eq!(coupled.0.of(0), [2, 4]);
        assert_eq!(coupled.0.of(3), [1, 5, 7]);
        assert!(Coupled::new(&Coupling::default(), &Origin::of(&avatar())).is_none());
    }

    #[test]
    fn a_change_that_all_share_costs_nothing_but_in_what_the_start_has_none_of() {
        let start = Origin::of(&avatar());
        let coupled = Coupled::new(&options(), &start).expect("coupled");
        let mut moved = avatar();
        moved.gaussians.log_scales.iter_mut().for_each(|s| *s += 0.25);
        moved.gaussians.opacity_logits.iter_mut().for_each(|o| *o -= 0.5);
        moved.gaussians.sh.iter_mut().step_by(4).for_each(|c| c[1] += 0.125);
        let mut gradient = AvatarGradient::default();
        gradient.reset(&moved.gaussians, true);
        let without_rest = Coupling { colour_rest: 0.0, ..options() };
        assert_eq!(coupled.add(&without_rest, &moved, &start, &mut gradient), 0.0);
        assert!(coupled.add(&options(), &moved, &start, &mut gradient) > 0.0);
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let start = Origin::of(&avatar());
        let coupled = Coupled::new(&options(), &start).expect("coupled");
        let mut moved = avatar();
        let wave = |i: usize| (1.7 * i as f32).sin();
        (0..8).for_each(|i| {
            moved.gaussians.log_scales[i] += Vec3::new(wave(i), wave(i + 3), wave(i + 5));
            moved.gaussians.opacity_logits[i] += wave(i + 1);
            moved.gaussians.sh[4 * i][2] += wave(i + 2);
            let Binding::Face(binding) = &mut moved.binding else { return };
            binding.offsets[i] += 0.002 * wave(i + 4);
        });
        let value = |avatar: &Avatar| {
            let mut gradient = AvatarGradient::default();
            gradient.reset(&avatar.gaussians, true);
            (coupled.add(&options(), avatar, &start, &mut gradient), gradient)
        };
        let (_, gradient) = value(&moved);
        let check = |change: &dyn Fn(&mut Avatar, f32), step: f32, found: f32| {
            let at = |h: f32| {
                let mut other = moved.clone();
                change(&mut other, h);
                value(&other).0
            };
            let expected = (at(step) - at(-step)) / f64::from(2.0 * step);
            let error = (f64::from(found) - expected).abs();
            assert!(error < 2e-3 * expected.abs().max(1e-2), "{found} {expected}");
        };
        for i in 0..8 {
            check(&|a, h| a.gaussians.log_scales[i].y += h, 1e-2, gradient.log_scales[i].y);
            check(&|a, h| a.gaussians.opacity_logits[i] += h, 1e-2, gradient.opacity_logits[i]);
            check(&|a, h| a.gaussians.sh[4 * i][2] += h, 1e-2, gradient.sh[4 * i][2]);
            check(&|a, h| a.gaussians.sh[4 * i + 3][0] += h, 1e-2, gradient.sh[4 * i + 3][0]);
            let offset = |a: &mut Avatar, h: f32| {
                if let Binding::Face(binding) = &mut a.binding {
                    binding.offsets[i] += h;
                }
            };
            check(&offset, 1e-4, gradient.offsets[i]);
        }
    }
}
