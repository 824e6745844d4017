//! The shader's answers against `f64`.

use super::Rotation;
use super::batch::{Batch, Posed};
use super::reference::{self, Answer};
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::math::{Quaternion, matrix3};
use std::fmt::Write;

/// What is compared, with its unit.
pub const QUANTITIES: [&str; 6] =
    ["mean, m", "rotation, °", "covariance, relative", "view, °", "SH, relative", "colour"];

/// Errors of a quantity over a class of Gaussians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Half of them are not above it.
    pub median: f64,
    /// 99.9 % are not above it.
    pub most: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    fn of(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let at = |fraction: f64| {
            let rank = (fraction * errors.len() as f64).ceil() as usize;
            errors.get(rank.saturating_sub(1)).copied().unwrap_or_default()
        };
        Self { median: at(0.5), most: at(0.999), max: at(1.0) }
    }
}

/// A row: a class of Gaussians under a choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The choice.
    pub rotation: Rotation,
    /// The class, as a condition.
    pub class: String,
    /// The smallest gap, or |cosine|, that the class holds.
    pub from: f64,
    /// Gaussians in it.
    pub count: usize,
    /// A spread per quantity of [`QUANTITIES`].
    pub spreads: [Spread; 6],
    /// Of the choice itself, in `f64`, against the exact average, degrees.
    pub of_choice: Spread,
}

/// Bounds of the classes.
const CLASSES: [f64; 6] = [0.1, 1e-2, 1e-3, 1e-4, 1e-5, 0.0];

/// The number by which Gaussians are classed: what decides how much rounding is magnified.
fn decisive(batch: &Batch, i: usize, rotation: Rotation) -> f64 {
    match rotation {
        Rotation::TwoBones | Rotation::ClosedForm => reference::gap(batch, i, rotation),
        Rotation::Power => reference::left_by_steps(batch, i),
        Rotation::AlignedSum | Rotation::DualQuaternion => reference::surest_side(batch, i),
    }
}

/// What decides, in a word: the relative gap of the eigenvalues, what the steps leave of the heaviest joint, the cosine that says on
/// which side a joint lies.
pub fn decisive_name(rotation: Rotation) -> &'static str {
    match rotation {
        Rotation::TwoBones | Rotation::ClosedForm => "gap",
        Rotation::Power => "left",
        Rotation::AlignedSum | Rotation::DualQuaternion => "cosine",
    }
}

/// The rows of a choice, for what the shader made of a batch.
pub fn measure(batch: &Batch, posed: &Posed, rotation: Rotation) -> Vec<Row> {
    let mut classes: Vec<(Vec<[f64; 6]>, Vec<f64>)> = vec![Default::default(); CLASSES.len()];
    for i in 0..batch.len() {
        let answer = reference::answer(batch, i, rotation);
        let decisive = decisive(batch, i, rotation);
        let class = CLASSES.iter().position(|&from| decisive >= from).unwrap_or(CLASSES.len() - 1);
        classes[class].0.push(errors(posed, i, &answer));
        let exact = match rotation {
            Rotation::TwoBones | Rotation::ClosedForm => answer.relative,
            _ => reference::answer(batch, i, Rotation::ClosedForm).relative,
        };
        classes[class].1.push(degrees(answer.relative, exact));
    }
    let row = |(k, (errors, of_choice)): (usize, (Vec<[f64; 6]>, Vec<f64>))| Row {
        rotation,
        class: class_name(rotation, k),
        from: CLASSES[k],
        count: errors.len(),
        spreads: std::array::from_fn(|q| Spread::of(errors.iter().map(|e| e[q]).collect())),
        of_choice: Spread::of(of_choice),
    };
    classes.into_iter().enumerate().map(row).filter(|row| row.count > 0).collect()
}

fn class_name(rotation: Rotation, k: usize) -> String {
    let name = decisive_name(rotation);
    match k {
        0 => format!("{name} ≥ {}", CLASSES[0]),
        5 => format!("{name} < {:e}", CLASSES[4]),
        _ => format!("{name} ≥ {:e}", CLASSES[k]),
    }
}

/// The errors of one Gaussian, in the order of [`QUANTITIES`]; infinite where the shader answered with no number.
fn errors(posed: &Posed, i: usize, answer: &Answer) -> [f64; 6] {
    let relative = posed.relatives[i].map(f64::from);
    let quaternion = posed.quaternions[i].map(f64::from);
    let view = posed.views[i].map(f64::from);
    let rotation = degrees(relative, answer.relative).max(degrees(quaternion, answer.quaternion));
    let flat = |sh: &[[f64; 3]]| sh.as_flattened().to_vec();
    let turned = posed.turned_sh[i].map(|rgb| rgb.map(f64::from));
    let covariance: Vec<f64> = posed.covariances[i].map(f64::from).into();
    let found = [
        distance(&posed.means[i].map(f64::from), &answer.mean),
        rotation,
        distance(&covariance, &answer.covariance) / norm(&answer.covariance),
        between(view, answer.view),
        distance(&flat(&turned), &flat(&answer.turned_sh)) / norm(&flat(&answer.turned_sh)),
        distance(&posed.colours[i].map(f64::from), &answer.colour),
    ];
    found.map(|error| if error.is_nan() { f64::INFINITY } else { error })
}

fn degrees(a: Quaternion<f64>, b: Quaternion<f64>) -> f64 {
    angle_between(a, b).to_degrees()
}

/// Between directions, degrees.
fn between(a: [f64; 3], b: [f64; 3]) -> f64 {
    let across = matrix3::cross(a, b);
    skinsplat_core::math::portable::atan2(norm(&across), matrix3::dot(a, b)).to_degrees()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Rows as a table in Markdown.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = "| choice | class | Gaussians |".to_owned();
    for quantity in QUANTITIES {
        let _ = write!(text, " {quantity} |");
    }
    text.push_str(" the choice itself, ° |\n|---|---|--:|");
    text.push_str(&"--:|".repeat(QUANTITIES.len() + 1));
    text.push('\n');
    for row in rows {
        let _ = write!(text, "| `{}` | {} | {} |", row.rotation.name(), row.class, row.count);
        for spread in row.spreads.iter().chain([&row.of_choice]) {
            let Spread { median, most, max } = spread;
            let _ = write!(text, " {} / {} / {} |", short(*median), short(*most), short(*max));
        }
        text.push('\n');
    }
    text
}

/// Two digits.
fn short(value: f64) -> String {
    match value {
        0.0 => "0".to_owned(),
        v if (0.01..1000.0).contains(&v) => {
            let digits = if v >= 10.0 {
                0
            } else if v >= 1.0 {
                1
            } else if v >= 0.1 {
                2
            } else {
                3
            };
            format!("{v:.digits$}")
        }
        v => format!("{v:.1e}"),
    }
}
