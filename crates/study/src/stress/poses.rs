//! Section `poses`: every rotation choice on hard poses of a whole avatar, through the code that frames are posed with.

use super::averages::rotation_error;
use super::stage;
use super::table::{Cell, Findings, LIMITS, Row, Threshold, Verdict, column, label, line, shown, words};
use glam::{DMat3, DQuat, DVec3, Mat3};
use rayon::ThreadPool;
use rayon::prelude::*;
use skinsplat_core::math::Quaternion;
use skinsplat_core::math::portable;
use skinsplat_core::math::rotation::{angle_between, multiply};
use skinsplat_core::scene::{OwnedPosed, Pose, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, PosingError, Strategy, pose};
use skinsplat_table::{self as table, Table};

const SECTION: &str = "poses";

/// A hard pose.
struct Case {
    id: &'static str,
    make: fn(&RestBody) -> Pose,
}

fn second(body: &RestBody, angle: DVec3) -> Pose {
    stage::bent(body, &[DVec3::ZERO, angle, DVec3::ZERO, DVec3::ZERO])
}

fn scaled(body: &RestBody, scale: DVec3) -> Pose {
    let mut pose = second(body, DVec3::new(0.4, 0.5, 0.6));
    pose.locals[1].scale = scale;
    pose
}

const CASES: [Case; 14] = [
    Case { id: "rest", make: |b| second(b, DVec3::ZERO) },
    Case { id: "1e-8 rad", make: |b| second(b, DVec3::splat(1e-8)) },
    Case { id: "bent 90°", make: |b| second(b, DVec3::Z * 90f64.to_radians()) },
    Case { id: "twisted 179.9°", make: |b| second(b, DVec3::X * 179.9f64.to_radians()) },
    Case { id: "twisted 180°", make: |b| second(b, DVec3::X * std::f64::consts::PI) },
    Case { id: "twisted 180.1°", make: |b| second(b, DVec3::X * 180.1f64.to_radians()) },
    Case { id: "bent 180°", make: |b| second(b, DVec3::Z * std::f64::consts::PI) },
    Case {
        id: "all joints 180°",
        make: |b| {
            let pi = std::f64::consts::PI;
            stage::bent(b, &[DVec3::ZERO, DVec3::X * pi, DVec3::Y * pi, DVec3::Z * pi])
        },
    },
    Case { id: "1e6 rad", make: |b| second(b, DVec3::new(1e6, 2e5, -3e5)) },
    Case { id: "joint scaled 1e-6", make: |b| scaled(b, DVec3::splat(1e-6)) },
    Case { id: "joint scaled 1e6", make: |b| scaled(b, DVec3::splat(1e6)) },
    Case { id: "joint flattened", make: |b| scaled(b, DVec3::new(1.0, 1.0, 0.0)) },
    Case { id: "joint vanished", make: |b| scaled(b, DVec3::ZERO) },
    Case { id: "joint mirrored", make: |b| scaled(b, DVec3::new(1.0, 1.0, -1.0)) },
];

/// Distances by which the body is shifted, metres.
const SHIFTS: [f64; 8] = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7];

/// What one strategy does with one pose, worst over all Gaussians.
struct Outcome {
    finite: bool,
    rotation_error: Option<f64>,
    /// Degrees by which the answer is not the turned one after a turn of the world.
    equivariance: Option<f64>,
    deterministic: bool,
}

struct Stage<'a> {
    body: &'a RestBody,
    bound: &'a BoundAvatar,
    one: Option<&'a ThreadPool>,
    two: Option<&'a ThreadPool>,
}

/// Runs on a pool of threads; on that of the program where the system made none.
fn on<T: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

impl Stage<'_> {
    fn outcome(&self, strategy: &Strategy, at: &Pose) -> Result<Outcome, PosingError> {
        let body = PosedBody::new(self.body, at)?;
        let here = on(self.one, || pose(self.bound, &body, strategy))?;
        let again = on(self.two, || pose(self.bound, &body, strategy))?;
        let turn = portable::from_scaled_axis(DVec3::new(0.7, -1.1, 0.4));
        let moved = stage::moved(at, turn, DVec3::ZERO);
        let moved = PosedBody::new(self.body, &moved)?;
        let there = on(self.one, || pose(self.bound, &moved, strategy))?;
        let turn = [turn.w, turn.x, turn.y, turn.z];
        let (mut rotation, mut equivariance) = (None, None);
        if let (Some(here), Some(there)) = (&here.rotations, &there.rotations) {
            let worst = here.iter().map(|q| rotation_error(&drawn(q.map(f64::from)))).fold(0.0, worse);
            rotation = Some(worst);
            let pairs = here.iter().zip(there).map(|(a, b)| (a.map(f64::from), b.map(f64::from)));
            let changes = pairs.map(|(a, b)| angle_between(multiply(turn, a), b).to_degrees());
            equivariance = Some(changes.fold(0.0, worse));
        } else {
            // Not a rotation by design: how far the factor of a round Gaussian is from a multiple of one.
            let worst = here.factors.iter().map(|m| rotation_error(&unit_scale(m))).fold(0.0, worse);
            rotation = rotation.or(Some(worst));
        }
        let deterministic = here == again || !is_finite(&here);
        Ok(Outcome { finite: is_finite(&here), rotation_error: rotation, equivariance, deterministic })
    }
}

fn worse(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

fn drawn(q: Quaternion<f64>) -> [[f64; 3]; 3] {
    skinsplat_core::math::rotation::quaternion_to_matrix_raw(q)
}

/// The factor over the scales of the surface's Gaussians: R, where the factor is R S.
fn unit_scale(factor: &Mat3) -> [[f64; 3]; 3] {
    let inverse = DMat3::from_diagonal(DVec3::new(1.0 / 0.012, 1.0 / 0.005, 1.0 / 0.002));
    (factor.as_dmat3() * inverse).transpose().to_cols_array_2d()
}

fn is_finite(posed: &OwnedPosed) -> bool {
    posed.means.iter().all(|m| m.is_finite()) && posed.factors.iter().all(|m| m.is_finite())
}

/// The section.
///
/// # Errors
/// None that the built-in body does not cause.
pub(super) fn run(quick: bool) -> Result<Findings, PosingError> {
    let body = stage::body()?;
    let bound = BoundAvatar::new(&stage::surface(&body), &body)?;
    let mut strategies: Vec<Strategy> = stage::rotations().into_iter().map(stage::plain).collect();
    strategies.extend(skinsplat_posing::CovarianceChoice::ALL.into_iter().skip(1).map(|covariance| {
        Strategy {
            covariance,
            ..stage::plain(skinsplat_posing::RotationChoice::QuaternionAverage(Default::default()))
        }
    }));
    let [one, two] = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().ok());
    let stage = Stage { body: &body, bound: &bound, one: one.as_ref(), two: two.as_ref() };
    let mut findings =
        Findings { section: SECTION, title: "Strategies on hard poses", ..Findings::default() };
    let cases: Vec<&Case> = CASES.iter().step_by(if quick { 3 } else { 1 }).collect();
    let mut table = Table {
        labels: vec![label("strategy")],
        columns: cases.iter().map(|case| words(case.id)).collect(),
        remarks: vec![
            "holds; or what is wrong: r = off being a rotation (largest entry of RᵀR − I), w = degrees by which a turn of \
             the world is not followed. Affine covariances are no rotations by design: their r says by how much."
                .to_owned(),
        ],
        ..Table::new("poses", format!("Worst of {} Gaussians", bound.len()))
    };
    for strategy in &strategies {
        let mut cells = Vec::new();
        for case in &cases {
            let row = row(strategy, case.id, &stage.outcome(strategy, &(case.make)(&body))?);
            cells.push(table::Cell::text(shown_row(&row)));
            findings.rows.push(row);
        }
        table.rows.push(line([strategy.to_string()], cells));
    }
    findings.tables.push(table);
    shifts(&stage, &strategies, &mut findings)?;
    findings.causes = causes();
    Ok(findings)
}

fn row(strategy: &Strategy, input: &str, outcome: &Outcome) -> Row {
    let turned = outcome.equivariance.map_or(Verdict::Holds, |v| Verdict::of(v, LIMITS.degrees));
    let rotation = outcome.rotation_error.map_or(Verdict::Holds, |v| Verdict::of(v, LIMITS.rotation));
    let sound = outcome.finite && outcome.deterministic;
    Row {
        section: SECTION,
        family: "pose".to_owned(),
        input: input.to_owned(),
        subject: strategy.to_string(),
        precision: "f32",
        finite: Cell::Flag(outcome.finite),
        rotation_error: outcome.rotation_error.map_or(Cell::Word("no rotation"), Cell::number),
        error: Cell::Word("see averages"),
        equivariance: outcome.equivariance.map_or(Cell::Word("no rotation"), Cell::number),
        jump: Cell::Word("see sequences"),
        deterministic: Cell::Flag(outcome.deterministic),
        verdict: if sound { turned.max(rotation) } else { Verdict::Breaks },
        note: String::new(),
    }
}

fn shown_row(row: &Row) -> String {
    let mut wrong = Vec::new();
    if row.finite != Cell::Flag(true) {
        wrong.push("not finite".to_owned());
    }
    if row.deterministic != Cell::Flag(true) {
        wrong.push("not deterministic".to_owned());
    }
    if row.rotation_error.value().is_none_or(|v| v > LIMITS.rotation[0]) {
        wrong.push(format!("r {}", row.rotation_error));
    }
    if row.equivariance.value().is_some_and(|v| v > LIMITS.degrees[0]) {
        wrong.push(format!("w {}", row.equivariance));
    }
    if wrong.is_empty() { "holds".to_owned() } else { wrong.join(", ") }
}

/// How rotations change when body and all are far from the origin.
fn shifts(stage: &Stage<'_>, strategies: &[Strategy], findings: &mut Findings) -> Result<(), PosingError> {
    let at = second(stage.body, DVec3::new(0.9, 0.4, 0.7));
    let home = PosedBody::new(stage.body, &at)?;
    let mut table = Table {
        labels: vec![label("strategy")],
        columns: SHIFTS.map(|d| column(format!("{} m", shown(d)))).into(),
        ..Table::new("shifts", "The body shifted: largest change of a rotation, degrees")
    };
    let bodies = SHIFTS
        .map(|shift| PosedBody::new(stage.body, &stage::moved(&at, DQuat::IDENTITY, DVec3::splat(shift))));
    for strategy in strategies {
        let here = pose(stage.bound, &home, strategy)?;
        let Some(own) = &here.rotations else { continue };
        let changes: Vec<f64> = bodies
            .par_iter()
            .map(|body| -> Result<f64, PosingError> {
                let body = body.as_ref().map_err(Clone::clone)?;
                let there = pose(stage.bound, body, strategy)?;
                let rotations = there.rotations.unwrap_or_default();
                let pairs = own.iter().zip(&rotations).map(|(a, b)| (a.map(f64::from), b.map(f64::from)));
                Ok(pairs.map(|(a, b)| angle_between(a, b).to_degrees()).fold(0.0, worse))
            })
            .collect::<Result<_, _>>()?;
        for (&shift, &change) in SHIFTS.iter().zip(&changes) {
            let verdict = Verdict::of(change, LIMITS.degrees);
            findings.rows.push(Row {
                family: "body shifted".to_owned(),
                input: format!("{} m", shown(shift)),
                error: Cell::number(change),
                rotation_error: Cell::Word("see pose"),
                equivariance: Cell::Word("see pose"),
                deterministic: Cell::Word("see pose"),
                verdict,
                ..row(
                    strategy,
                    "",
                    &Outcome { finite: true, rotation_error: None, equivariance: None, deterministic: true },
                )
            });
        }
        if let Some(first) = changes.iter().position(|&c| Verdict::of(c, LIMITS.degrees) == Verdict::Breaks) {
            findings.thresholds.push(Threshold {
                section: SECTION,
                family: "body shifted".to_owned(),
                subject: strategy.to_string(),
                precision: "f32",
                breaks_at: SHIFTS[first],
                said: SHIFTS[first],
                axis: "metres".to_owned(),
            });
        }
        let cells = changes.iter().map(|&change| Cell::number(change).into());
        table.rows.push(line([strategy.to_string()], cells.collect()));
    }
    findings.tables.push(table);
    Ok(())
}

fn causes() -> Vec<String> {
    [
        "gram-schmidt-rows and matrix-to-quaternion read coordinate axes of the world, so turning the world changes their \
         answer; the raw conversion is no rotation wherever bones disagree. Broken by method.",
        "power-N-ones and squaring-N start from, or read, a coordinate axis of the quaternions: the same.",
        "vertex-quaternions-w and -largest add quaternions whose signs were fixed one by one: faces of one vertex on \
         different sides cancel. vertex-quaternions-align has a sign rule that turns with the world.",
        "Face and vertex frames are read from a posed mesh stored in f32: far from the origin its edges are rounding. \
         Rotations from joints do not depend on where the body is. Shift body and camera back together (both are f64) \
         before posing.",
    ]
    .map(str::to_owned)
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::rotation::normalize;

    #[test]
    fn a_longer_quaternion_is_no_rotation() {
        let q = normalize([1.0, 2.0, 3.0, 4.0]).unwrap();
        assert!(rotation_error(&drawn(q)) < 1e-15);
        assert!(rotation_error(&drawn(q.map(|c| 1.01 * c))) > 1e-2);
    }
}
