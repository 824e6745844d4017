//! One Gaussian at a time: solvers, with fewer influences, in other precisions.

use super::Bench;
use crate::trade::candidate::Candidate;
use crate::trade::exact::{Bones, Shot, degrees, stock, truncated};
use crate::trade::{Error, Outcome, Spread, Sweep, SweepRow, Unit};
use half::f16;
use skinsplat_core::math::{Quaternion, Real};
use skinsplat_core::scene::{Avatar, Binding, PosedBody, SkinWeights};
use skinsplat_posing::{BoundAvatar, pose};

/// At most so many Gaussians of a frame are timed, evenly spaced; errors are those of all.
const TIMED: usize = 20_000;

/// Answers of every Gaussian of every shot.
type Answers = Vec<Vec<Option<Quaternion<f64>>>>;

/// What a candidate answers in T, how long it takes, and a remark on what has no answer.
struct Solved {
    answers: Answers,
    time: Spread,
    note: String,
}

fn solve<T: Real>(bench: &Bench, shots: &[Shot], weights: &SkinWeights, candidate: Candidate) -> Solved {
    let mut missing = 0;
    let answers = shots
        .iter()
        .map(|shot| {
            let (answers, none) = shot.answers::<T>(weights, candidate);
            missing += none;
            answers
        })
        .collect();
    let bones = Bones::<T>::new(&shots[0].joints, weights);
    let stride = bones.len().div_ceil(TIMED).max(1);
    let time = bench.time(|| {
        let mut sum = T::ZERO;
        for i in (0..bones.len()).step_by(stride) {
            // Every answer is used, and none waits for the one before.
            sum += bones.solve(i, candidate).map_or(T::ZERO, |q| q[0]);
        }
        sum
    });
    let note = match missing {
        0 => String::new(),
        n => format!("{n} of {} without an answer, which count as 180°", weights.len() * shots.len()),
    };
    Solved { answers, time: time.per(bones.len().div_ceil(stride)), note }
}

/// The outcome of answers, with images of `shots`.
fn outcome(bench: &Bench, motion: usize, shots: &[Shot], solved: &Solved) -> Result<Outcome, Error> {
    let stage = bench.stage;
    let mut next = 0;
    let images = shots
        .iter()
        .map(|shot| {
            let posed = shot.dressed(&stage.rig, &stage.avatar.gaussians, &solved.answers[next]);
            next += 1;
            skinsplat_render::splat::render(&posed.as_posed(), &shot.camera, &stage.settings).image
        })
        .collect::<Vec<_>>();
    let angles = shots.iter().zip(&solved.answers).map(|(shot, answers)| shot.angles(answers));
    Ok(Outcome {
        time: Some(solved.time),
        bytes: None,
        degrees: degrees(angles),
        fidelity: Some(bench.fidelity(motion, &images)?),
    })
}

/// Every solver on both motions, in f64.
pub(super) fn solvers(bench: &Bench) -> Result<Sweep, Error> {
    let mut rows = Vec::new();
    for (m, motion) in bench.stage.motions.iter().enumerate() {
        for candidate in Candidate::all(bench.stage.options.quick) {
            let solved = solve::<f64>(bench, &motion.shots, &bench.stage.rig.weights, candidate);
            let outcome = outcome(bench, m, &motion.shots, &solved)?;
            rows.push(SweepRow {
                motion: motion.id,
                choice: vec![candidate.id()],
                outcome: Ok(outcome),
                note: remark(candidate, solved.note),
            });
        }
    }
    Ok(Sweep {
        id: "solver",
        title: "Rotation solver",
        about: "One rotation of several, one Gaussian at a time in f64, against the exact average; images with the answers in \
                place of the exact rotations. `power-N-START`: N steps from a start vector (none named: the heaviest \
                bone); `squaring-N`: 2^N steps."
            .to_owned(),
        axes: vec!["Solver"],
        unit: Unit::PerGaussian,
        by_bytes: false,
        rows,
    })
}

fn remark(candidate: Candidate, note: String) -> String {
    match (candidate == Candidate::ENGINE, note.is_empty()) {
        (true, true) => "the paper's engine path".to_owned(),
        (true, false) => format!("the paper's engine path; {note}"),
        (false, _) => note,
    }
}

/// Fewer influences per Gaussian, with several solvers.
pub(super) fn influences(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let joints = stage.rig.body.skeleton.num_joints();
    let most = stage.rig.weights.max_influences();
    let mut rows = Vec::new();
    for limit in [Some(1), Some(2), Some(4), Some(8), None] {
        let name = limit.map_or_else(|| "all".to_owned(), |n: usize| n.to_string());
        let weights = truncated(&stage.rig.weights, limit.unwrap_or(usize::MAX), joints)?;
        let rebound = match &stage.avatar.binding {
            Binding::Vertex(_) if limit.is_some_and(|n| n < most) => {
                let binding = Binding::Vertex(weights.clone());
                Some(BoundAvatar::new(&Avatar { binding, ..stage.avatar.clone() }, &stage.rig.body)?)
            }
            _ => None,
        };
        for (m, motion) in stage.motions.iter().enumerate() {
            let shots = match &rebound {
                None => motion.shots.clone(),
                Some(bound) => {
                    let moved = |shot: &Shot| -> Result<Shot, Error> {
                        let body = PosedBody::new(&stage.rig.body, &shot.pose)?;
                        Ok(shot.moved(pose(bound, &body, &stock())?.means))
                    };
                    motion.shots.iter().map(moved).collect::<Result<_, _>>()?
                }
            };
            for candidate in Candidate::representative() {
                let solved = solve::<f64>(bench, &shots, &weights, candidate);
                let mut note = solved.note.clone();
                if limit.is_some_and(|n| n >= most) {
                    note = format!(
                        "no Gaussian has more than {most}{}{note}",
                        if note.is_empty() { "" } else { "; " }
                    );
                }
                rows.push(SweepRow {
                    motion: motion.id,
                    choice: vec![candidate.id(), name.clone()],
                    outcome: Ok(outcome(bench, m, &shots, &solved)?),
                    note,
                });
            }
        }
    }
    Ok(Sweep {
        id: "influences",
        title: "Influences per Gaussian",
        about: "The heaviest influences, scaled to sum to one, against the exact average of all; means follow the same \
                influences."
            .to_owned(),
        axes: vec!["Solver", "Influences"],
        unit: Unit::PerGaussian,
        by_bytes: false,
        rows,
    })
}

/// Solvers in f64 and f32, and in f32 from joints and weights that were stored in 16 bits.
pub(super) fn precision(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let short = |v: f64| f16::from_f64(v).to_f64();
    let mut rows = Vec::new();
    for (m, motion) in stage.motions.iter().enumerate() {
        let stored: Vec<Shot> = motion.shots.iter().map(|shot| shot.with_joints(short)).collect();
        let weights = stored_short(&stage.rig.weights, stage.rig.body.skeleton.num_joints())?;
        for candidate in Candidate::representative() {
            for precision in ["f64", "f32", "f16"] {
                let solved = match precision {
                    "f64" => solve::<f64>(bench, &motion.shots, &stage.rig.weights, candidate),
                    "f32" => solve::<f32>(bench, &motion.shots, &stage.rig.weights, candidate),
                    _ => solve::<f32>(bench, &stored, &weights, candidate),
                };
                rows.push(SweepRow {
                    motion: motion.id,
                    choice: vec![candidate.id(), precision.to_owned()],
                    outcome: Ok(outcome(bench, m, &motion.shots, &solved)?),
                    note: solved.note.clone(),
                });
            }
        }
    }
    Ok(Sweep {
        id: "precision",
        title: "Precision of the solver",
        about: "Solvers in f64, in f32, and in f32 from rotations of joints and skinning weights that were stored in 16 bits \
                (`f16`), against the exact average of what was not rounded. The closed form decides in f64 in either \
                precision."
            .to_owned(),
        axes: vec!["Solver", "Precision"],
        unit: Unit::PerGaussian,
        by_bytes: false,
        rows,
    })
}

/// Weights as 16-bit floats hold them, scaled to sum to one again.
pub(super) fn stored_short(table: &SkinWeights, joints: usize) -> Result<SkinWeights, Error> {
    let row = |i: usize| {
        let (indices, weights) = table.row(i);
        let short: Vec<f64> = weights.iter().map(|&w| f16::from_f32(w).to_f64()).collect();
        let sum: f64 = short.iter().sum();
        let share = |(&j, w): (&u16, &f64)| (usize::from(j), (w / sum) as f32);
        indices.iter().zip(&short).map(share).collect::<Vec<_>>()
    };
    Ok(SkinWeights::from_rows((0..table.len()).map(row), joints)?)
}
