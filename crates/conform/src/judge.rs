//! An answer held against a prediction: which fields agree, and by how much the others are off.

use super::answer::Answer;
use super::half_floats;
use super::pipeline::{JointState, Part, Pipeline};
use super::sample::{self, Field, Fields, Sample, range};
use super::wiring::Wiring;
use skinsplat_core::math::dot4;

/// An answer, the poses that it is of, and how exactly it has to agree.
pub(crate) struct Judge<'a> {
    pub(crate) pipeline: Pipeline<'a>,
    pub(crate) answer: &'a Answer,
    /// Which pose each part of the answer is of.
    pub(crate) frames: Vec<usize>,
    pub(crate) tolerance: f64,
}

/// How a prediction compares, field by field.
#[derive(Clone, Debug)]
pub(crate) struct Agreement {
    /// The largest error of each field of [`Field::ALL`]; 0 for fields that are not given.
    pub(crate) errors: [f64; 10],
    /// Given fields within the tolerance.
    pub(crate) matches: Fields,
}

impl Agreement {
    /// None at all.
    pub(crate) fn none() -> Self {
        Self { errors: [f64::INFINITY; 10], matches: Fields::default() }
    }
}

/// A prediction and how quaternions are compared with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub(crate) wiring: Wiring,
    /// Quaternions of the answer may have any length.
    pub(crate) any_length: bool,
    /// By how much the weights of each Gaussian miss one.
    pub(crate) sums: Option<Vec<f64>>,
    /// Coefficients of the SH whose sign is the other one in the answer.
    pub(crate) signs: [bool; 16],
    /// Numbers of the answer that half floats hold may be rounded to them.
    pub(crate) half: bool,
}

/// Where an answer is off, in a field.
#[derive(Clone, Debug)]
pub(crate) struct Worst {
    pub(crate) gaussian: usize,
    pub(crate) pose: usize,
    pub(crate) field: Field,
    pub(crate) error: f64,
    pub(crate) expected: Vec<f64>,
    pub(crate) got: Vec<f64>,
}

impl Judge<'_> {
    /// What the model says of every Gaussian in every pose of the answer.
    pub(crate) fn predict(&self, model: &Model) -> Vec<Sample> {
        let gaussians = self.pipeline.rig.len();
        let mut predicted = Vec::with_capacity(self.frames.len() * gaussians);
        for &frame in &self.frames {
            let joints = JointState::new(&self.pipeline, &model.wiring, frame);
            predicted.extend((0..gaussians).map(|i| self.sample(model, &joints, i, Part::All)));
        }
        predicted
    }

    fn sample(&self, model: &Model, joints: &JointState, gaussian: usize, part: Part) -> Sample {
        let factor = model.sums.as_ref().map_or(1.0, |sums| sums[gaussian]);
        let mut sample = self.pipeline.weighted(&model.wiring, joints, gaussian, factor, part);
        for (k, _) in model.signs.iter().enumerate().filter(|(_, flipped)| **flipped) {
            let start = range(Field::Sh0).start + 3 * k;
            sample[start..start + 3].iter_mut().for_each(|c| *c = -*c);
        }
        sample
    }

    /// How a model agrees with the answer.
    pub(crate) fn agreement(&self, model: &Model) -> Agreement {
        self.compare(&self.predict(model), model)
    }

    pub(crate) fn compare(&self, predicted: &[Sample], model: &Model) -> Agreement {
        let mut errors = [0.0; 10];
        for (predicted, found) in predicted.iter().zip(&self.answer.samples) {
            for field in self.answer.present.iter() {
                let error = self.error(field, predicted, found, model);
                errors[field as usize] = f64::max(errors[field as usize], error);
            }
        }
        let within = |field: &Field| errors[*field as usize] <= self.tolerance;
        Agreement { errors, matches: self.answer.present.iter().filter(within).collect() }
    }

    fn error(&self, field: Field, predicted: &Sample, found: &Sample, model: &Model) -> f64 {
        let (expected, found) = (&predicted[range(field)], &found[range(field)]);
        let units = self.pipeline.convention.units;
        if field == Field::Quaternions && model.any_length {
            let (expected, found) = (unit(expected), unit(found));
            return sample::error(field, self.answer.storage, units, &expected, &found);
        }
        if model.half && self.answer.halves.contains(field) {
            let opposite = field == Field::Quaternions
                && expected.iter().zip(found).map(|(e, f)| e * f).sum::<f64>() < 0.0;
            let sign = if opposite { -1.0 } else { 1.0 };
            let rounded: Vec<f64> =
                expected.iter().zip(found).map(|(e, &f)| half_floats::towards(sign * e, f)).collect();
            return sample::error(field, self.answer.storage, units, &rounded, found);
        }
        sample::error(field, self.answer.storage, units, expected, found)
    }

    /// The poses (by their place in the answer) that stand for all, and the Gaussians, of every number of bones.
    fn probes(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let gaussians = self.pipeline.rig.len();
        let last = self.frames.len() - 1;
        let places = if last == 0 { vec![0] } else { vec![last, last / 2] };
        // The rig's Gaussians go through the joints before they take another bone.
        let step = gaussians.div_ceil(9);
        places
            .into_iter()
            .flat_map(move |place| (0..gaussians).rev().step_by(step).map(move |gaussian| (place, gaussian)))
    }

    /// What a model says of the Gaussians that stand for all, one after the other.
    fn probed<'a>(&'a self, model: &'a Model, part: Part) -> impl Iterator<Item = (usize, Sample)> + 'a {
        let gaussians = self.pipeline.rig.len();
        let mut joints: Option<(usize, JointState)> = None;
        self.probes().map(move |(place, gaussian)| {
            let state = match joints.take() {
                Some((at, state)) if at == place => state,
                _ => JointState::new(&self.pipeline, &model.wiring, self.frames[place]),
            };
            let sample = self.sample(model, &state, gaussian, part);
            joints = Some((place, state));
            (place * gaussians + gaussian, sample)
        })
    }

    /// What a model says of a few Gaussians that stand for all.
    pub(crate) fn probe(&self, model: &Model) -> Vec<Sample> {
        self.probed(model, Part::All).map(|(_, sample)| sample).collect()
    }

    /// Those of some fields in which a model agrees with the answer, as far as a few Gaussians tell.
    pub(crate) fn plausible(&self, model: &Model, fields: Fields) -> Fields {
        let mut left = fields;
        let mut probed = self.probed(model, Part::All);
        while !left.is_empty() {
            let Some((at, predicted)) = probed.next() else { break };
            for field in left.iter() {
                let found = &self.answer.samples[at];
                if self.error(field, &predicted, found, model) > self.tolerance {
                    left.remove(field);
                }
            }
        }
        left
    }

    /// True if a model agrees with the answer in all of these fields, as far as a few Gaussians tell.
    pub(crate) fn is_plausible(&self, model: &Model, fields: Fields) -> bool {
        let colours: Fields = Field::SH.into_iter().collect();
        // Turning SH costs most.
        let parts = [(Part::WithoutColour, fields.without(colours)), (Part::All, fields.and(colours))];
        parts.into_iter().all(|(part, fields)| {
            fields.is_empty()
                || self.probed(model, part).all(|(at, predicted)| {
                    let found = &self.answer.samples[at];
                    fields.iter().all(|field| self.error(field, &predicted, found, model) <= self.tolerance)
                })
        })
    }

    /// The Gaussians that are furthest off in some fields, the worst first, each in its worst field.
    pub(crate) fn worst(&self, predicted: &[Sample], fields: Fields, count: usize) -> Vec<Worst> {
        let gaussians = self.pipeline.rig.len();
        let mut worst: Vec<Worst> = Vec::new();
        let exactly = Model::default();
        for (at, (predicted, found)) in predicted.iter().zip(&self.answer.samples).enumerate() {
            let of = |field: Field| (self.error(field, predicted, found, &exactly), field);
            let Some((error, field)) = fields.iter().map(of).max_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            let (pose, gaussian) = (self.frames[at / gaussians], at % gaussians);
            let (expected, got) = (predicted[range(field)].to_vec(), found[range(field)].to_vec());
            if error <= self.tolerance {
                continue;
            }
            worst.push(Worst { gaussian, pose, field, error, expected, got });
        }
        worst.sort_by(|a, b| b.error.total_cmp(&a.error));
        // One entry per Gaussian says more than one Gaussian in every pose.
        let mut seen = Vec::new();
        worst.retain(|w| {
            let fresh = !seen.contains(&w.gaussian);
            seen.push(w.gaussian);
            fresh
        });
        worst.truncate(count);
        worst
    }
}

fn unit(q: &[f64]) -> Vec<f64> {
    let four: [f64; 4] = std::array::from_fn(|k| q[k]);
    let length = dot4(four, four).sqrt();
    q.iter().map(|c| c / length).collect()
}
