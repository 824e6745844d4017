//! An engine's answer, judged.

use super::answer::Answer;
use super::convention::{CONVENTIONS, Convention, upper};
use super::judge::{Agreement, Judge, Model};
use super::pipeline::Pipeline;
use super::report::Report;
use super::rig::Rig;
use super::sample::{Field, Fields, Sample, Storage, range};
use super::{Error, manifest, order, search};
use skinsplat_core::math::{matrix3, portable, rotation};
use std::path::Path;

/// How an answer is to be judged.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The convention of the answer, where it is not that of the folder's vectors or, for PLYs, the default one.
    pub convention: Option<Convention>,
    /// Which pose a single PLY is of.
    pub frame: Option<usize>,
    /// How exactly every field has to agree: metres, or relative to the size of what is compared.
    pub tolerance: f64,
}

impl Options {
    /// The tolerance that f32 arithmetic keeps with room to spare.
    pub const TOLERANCE: f64 = 1e-4;
}

impl Default for Options {
    fn default() -> Self {
        Self { convention: None, frame: None, tolerance: Self::TOLERANCE }
    }
}

/// Judges the answer of an engine to the rig in `folder`, which [`export`](super::export()) wrote.
///
/// # Errors
/// A folder that holds no rig, or one of another version; an answer that cannot be read, that is of other Gaussians, in
/// another order, or in another convention than was declared.
pub fn check(folder: &Path, answer: &Path, options: &Options) -> Result<Report, Error> {
    if !(options.tolerance.is_finite() && options.tolerance > 0.0) {
        let problem = format!("{}", options.tolerance);
        return Err(Error::new("--tolerance", problem, "a finite number above 0"));
    }
    let exported = manifest::read(folder)?;
    let rig = Rig::new(exported.cases)?;
    let mut given = Answer::read(answer, &rig, options.frame)?;
    let convention = options.convention.unwrap_or(match given.storage {
        Storage::Activated => exported.convention,
        // PLYs of the rig are in the axes of their format, whatever the convention of its vectors.
        Storage::Logarithms => Convention::default(),
    });
    let vectors = options.convention.unwrap_or(exported.convention);
    let declared = options.convention.is_some() || convention != Convention::default();
    given.agrees_with(&convention, answer)?;
    let pipeline = Pipeline { rig: &rig, convention, vectors, storage: given.storage };
    let frames = match given.frames.clone() {
        Some(frames) => frames,
        None => {
            let frame = which_pose(&pipeline, &given, options.tolerance);
            given.notes.push(format!("taken for pose {frame}, by its values (--frame says otherwise)"));
            vec![frame]
        }
    };
    describe_alike(&pipeline, &mut given, &frames, options.tolerance);
    let judge = Judge { pipeline, answer: &given, frames, tolerance: options.tolerance };
    let right = judge.agreement(&Model::default());
    if right.matches == given.present {
        return Ok(Report::new(&judge, &right, None));
    }
    let place = format!("{}: answer", answer.display());
    order::check(&judge, &place)?;
    if let Some(other) = other_convention(&judge, &right).filter(|_| declared) {
        let problem = format!("the numbers are those of the convention {other}");
        return Err(Error::new(place, problem, format!("{convention}, as declared")));
    }
    let findings = search::explain(&judge, &right);
    let mut report = Report::new(&judge, &right, Some(&findings));
    if let Some(other) = other_convention(&judge, &right) {
        report
            .notes
            .push(format!("these are the numbers of the convention {other} (--convention {})", other.name));
    }
    Ok(report)
}

/// The convention in which the answer is right, where it is not the declared one.
fn other_convention(judge: &Judge<'_>, right: &Agreement) -> Option<Convention> {
    // What reads the same in both says nothing.
    let wrong = judge.answer.present.without(right.matches);
    let agrees = |convention: &Convention| {
        let pipeline = Pipeline { convention: *convention, ..judge.pipeline };
        let other = Judge { pipeline, answer: judge.answer, frames: judge.frames.clone(), ..*judge };
        let matches = other.agreement(&Model::default()).matches;
        !wrong.is_empty() && matches == judge.answer.present
    };
    CONVENTIONS.into_iter().find(agrees)
}

/// The pose that a single file is of: that which it agrees with, be it in another order, else that whose difference is explained most simply, else
/// that with the nearest means.
fn which_pose(pipeline: &Pipeline<'_>, answer: &Answer, tolerance: f64) -> usize {
    let judge = |frame: usize| Judge { pipeline: *pipeline, answer, frames: vec![frame], tolerance };
    let all = 0..pipeline.rig.poses.len();
    let agreements: Vec<Agreement> = all.clone().map(|k| judge(k).agreement(&Model::default())).collect();
    if let Some(frame) = agreements.iter().position(|a| a.matches == answer.present) {
        return frame;
    }
    if let Some(frame) = all.clone().find(|&k| order::permutation(&judge(k)).is_some()) {
        return frame;
    }
    let most = agreements.iter().map(|a| a.matches.len()).max().unwrap_or(0);
    let likely = all.clone().filter(|&k| most == 0 || agreements[k].matches.len() == most);
    let explained = likely.filter_map(|frame| {
        let simplest = search::explain_by_one(&judge(frame), &agreements[frame]);
        simplest.first().map(|e| (e.contradicted, e.residual, frame))
    });
    let by_simplicity =
        |a: &(usize, f64, usize), b: &(usize, f64, usize)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
    let nearest = || {
        let error = |k: &usize| agreements[*k].errors[Field::Means as usize];
        all.min_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or(0)
    };
    explained.min_by(by_simplicity).map_or_else(nearest, |(_, _, frame)| frame)
}

/// Quaternions and scales that describe the right ellipsoids by other axes are taken for the right ones: nobody can see the
/// difference.
fn describe_alike(pipeline: &Pipeline<'_>, answer: &mut Answer, frames: &[usize], tolerance: f64) {
    let described: Fields = [Field::Quaternions, Field::Scales].into_iter().collect();
    if !described.without(answer.present).is_empty() {
        return;
    }
    let judge = Judge { pipeline: *pipeline, answer, frames: frames.to_vec(), tolerance };
    let convention = pipeline.convention;
    let right = judge.predict(&Model::default());
    let matches = judge.compare(&right, &Model::default()).matches;
    if described.without(matches).is_empty() {
        return;
    }
    let alike = |(expected, found): (&Sample, &Sample)| {
        let found = ellipsoid(&convention, answer.storage, found);
        let expected = ellipsoid(&convention, answer.storage, expected);
        let (Some(found), Some(expected)) = (found, expected) else { return false };
        // Twice the tolerance, since lengths are squared.
        super::sample::error(Field::Covariances, answer.storage, 1.0, &expected, &found) <= 2.0 * tolerance
    };
    if !right.iter().zip(&answer.samples).all(alike) {
        return;
    }
    for (sample, right) in answer.samples.iter_mut().zip(&right) {
        for field in described.iter() {
            sample[range(field)].copy_from_slice(&right[range(field)]);
        }
    }
    answer.notes.push("quaternions and scales describe the right ellipsoids by other axes".to_owned());
}

/// The covariance that a quaternion of unit length and scales describe.
fn ellipsoid(convention: &Convention, storage: Storage, sample: &Sample) -> Option<[f64; 6]> {
    use super::convention::QuaternionOrder;
    let at = range(Field::Quaternions).start;
    let stored: [f64; 4] = std::array::from_fn(|k| sample[at + k]);
    let q = match (storage, convention.quaternions) {
        (Storage::Activated, QuaternionOrder::Xyzw) => [stored[3], stored[0], stored[1], stored[2]],
        _ => stored,
    };
    let length = skinsplat_core::math::dot4(q, q).sqrt();
    if (length - 1.0).abs() > 1e-3 {
        return None;
    }
    let at = range(Field::Scales).start;
    let s: [f64; 3] = std::array::from_fn(|k| match storage {
        Storage::Activated => sample[at + k],
        Storage::Logarithms => portable::exp(sample[at + k]),
    });
    let r = rotation::quaternion_to_matrix(q);
    let scaled = r.map(|row| [row[0] * s[0], row[1] * s[1], row[2] * s[2]]);
    Some(upper(&matrix3::multiply(scaled, matrix3::transpose(scaled))))
}
