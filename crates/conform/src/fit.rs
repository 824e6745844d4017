//! Bugs with a number in them that no catalogue lists: read from the answer, then put to the test like any other.

use super::judge::{Judge, Model};
use super::sample::{Field, Fields, Sample, range};
use serde_json::{Value, json};

/// What may be read from an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fit {
    /// Weights that do not sum to one: means are multiplied by their sum.
    Sums,
    /// Quaternions of other lengths than one.
    Lengths,
    /// Basis functions with the other sign.
    Signs,
    /// Half floats, perhaps widened again.
    Half,
}

impl Fit {
    pub(crate) const ALL: [Self; 4] = [Self::Sums, Self::Lengths, Self::Signs, Self::Half];

    /// The model with what is read from the answer; `None` if nothing can be read.
    pub(crate) fn fitted(self, judge: &Judge<'_>, model: &Model) -> Option<Model> {
        let predicted = judge.predict(model);
        let mut fitted = model.clone();
        match self {
            Self::Sums => {
                fitted.sums = Some(sums(judge, &predicted)?);
                fitted.wiring.keeps_sum = true;
            }
            Self::Lengths => {
                if !judge.answer.present.contains(Field::Quaternions) {
                    return None;
                }
                fitted.any_length = true;
            }
            Self::Signs => fitted.signs = signs(judge, &predicted)?,
            Self::Half => {
                if judge.answer.halves.is_empty() {
                    return None;
                }
                fitted.half = true;
            }
        }
        Some(fitted)
    }

    /// The model with nothing but what this read from the answer for `fitted`, in which other bugs are too.
    pub(crate) fn alone(self, fitted: &Model) -> Model {
        let mut alone = Model::default();
        match self {
            Self::Sums => {
                alone.sums.clone_from(&fitted.sums);
                alone.wiring.keeps_sum = true;
            }
            Self::Lengths => alone.any_length = true,
            Self::Signs => alone.signs = fitted.signs,
            Self::Half => alone.half = true,
        }
        alone
    }

    /// Fields that it may change, whatever else is wrong.
    pub(crate) fn affects(self, judge: &Judge<'_>) -> Fields {
        let colours: Fields = Field::SH.into_iter().collect();
        match self {
            // SH turn by directions of sums alone.
            Self::Sums => judge.answer.present.without(colours),
            Self::Lengths => [Field::Quaternions].into_iter().collect(),
            Self::Signs => judge.answer.present.and(colours),
            Self::Half => judge.answer.halves,
        }
    }

    pub(crate) fn kind(self) -> &'static str {
        match self {
            Self::Sums => "weights-not-normalised",
            Self::Lengths => "not-normalised",
            Self::Signs => "sh-basis-sign",
            Self::Half => "half-precision",
        }
    }

    pub(crate) fn summary(self) -> &'static str {
        match self {
            Self::Sums => "weights do not sum to one and were not divided by their sum: means are scaled",
            Self::Lengths => "quaternions do not have unit length",
            Self::Signs => "coefficients of SH have the other sign: the signs of another basis",
            Self::Half => {
                "every number is one that a half float holds: rounded to 11 bits, which is too few for the tolerance"
            }
        }
    }

    /// The numbers that were read.
    pub(crate) fn details(self, judge: &Judge<'_>, model: &Model) -> Value {
        let extent = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            json!([low, high])
        };
        match self {
            Self::Sums => {
                let sums = model.sums.clone().unwrap_or_default();
                json!({ "sums": extent(&mut sums.into_iter()) })
            }
            Self::Lengths => {
                let length = |sample: &Sample| {
                    sample[range(Field::Quaternions)].iter().map(|c| c * c).sum::<f64>().sqrt()
                };
                json!({ "lengths": extent(&mut judge.answer.samples.iter().map(length)) })
            }
            Self::Signs => {
                let flipped: Vec<usize> = (0..16).filter(|&k| model.signs[k]).collect();
                json!({ "coefficients": flipped, "where": "in the answer" })
            }
            Self::Half => rounded(judge, model),
        }
    }
}

/// The number that lost most.
fn rounded(judge: &Judge<'_>, model: &Model) -> Value {
    let worst = judge.worst(&judge.predict(model), judge.answer.halves, 1);
    let Some(worst) = worst.first() else { return json!({}) };
    let off = |k: &usize| (worst.expected[*k].abs() - worst.got[*k].abs()).abs();
    let Some(k) = (0..worst.got.len()).max_by(|a, b| off(a).total_cmp(&off(b))) else { return json!({}) };
    json!({
        "largest_rounding": worst.error,
        "at": format!("{}[{}][{}][{k}]", worst.field.name(), worst.pose, worst.gaussian),
        "read": worst.got[k],
        "expected": worst.expected[k],
    })
}

/// Per Gaussian, the factor between its means and the predicted ones, the same in all poses.
fn sums(judge: &Judge<'_>, predicted: &[Sample]) -> Option<Vec<f64>> {
    if !judge.answer.present.contains(Field::Means) {
        return None;
    }
    let gaussians = judge.pipeline.rig.len();
    let factor = |gaussian: usize| {
        let (mut product, mut square) = (0.0, 0.0);
        for at in (gaussian..predicted.len()).step_by(gaussians) {
            let (expected, found) =
                (&predicted[at][range(Field::Means)], &judge.answer.samples[at][range(Field::Means)]);
            for (e, f) in expected.iter().zip(found) {
                (product, square) = (product + e * f, square + e * e);
            }
        }
        let factor = product / square;
        (0.05..=20.0).contains(&factor).then_some(factor)
    };
    let sums: Vec<f64> = (0..gaussians).map(factor).collect::<Option<_>>()?;
    let differs = |sum: &f64| (sum - 1.0).abs() > judge.tolerance;
    sums.iter().any(differs).then_some(sums)
}

/// The coefficients whose sign is the other one in every Gaussian, at least one.
fn signs(judge: &Judge<'_>, predicted: &[Sample]) -> Option<[bool; 16]> {
    let mut flipped = [false; 16];
    let agreement = |k: usize, sign: f64| {
        let start = range(Field::Sh0).start + 3 * k;
        let off = |(p, f): (&Sample, &Sample)| {
            (start..start + 3).map(|at| (sign * p[at] - f[at]).abs()).fold(0.0, f64::max)
        };
        predicted.iter().zip(&judge.answer.samples).map(off).fold(0.0, f64::max) <= judge.tolerance
    };
    for (band, field) in Field::SH.into_iter().enumerate() {
        if judge.answer.present.contains(field) {
            for k in band * band..(band + 1) * (band + 1) {
                flipped[k] = !agreement(k, 1.0) && agreement(k, -1.0);
            }
        }
    }
    flipped.contains(&true).then_some(flipped)
}
