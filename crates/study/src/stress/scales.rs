//! Section `scales`: covariance factors of extreme size and condition, and SH of extreme size.

use super::stage;
use super::table::{Cell, Findings, LIMITS, Row, Verdict, column, label, line, shown};
use glam::{DVec3, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::math::{Quaternion, Real, sh};
use skinsplat_core::scene::{Avatar, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, ColourChoice, CovarianceChoice, PRESETS, PosingError, Strategy, pose};
use skinsplat_table::Table;

const SECTION: &str = "scales";

/// Standard deviations of an ordinary Gaussian, metres.
const ORDINARY: Vec3 = Vec3::new(0.012, 0.005, 0.002);

/// What the three standard deviations are multiplied with.
const FACTORS: [(&str, [f64; 3]); 9] = [
    ("1e-12", [1e-12; 3]),
    ("1e-6", [1e-6; 3]),
    ("1e3", [1e3; 3]),
    ("1e6", [1e6; 3]),
    ("1e12", [1e12; 3]),
    ("condition 1e3", [1.0, 1e-3, 1e-3]),
    ("condition 1e6", [1e3, 1.0, 1e-3]),
    ("condition 1e12", [1e6, 1.0, 1e-6]),
    ("condition 1e24", [1e12, 1.0, 1e-12]),
];

/// The section.
///
/// # Errors
/// None that the built-in body does not cause.
pub(super) fn run() -> Result<Findings, PosingError> {
    let body = stage::body()?;
    let mut findings =
        Findings { section: SECTION, title: "Extreme scales and coefficients", ..Findings::default() };
    let mut table = Table {
        labels: vec![label("covariance")],
        columns: FACTORS.iter().map(|f| column(f.0)).collect(),
        remarks: vec![
            "Columns of the factor M, Σ = M Mᵀ, against those of ordinary scales times the same numbers: nothing is squared \
             before the renderer projects."
                .to_owned(),
        ],
        ..Table::new("covariances", "Covariance factors: largest relative error of a column")
    };
    for covariance in CovarianceChoice::ALL {
        let mut cells = Vec::new();
        for (name, factors) in FACTORS {
            // A disc has its own thickness, which no factor changes.
            let error = match covariance {
                CovarianceChoice::Surfel => None,
                _ => Some(factor_error(&body, covariance, factors)?),
            };
            let cell = error.map_or(Cell::Word("scales are its own"), Cell::number);
            cells.push(cell.into());
            findings.rows.push(row("covariance", name, covariance.to_string(), "f32", cell, error));
        }
        table.rows.push(line([covariance.to_string()], cells));
    }
    findings.tables.push(table);
    coefficients(&mut findings);
    findings.causes = vec![
        "Covariances stay factors until they are on the screen, so their condition is never squared; a scale or \
         coefficient is only ever multiplied."
            .to_owned(),
    ];
    Ok(findings)
}

fn row(
    family: &str,
    input: &str,
    subject: String,
    precision: &'static str,
    error: Cell,
    value: Option<f64>,
) -> Row {
    Row {
        section: SECTION,
        family: family.to_owned(),
        input: input.to_owned(),
        subject,
        precision,
        finite: Cell::Flag(value.is_none_or(f64::is_finite)),
        rotation_error: Cell::Word("see poses"),
        error,
        equivariance: Cell::Word("see poses"),
        jump: Cell::Word("see sequences"),
        deterministic: Cell::Word("see poses"),
        verdict: value.map_or(Verdict::Holds, |v| Verdict::of(v, LIMITS.relative)),
        note: String::new(),
    }
}

fn factor_error(
    body: &RestBody,
    covariance: CovarianceChoice,
    factors: [f64; 3],
) -> Result<f64, PosingError> {
    let strategy = Strategy { covariance, colour: ColourChoice::None, ..PRESETS[0].strategy };
    let at = stage::bent(body, &[DVec3::ZERO, DVec3::new(0.9, 0.4, 0.7), DVec3::ZERO, DVec3::ZERO]);
    let posed_body = PosedBody::new(body, &at)?;
    let columns = |avatar: &Avatar| -> Result<Vec<[DVec3; 3]>, PosingError> {
        let bound = BoundAvatar::new(avatar, body)?;
        let posed = pose(&bound, &posed_body, &strategy)?;
        Ok(posed.factors.iter().map(|m| [m.x_axis, m.y_axis, m.z_axis].map(|c| c.as_dvec3())).collect())
    };
    let mut avatar = stage::surface(body);
    // R_cᵀ S² R_c mixes the axes of an affine-conjugate factor: only one number can be taken out of it.
    let mixes = covariance == CovarianceChoice::AffineConjugate;
    let factors = if mixes { [factors[1]; 3] } else { factors };
    let ordinary = columns(&avatar)?;
    let logs = ORDINARY.to_array().map(f64::from);
    let scaled = [0, 1, 2].map(|k: usize| portable::ln(logs[k] * factors[k]) as f32);
    avatar.gaussians.log_scales.fill(Vec3::from_array(scaled));
    // The logarithm in f32 costs its size in ulp: the scale that it stands for is the reference.
    let actual = [0, 1, 2].map(|k: usize| {
        portable::exp(f64::from(scaled[k])) / portable::exp(f64::from(portable::ln(ORDINARY[k])))
    });
    let extreme = columns(&avatar)?;
    let error = |(a, b): (&[DVec3; 3], &[DVec3; 3])| {
        (0..3).map(|k| (a[k] * actual[k] - b[k]).length() / (a[k].length() * actual[k])).fold(0.0, worse)
    };
    Ok(ordinary.iter().zip(&extreme).map(error).fold(0.0, worse))
}

fn worse(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// Rotations of SH: sizes of coefficients and angles of rotations.
fn coefficients(findings: &mut Findings) {
    let mut table = Table {
        labels: ["precision", "rotation"].map(label).into(),
        columns: ["1e-12", "1", "1e4", "1e30"].map(column).into(),
        remarks: vec!["f32 against f64; f64 turned there and back against what it started from.".to_owned()],
        ..Table::new("coefficients", "Rotated SH of degree 3: error over the size of the coefficients")
    };
    let angles = [
        ("0", 0.0),
        ("1e-8 rad", 1e-8),
        ("90°", 90f64.to_radians()),
        ("180°", std::f64::consts::PI),
        ("1e6 rad", 1e6),
    ];
    for precision in ["f32", "f64"] {
        for (name, angle) in angles {
            let (sin, cos) = portable::sin_cos(0.5 * angle);
            let turn = [cos, 0.48 * sin, -0.64 * sin, 0.6 * sin];
            let errors = [1e-12, 1.0, 1e4, 1e30].map(|size| sh_error(precision, turn, size));
            for (size, error) in [1e-12, 1.0, 1e4, 1e30].into_iter().zip(errors) {
                let input = format!("{name}, coefficients of {}", shown(size));
                findings.rows.push(row(
                    "SH",
                    &input,
                    "sh rotation".to_owned(),
                    precision,
                    Cell::number(error),
                    Some(error),
                ));
            }
            let cells = errors.map(|e| Cell::number(e).into());
            table.rows.push(line([precision.to_owned(), name.to_owned()], cells.into()));
        }
    }
    findings.tables.push(table);
}

fn sh_error(precision: &str, turn: Quaternion<f64>, size: f64) -> f64 {
    let mut random = SplitMix64::new(41);
    let given: Vec<[f64; 3]> =
        (0..16).map(|_| [(); 3].map(|()| size * (2.0 * f64::from(random.unit_f32()) - 1.0))).collect();
    let given: Vec<[f64; 3]> = given.iter().map(|c| c.map(|v| f64::from(v as f32))).collect();
    let mut wide = given.clone();
    sh::Rotation::from_quaternion(turn, 3).apply(&mut wide);
    let off = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs() / size).fold(0.0, worse)
    };
    if precision == "f64" {
        let back = [turn[0], -turn[1], -turn[2], -turn[3]];
        sh::Rotation::from_quaternion(back, 3).apply(&mut wide);
        return off(&wide, &given);
    }
    let mut narrow: Vec<[f32; 3]> = given.iter().map(|c| c.map(|v| v as f32)).collect();
    sh::Rotation::from_quaternion(turn.map(f32::from_f64), 3).apply(&mut narrow);
    let narrow: Vec<[f64; 3]> = narrow.iter().map(|c| c.map(f64::from)).collect();
    off(&narrow, &wide)
}
