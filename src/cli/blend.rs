//! `reproduce blend`: what every solver and projection answers for given rotations and weights.

use super::output::{Format, emit, emit_json};
use super::{Exit, selection::read_json};
use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};
use skinsplat_core::math::average::{Solver, Start, average, average_rotation, eigen::SymmetricEigen};
use skinsplat_core::math::{Matrix3, matrix3, rotation};
use std::path::PathBuf;

/// Blend rotations with every solver: check a shader or an engine against the exact answer.
///
/// CASES.json is a list of objects with "name", "quats_wxyz" (a list w, x, y, z per bone) and "weights"; other keys are
/// ignored.
/// Quaternions are normalised first. Weights need not sum to one: the blend, its raw conversion, the eigenvalues and
/// their gap are those of the weights as given; no other answer depends on the sum. Each answer has its component of
/// largest magnitude positive, except the raw conversion, which is as PyTorch3D returns it.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Blend {
    /// The cases
    #[arg(value_name = "CASES.json")]
    cases: PathBuf,
    /// How to print the answers
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Debug, Deserialize)]
struct Case {
    name: String,
    quats_wxyz: Vec<[f64; 4]>,
    weights: Vec<f64>,
}

/// The answers for one case. Matrices are row-major.
#[derive(Debug, Serialize)]
struct Answer {
    name: String,
    /// The average of Eq. 7.
    average_wxyz: [f64; 4],
    /// The proper rotation nearest to the blend: the same rotation, computed another way.
    polar_wxyz: [f64; 4],
    /// `null` where the blend's columns do not span a frame.
    gram_schmidt_columns: Option<[f64; 9]>,
    /// `null` where the blend's rows do not span a frame.
    gram_schmidt_rows: Option<[f64; 9]>,
    matrix_to_quaternion_raw_wxyz: [f64; 4],
    /// 15 power steps from the heaviest bone.
    power15_wxyz: [f64; 4],
    /// 15 power steps from (1, 1, 1, 1)/2.
    power15_ones_wxyz: [f64; 4],
    nlerp_wxyz: [f64; 4],
    /// The linear blend Σ w R(q).
    blend: [f64; 9],
    blend_determinant: f64,
    /// Of Σ w q qᵀ, descending.
    eigenvalues: [f64; 4],
    /// λ1 − λ2.
    gap: f64,
    /// (λ1 − λ2) / λ1.
    gap_rel: f64,
    /// False where the average is a choice among equals.
    unique: bool,
}

const EXAMPLES: &str = "\
Examples:
  reproduce blend cases.json                answers as JSON";

impl Blend {
    pub(super) fn run(&self) -> Result<Exit> {
        let cases: Vec<Case> = read_json(&self.cases)?;
        let answer = |(index, case)| match solve(case) {
            Ok(answer) => Ok(answer),
            Err(problem) => bail!("{}: case {index} `{}`: {problem}", self.cases.display(), case.name),
        };
        let answers = cases.iter().enumerate().map(answer).collect::<Result<Vec<Answer>>>()?;
        match self.format {
            Format::Json => emit_json(&answers)?,
            Format::Text => emit(&answers.iter().map(text).collect::<String>())?,
        }
        Ok(Exit::Success)
    }
}

fn solve(case: &Case) -> Result<Answer> {
    let (quats, weights) = (&case.quats_wxyz, &case.weights);
    if quats.len() != weights.len() || quats.is_empty() {
        bail!(
            "{} quats_wxyz and {} weights; expected as many of both, at least one",
            quats.len(),
            weights.len()
        );
    }
    let Some(exact) = average(quats, weights, Solver::Eigen) else {
        bail!("expected finite quats_wxyz of length above 0 and finite weights >= 0 that are not all 0");
    };
    let by = |solver| {
        average_rotation(quats, weights, solver).ok_or_else(|| anyhow::anyhow!("{solver} found no answer"))
    };
    let power = |start| by(Solver::Power { steps: 15, start });
    // Of weights that sum to one, where nothing overflows; then as given.
    let Moments { mean, outer, total } = Moments::of(quats, weights);
    let shares = SymmetricEigen::new(outer).values;
    let gap = shares[0] - shares[1];
    let blend = mean.map(|row| row.map(|v| v * total));
    Ok(Answer {
        name: case.name.clone(),
        average_wxyz: exact.quat,
        polar_wxyz: by(Solver::Polar)?,
        gram_schmidt_columns: rotation::gram_schmidt_columns(mean).map(flat),
        gram_schmidt_rows: rotation::gram_schmidt_rows(mean).map(flat),
        matrix_to_quaternion_raw_wxyz: rotation::matrix_to_quaternion_raw(blend),
        power15_wxyz: power(Start::Heaviest)?,
        power15_ones_wxyz: power(Start::Ones)?,
        nlerp_wxyz: by(Solver::Nlerp)?,
        blend: flat(blend),
        blend_determinant: matrix3::determinant(blend),
        eigenvalues: shares.map(|share| share * total),
        gap: gap * total,
        gap_rel: gap / shares[0],
        unique: exact.unique,
    })
}

/// The moments of weighted rotations.
struct Moments {
    /// Σ w R(q) / Σ w.
    mean: Matrix3<f64>,
    /// Σ w q qᵀ / Σ w.
    outer: [[f64; 4]; 4],
    /// Σ w.
    total: f64,
}

impl Moments {
    /// Of checked input.
    fn of(quats: &[[f64; 4]], weights: &[f64]) -> Self {
        let heaviest = weights.iter().copied().fold(0.0, f64::max);
        let total: f64 = weights.iter().map(|w| w / heaviest).sum();
        let (mut mean, mut outer) = ([[0.0; 3]; 3], [[0.0; 4]; 4]);
        for (&q, w) in quats.iter().zip(weights) {
            let share = w / heaviest / total;
            let Some(q) = rotation::normalize(q).filter(|_| share > 0.0) else { continue };
            let r = rotation::quaternion_to_matrix(q);
            (0..3).for_each(|i| (0..3).for_each(|j| mean[i][j] += share * r[i][j]));
            (0..4).for_each(|i| (0..4).for_each(|j| outer[i][j] += share * q[i] * q[j]));
        }
        Self { mean, outer, total: total * heaviest }
    }
}

fn flat(m: Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| m[k / 3][k % 3])
}

fn text(answer: &Answer) -> String {
    let q = |[w, x, y, z]: [f64; 4]| format!("{w:+.9} {x:+.9} {y:+.9} {z:+.9}");
    let m = |m: Option<[f64; 9]>| match m {
        Some(m) => m.map(|v| format!("{v:+.6}")).join(" "),
        None => "undefined: the blend does not span a frame".to_owned(),
    };
    let unique = if answer.unique { "unique" } else { "not unique: a documented choice" };
    format!(
        "{}\n  average               {}\n  polar                 {}\n  15 power steps        {}\n  nlerp                 \
         {}\n  matrix to quaternion  {}  (raw, as PyTorch3D)\n  Gram-Schmidt columns  {}\n  Gram-Schmidt rows     \
         {}\n  eigen gap             {:.3e} (relative {:.3e}), {unique}\n",
        answer.name,
        q(answer.average_wxyz),
        q(answer.polar_wxyz),
        q(answer.power15_wxyz),
        q(answer.nlerp_wxyz),
        q(answer.matrix_to_quaternion_raw_wxyz),
        m(answer.gram_schmidt_columns),
        m(answer.gram_schmidt_rows),
        answer.gap,
        answer.gap_rel,
    )
}
