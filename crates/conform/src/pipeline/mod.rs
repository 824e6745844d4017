//! The computation that engines have to match, stage by stage, with every stage changeable: joints, weights, rotation,
//! covariance, SH, output.

mod blend;
mod colour;
mod joints;
mod output;

pub(crate) use colour::is_flipped;
pub(crate) use joints::JointState;

use super::convention::{CONVENTIONS, Convention, upper};
use super::rig::Rig;
use super::sample::{Field, Sample, Storage, WIDTH, range};
use super::wiring::{Covariance, Influences, Reading, Scale, Space, Unit, Wiring};
use skinsplat_core::math::{Matrix3, dot4, matrix3, portable, rotation};

/// The rig, and how numbers are written down.
#[derive(Clone, Copy)]
pub(crate) struct Pipeline<'a> {
    pub(crate) rig: &'a Rig,
    /// Of the answer.
    pub(crate) convention: Convention,
    /// Of the vectors that an engine may start from.
    pub(crate) vectors: Convention,
    pub(crate) storage: Storage,
}

/// What of a Gaussian is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    All,
    /// All but the SH, which are 0.
    WithoutColour,
}

/// The blend of a Gaussian's joints.
struct Blended {
    /// Rotation relative to the canonical one (w, x, y, z), of unit length unless the wiring says otherwise.
    relative: [f64; 4],
    /// The posed rotation, where the conversion gives that instead.
    posed: Option<[f64; 4]>,
    /// B = Σ w R.
    matrix: Matrix3<f64>,
    /// World position, metres.
    mean: [f64; 3],
}

impl Pipeline<'_> {
    /// The axes and units of a file.
    pub(crate) fn space(&self, space: Space) -> &Convention {
        match space {
            Space::Vectors => &self.vectors,
            Space::Files => &CONVENTIONS[0],
        }
    }

    /// A quaternion of an input as it is read.
    fn read(&self, reading: Reading, q: [f64; 4]) -> [f64; 4] {
        match reading {
            Reading::Right => q,
            Reading::Conjugated => rotation::conjugate(q),
            Reading::Misordered(order, space) => {
                let axes = self.space(space);
                axes.rotation_back(order.misread(axes.rotation(q)))
            }
        }
    }

    /// What every Gaussian is in a pose, in the order of the rig.
    pub(crate) fn frame(&self, wiring: &Wiring, frame: usize) -> Vec<Sample> {
        let joints = JointState::new(self, wiring, frame);
        (0..self.rig.len()).map(|i| self.gaussian(wiring, &joints, i)).collect()
    }

    /// One Gaussian in a pose.
    pub(crate) fn gaussian(&self, wiring: &Wiring, joints: &JointState, i: usize) -> Sample {
        self.weighted(wiring, joints, i, 1.0, Part::All)
    }

    /// One Gaussian in a pose, its weights multiplied by a factor.
    pub(crate) fn weighted(
        &self,
        wiring: &Wiring,
        joints: &JointState,
        i: usize,
        factor: f64,
        part: Part,
    ) -> Sample {
        let mut weights = influences(wiring, &self.rig.influences[i]);
        weights.iter_mut().for_each(|(_, w)| *w *= factor);
        let mean = self.rig.gaussians.means[i].to_array().map(f64::from);
        let canonical = self.read(wiring.canonical, self.rig.gaussians.unit_rotation(i).map(f64::from));
        let canonical = rotation::normalize(canonical).unwrap_or(rotation::identity());
        let mut blended = blend::blended(self, wiring, joints, &weights, mean, canonical);
        if wiring.relative_is_inverted {
            blended.relative = rotation::conjugate(blended.relative);
            blended.posed = None;
        }
        let posed = posed_rotation(wiring, &blended, canonical);
        let scales = self.scales(wiring, i);
        let mut sample = [0.0; WIDTH];
        sample[range(Field::Means)].copy_from_slice(&blended.mean);
        sample[range(Field::Quaternions)].copy_from_slice(&posed);
        sample[range(Field::Scales)].copy_from_slice(&scales);
        let covariance = self.covariance(wiring, &blended.matrix, canonical, posed, scales);
        sample[range(Field::Covariances)].copy_from_slice(&covariance);
        colour::write(self, wiring, i, &blended, part, &mut sample);
        sample[range(Field::Opacities)][0] = f64::from(self.rig.gaussians.opacity_logits[i]);
        output::finish(self, wiring, &mut sample);
        sample
    }

    /// Standard deviations, metres.
    fn scales(&self, wiring: &Wiring, i: usize) -> [f64; 3] {
        let logarithms = self.rig.gaussians.log_scales[i].to_array().map(f64::from);
        let s = logarithms.map(portable::exp);
        match wiring.scale {
            Scale::Right => s,
            Scale::Ones(space) => [1.0 / self.space(space).units; 3],
            Scale::GeometricBall => [portable::exp(logarithms.iter().sum::<f64>() / 3.0); 3],
            Scale::ArithmeticBall => [s.iter().sum::<f64>() / 3.0; 3],
            Scale::Twice(space) => {
                let units = self.space(space).units;
                s.map(|s| portable::exp(s * units) / units)
            }
            Scale::Never(space) => {
                let units = self.space(space).units;
                logarithms.map(|l| (l + portable::ln(units)) / units)
            }
        }
    }

    /// xx, xy, xz, yy, yz, zz of the posed covariance.
    fn covariance(
        &self,
        wiring: &Wiring,
        blend: &Matrix3<f64>,
        canonical: [f64; 4],
        posed: [f64; 4],
        scales: [f64; 3],
    ) -> [f64; 6] {
        let r = match wiring.covariance {
            Covariance::Blended => matrix3::multiply(*blend, rotation::quaternion_to_matrix(canonical)),
            _ => of_length(wiring.unit, posed),
        };
        let power = |s: f64| match wiring.covariance {
            Covariance::NotSquared(space) => s / self.space(space).units,
            _ => s * s,
        };
        let scaled =
            r.map(|row| [row[0] * power(scales[0]), row[1] * power(scales[1]), row[2] * power(scales[2])]);
        upper(&matrix3::multiply(scaled, matrix3::transpose(r)))
    }
}

/// The weights that count, divided by their sum unless that is left out.
fn influences(wiring: &Wiring, row: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let mut kept = row.to_vec();
    match wiring.influences {
        Influences::All => {}
        Influences::CutTo(count) => kept.truncate(count),
        Influences::Levels(levels) => {
            let levels = f64::from(levels);
            kept.iter_mut().for_each(|(_, w)| *w = (*w * levels).round() / levels);
            kept.retain(|(_, w)| *w > 0.0);
        }
    }
    if !wiring.keeps_sum {
        let sum: f64 = kept.iter().map(|(_, w)| w).sum();
        kept.iter_mut().for_each(|(_, w)| *w /= sum);
    }
    kept
}

/// A R_c, whatever the wiring makes of it.
fn posed_rotation(wiring: &Wiring, blended: &Blended, canonical: [f64; 4]) -> [f64; 4] {
    use super::wiring::Product;
    let posed = match wiring.product {
        Product::Right => blended.posed.unwrap_or_else(|| rotation::multiply(blended.relative, canonical)),
        Product::Swapped => rotation::multiply(canonical, blended.relative),
        Product::NotTurned => canonical,
        Product::CanonicalForgotten => blended.relative,
    };
    if wiring.posed_is_inverted { rotation::conjugate(posed) } else { posed }
}

/// The matrix of a quaternion that may have another length than one.
fn of_length(unit: Unit, q: [f64; 4]) -> Matrix3<f64> {
    match unit {
        Unit::Normalised | Unit::Raw => rotation::quaternion_to_matrix(q),
        Unit::RawMatrix => rotation::quaternion_to_matrix_raw(q),
        Unit::RawProduct => {
            let square = dot4(q, q);
            rotation::quaternion_to_matrix(q).map(|row| row.map(|v| v * square))
        }
    }
}
