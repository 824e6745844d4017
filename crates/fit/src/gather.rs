//! Which colour, or which spherical harmonics, explain what the frames show of each part of a surface: weighted least
//! squares, one small system per part, accumulated frame by frame.

use super::Error;
use super::options::Sighting;
use super::sighting::{Frame, Observation, SurfacePoint};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use skinsplat_core::math::rotation::nearest_rotation;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{PosedBody, SkinWeights};
use skinsplat_data::sequence::Sequence;

/// Frames that are loaded at a time.
const BATCH: usize = 8;

/// Parts of a surface (one Gaussian or texel each), and the surface points through which they are seen.
pub(super) struct Parts {
    pub(super) points: Vec<SurfacePoint>,
    /// Per part, its range in `members`.
    pub(super) offsets: Vec<u32>,
    /// (point, weight) pairs.
    pub(super) members: Vec<(u32, f32)>,
    /// Skinning weights per part: its frame, in which SH are read.
    pub(super) skin: Option<SkinWeights>,
}

impl Parts {
    /// Every point is a part of its own.
    pub(super) fn single_points(points: Vec<SurfacePoint>) -> Self {
        let offsets = (0..=points.len() as u32).collect();
        let members = (0..points.len() as u32).map(|i| (i, 1.0)).collect();
        Self { points, offsets, members, skin: None }
    }

    pub(super) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn members(&self, part: usize) -> &[(u32, f32)] {
        &self.members[self.offsets[part] as usize..self.offsets[part + 1] as usize]
    }
}

/// Colours of parts, as 3DGS stores them: `colour = 0.5 + Σ coefficient * basis`.
#[derive(Clone, Debug)]
pub(super) struct Colours {
    pub(super) degree: usize,
    /// `(degree + 1)²` coefficients per part.
    pub(super) coefficients: Vec<[f32; 3]>,
    /// Total weight of the observations per part; zero where it was never seen.
    pub(super) confidence: Vec<f32>,
}

impl Colours {
    /// As many colours of the same degree, all coefficients zero.
    pub(super) fn zeroed(&self) -> Self {
        Self { coefficients: vec![[0.0; 3]; self.coefficients.len()], ..self.clone() }
    }

    /// Adds the coefficients of a residual.
    pub(super) fn add(&mut self, residual: &Self) {
        for (own, more) in self.coefficients.iter_mut().zip(&residual.coefficients) {
            *own = std::array::from_fn(|c| own[c] + more[c]);
        }
    }

    pub(super) fn of(&self, part: usize) -> &[[f32; 3]] {
        let count = sh::count(self.degree);
        &self.coefficients[part * count..(part + 1) * count]
    }
}

/// How observations become colours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathering<'a> {
    pub(super) degree: usize,
    /// Strength of the pull of degrees 1 to 3 towards zero, relative to the weight of the observations.
    pub(super) smoothness: f64,
    /// What the coefficients are relative to: 0.5 for colours, 0 for residuals.
    pub(super) origin: f64,
    /// Observations count less the farther they are from these colours: `1 / (1 + (distance / scale)²)²`.
    pub(super) robust: Option<(&'a Colours, f64)>,
    /// Which sights count.
    pub(super) sighting: &'a Sighting,
}

impl<'a> Gathering<'a> {
    /// Plain mean colours.
    pub(super) fn mean(sighting: &'a Sighting) -> Self {
        Self { degree: 0, smoothness: 0.0, origin: 0.5, robust: None, sighting }
    }
}

/// The colours of a sequence's true images: the mean over the frames that show a part, then again with the outliers
/// (`robust_scale` away in colour count a quarter) weighed down, in SH of `degree`.
pub(super) fn consensus(
    sequence: &Sequence,
    sighting: &Sighting,
    robust_scale: f64,
    parts: &Parts,
    (degree, smoothness): (usize, f64),
) -> Result<Colours, Error> {
    let truth = |gathering| {
        let show = |frame: &Frame<'_>, (): &(), point: &SurfacePoint| frame.observe(point, &frame.truth.rgb);
        gather(sequence, parts, gathering, |_| Ok(()), show)
    };
    let mean = truth(Gathering::mean(sighting))?;
    truth(Gathering { degree, smoothness, robust: Some((&mean, robust_scale)), ..Gathering::mean(sighting) })
}

/// Fits every part to what the frames show of it: `prepare` makes of each frame what `observe` then reads at every
/// surface point.
pub(super) fn gather<S: Send + Sync>(
    sequence: &Sequence,
    parts: &Parts,
    gathering: Gathering<'_>,
    prepare: impl Fn(&Frame<'_>) -> Result<S, Error> + Sync,
    observe: impl Fn(&Frame<'_>, &S, &SurfacePoint) -> Observation + Sync,
) -> Result<Colours, Error> {
    let mut systems = vec![System::new(gathering.degree); parts.len()];
    let frames: Vec<usize> = (0..sequence.frames.len()).collect();
    for batch in frames.chunks(BATCH) {
        let load = |&index: &usize| -> Result<(Frame<'_>, S), Error> {
            let frame = Frame::load(sequence, index, gathering.sighting)?;
            let shown = prepare(&frame)?;
            Ok((frame, shown))
        };
        let loaded: Vec<_> = batch.par_iter().map(load).collect::<Result<_, _>>()?;
        for (frame, shown) in &loaded {
            let seen: Vec<Observation> = parts.points.par_iter().map(|p| observe(frame, shown, p)).collect();
            let eye = frame.camera.position();
            systems.par_iter_mut().enumerate().with_min_len(256).for_each(|(part, system)| {
                let Some(mut observation) = combined(parts.members(part), &seen) else { return };
                let basis = basis(parts, part, gathering.degree, &frame.body, eye, &observation);
                if let Some((colours, scale)) = gathering.robust {
                    observation.weight *=
                        robust_weight(colours.of(part), &basis, &observation, gathering.origin, scale);
                }
                system.add(&basis, &observation, gathering.origin);
            });
        }
    }
    let solved: Vec<Vec<[f32; 3]>> = systems.par_iter().map(|s| s.solve(gathering.smoothness)).collect();
    Ok(Colours {
        degree: gathering.degree,
        coefficients: solved.into_iter().flatten().collect(),
        confidence: systems.iter().map(|s| s.weight as f32).collect(),
    })
}

/// One observation of a whole part: the weighted mean over its points.
fn combined(members: &[(u32, f32)], seen: &[Observation]) -> Option<Observation> {
    let (mut colour, mut weight) = ([0.0f32; 3], 0.0f32);
    let (mut position, mut total) = (glam::Vec3::ZERO, 0.0f32);
    for &(point, share) in members {
        let one = &seen[point as usize];
        let w = share * one.weight;
        colour = std::array::from_fn(|c| colour[c] + w * one.colour[c]);
        weight += w;
        position += one.position * share;
        total += share;
    }
    (weight > 0.0).then(|| Observation {
        colour: colour.map(|c| c / weight),
        weight: weight / total,
        position: position / total,
    })
}

/// The SH basis along the view direction, read in the part's own frame: turned back by the averaged rotation of its
/// joints (Eq. 7, by its polar form).
fn basis(
    parts: &Parts,
    part: usize,
    degree: usize,
    body: &PosedBody<'_>,
    eye: DVec3,
    observation: &Observation,
) -> [f64; 16] {
    let Some(skin) = parts.skin.as_ref().filter(|_| degree > 0) else { return sh::basis(0, [0.0; 3]) };
    let (joints, weights) = skin.row(part);
    let blend = joints.iter().zip(weights).fold(DMat3::ZERO, |sum, (&j, &w)| {
        sum + DMat3::from_quat(body.joints[usize::from(j)].rotation) * f64::from(w)
    });
    let direction = (observation.position.as_dvec3() - eye).normalize_or_zero();
    sh::basis(degree, (nearest_rotation(blend).inverse() * direction).to_array())
}

fn robust_weight(
    coefficients: &[[f32; 3]],
    basis: &[f64; 16],
    seen: &Observation,
    origin: f64,
    scale: f64,
) -> f32 {
    let distance = |c: usize| -> f64 {
        let model: f64 = coefficients.iter().zip(basis).map(|(k, b)| f64::from(k[c]) * b).sum();
        let off = f64::from(seen.colour[c]) - origin - model;
        off * off
    };
    let squared = (0..3).map(distance).sum::<f64>() / 3.0;
    let distance = 1.0 + squared / (scale * scale);
    (1.0 / (distance * distance)) as f32
}

/// Normal equations of one part: `Σ w φ φᵀ x = Σ w φ (colour - origin)`.
#[derive(Clone)]
struct System {
    /// Lower triangle, row by row.
    matrix: Vec<f64>,
    right: Vec<[f64; 3]>,
    weight: f64,
}

impl System {
    fn new(degree: usize) -> Self {
        let n = sh::count(degree);
        Self { matrix: vec![0.0; n * (n + 1) / 2], right: vec![[0.0; 3]; n], weight: 0.0 }
    }

    fn add(&mut self, basis: &[f64; 16], seen: &Observation, origin: f64) {
        let weight = f64::from(seen.weight);
        let mut entry = 0;
        for row in 0..self.right.len() {
            let scaled = weight * basis[row];
            for column in 0..=row {
                self.matrix[entry] += scaled * basis[column];
                entry += 1;
            }
            for c in 0..3 {
                self.right[row][c] += scaled * (f64::from(seen.colour[c]) - origin);
            }
        }
        self.weight += weight;
    }

    /// Cholesky factorisation of the regularised matrix; zero where nothing was seen.
    fn solve(&self, smoothness: f64) -> Vec<[f32; 3]> {
        let n = self.right.len();
        if self.weight <= 0.0 {
            return vec![[0.0; 3]; n];
        }
        let mut lower = vec![[0.0f64; 16]; n];
        let mut x = self.right.clone();
        for i in 0..n {
            let level = (i as f64).sqrt().floor();
            // what white light from everywhere would put on the diagonal, times l (l + 1)
            let pull = smoothness * self.weight * sh::C0 * sh::C0 * level * (level + 1.0);
            for j in 0..=i {
                let inner: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let value = self.matrix[i * (i + 1) / 2 + j] - inner;
                lower[i][j] = if i == j { (value + pull).max(1e-300).sqrt() } else { value / lower[j][j] };
            }
        }
        for i in 0..n {
            for c in 0..3 {
                let inner: f64 = (0..i).map(|k| lower[i][k] * x[k][c]).sum();
                x[i][c] = (x[i][c] - inner) / lower[i][i];
            }
        }
        for i in (0..n).rev() {
            for c in 0..3 {
                let inner: f64 = (i + 1..n).map(|k| lower[k][i] * x[k][c]).sum();
                x[i][c] = (x[i][c] - inner) / lower[i][i];
            }
        }
        x.iter().map(|row| row.map(|v| v as f32)).collect()
    }
}
