//! Section `averages`: every solver and projection on every family of hard averages, in both precisions.

use super::exact::Exact;
use super::method::{Answer, METHODS, Method};
use super::problem::{FAMILIES, Family, Problem, random_rotation};
use super::table::{
    Cell, Findings, LIMITS, Row, Threshold, UNDETERMINED, Verdict, bisect, column, exactly, label,
    line as row, shown,
};
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::math::{Matrix3, Quaternion, Real, matrix3, rotation};
use skinsplat_table::{self as table, Table};

const SECTION: &str = "averages";

/// Where the input no longer says which rotation is meant to within this, degrees, a solver is judged by how much it
/// loses of the maximum.
const UNDECIDED: f64 = 30.0;

/// One method on one family in one precision.
struct Line {
    rows: Vec<Row>,
    threshold: Option<Threshold>,
    invariance: Invariance,
}

/// The section. `quick`: every third point.
pub(super) fn run(quick: bool) -> Findings {
    let mut tasks = Vec::new();
    for precision in ["f64", "f32"] {
        for method in METHODS {
            tasks.extend(FAMILIES.iter().map(move |family| (precision, method, family)));
        }
    }
    let lines: Vec<Line> = tasks
        .par_iter()
        .map(|&(precision, method, family)| match precision {
            "f64" => line::<f64>(precision, method, family, quick),
            _ => line::<f32>(precision, method, family, quick),
        })
        .collect();
    let mut findings =
        Findings { section: SECTION, title: "Solvers on hard averages", ..Findings::default() };
    for (lines, tasks) in lines.chunks(FAMILIES.len() * METHODS.len()).zip(["f64", "f32"]) {
        findings.tables.push(verdicts(tasks, lines));
    }
    findings.tables.push(invariances(&lines));
    for line in lines {
        findings.rows.extend(line.rows);
        findings.thresholds.extend(line.threshold);
    }
    findings.causes = causes();
    findings
}

/// What a problem is in the precision `T`, and its exact answer there.
struct Posed<T> {
    quats: Vec<Quaternion<T>>,
    weights: Vec<T>,
    exact: Exact,
}

impl<T: Real> Posed<T> {
    fn new(problem: &Problem) -> Option<Self> {
        let quats: Vec<Quaternion<T>> = problem.quats.iter().map(|q| q.map(T::from_f64)).collect();
        let weights: Vec<T> = problem.weights.iter().map(|&w| T::from_f64(w)).collect();
        let wide: Vec<Quaternion<f64>> = quats.iter().map(|q| q.map(T::to_f64)).collect();
        let exact = Exact::new(&wide, &weights.iter().map(|w| w.to_f64()).collect::<Vec<_>>())?;
        Some(Self { quats, weights, exact })
    }

    /// Degrees by which rounding of the input alone may turn the answer.
    fn allowed(&self) -> f64 {
        (8.0 * T::EPSILON.to_f64() / self.exact.gap.max(1e-300)).min(1e3).to_degrees()
    }
}

/// What was measured of one answer.
struct Measured {
    rotation_error: f64,
    degrees: f64,
    verdict: Verdict,
    note: String,
}

fn measure<T: Real>(posed: &Posed<T>, answer: Option<Answer>) -> Option<Measured> {
    let answer = answer?;
    let rotation_error = rotation_error(&answer.matrix);
    let (degrees, allowed) = (posed.exact.error_degrees(answer.quat), posed.allowed());
    let (by_distance, note) = if posed.exact.dimensions > 1 || allowed > UNDECIDED {
        let loss = posed.exact.loss(answer.quat);
        // Second order in the angle: what is lost is judged as the angle that would lose it where the gap is wide.
        let as_degrees =
            2.0 * portable::asin((loss - 32.0 * T::EPSILON.to_f64()).max(0.0).sqrt().min(1.0)).to_degrees();
        (Verdict::of(as_degrees, LIMITS.degrees), format!("{UNDETERMINED}; loses {} of λ1", shown(loss)))
    } else {
        (Verdict::of((degrees - allowed).max(0.0), LIMITS.degrees), String::new())
    };
    let verdict = by_distance.max(Verdict::of(rotation_error, LIMITS.rotation));
    Some(Measured { rotation_error, degrees, verdict, note })
}

/// The larger of the largest entry of RᵀR − I and |det R − 1|.
pub(super) fn rotation_error(r: &Matrix3<f64>) -> f64 {
    let product = matrix3::multiply(matrix3::transpose(*r), *r);
    let identity = matrix3::identity::<f64>();
    let entries = product.iter().flatten().zip(identity.iter().flatten()).map(|(a, b)| (a - b).abs());
    // Not `max`, which would lose a NaN.
    let mut worst = (matrix3::determinant(*r) - 1.0).abs();
    for entry in entries {
        worst = if entry > worst || entry.is_nan() { entry } else { worst };
    }
    worst
}

fn line<T: Real>(precision: &'static str, method: Method, family: &Family, quick: bool) -> Line {
    let mut line = Line { rows: Vec::new(), threshold: None, invariance: Invariance::default() };
    let mut sound: Option<f64> = None;
    let points = family
        .points
        .iter()
        .enumerate()
        .filter(|(i, _)| !quick || i % 3 == 0 || i + 1 == family.points.len());
    for (_, &x) in points {
        let problem = family.problem(x);
        let Some(posed) = Posed::<T>::new(&problem) else { continue };
        let answer = method.answer(&posed.quats, &posed.weights);
        let again = method.answer(&posed.quats, &posed.weights);
        let measured = measure(&posed, answer);
        let invariance = Invariance::of(method, &posed, answer);
        let verdict = measured.as_ref().map_or(Verdict::Breaks, |m| m.verdict);
        line.rows.push(Row {
            section: SECTION,
            family: family.id.to_owned(),
            input: exactly(family.said(x)),
            subject: method.to_string(),
            precision,
            finite: Cell::Flag(answer.is_some()),
            rotation_error: measured
                .as_ref()
                .map_or(Cell::Word("no answer"), |m| Cell::number(m.rotation_error)),
            error: measured.as_ref().map_or(Cell::Word("no answer"), |m| Cell::number(m.degrees)),
            equivariance: invariance.as_ref().map_or(Cell::Word("no answer"), |i| Cell::number(i.world)),
            jump: Cell::Word("see sequences"),
            deterministic: Cell::Flag(answer == again),
            verdict,
            note: measured.map_or_else(|| "ill-posed, said so".to_owned(), |m| m.note),
        });
        if posed.allowed() < LIMITS.degrees[0] {
            line.invariance.take_worst(invariance.as_ref());
        }
        match (verdict, sound) {
            (Verdict::Breaks, Some(before)) if line.threshold.is_none() => {
                line.threshold = threshold::<T>(method, family, before, x);
            }
            // Broken from the easiest input on.
            (Verdict::Breaks, None) if line.rows.len() == 1 => {
                line.threshold = Some(Threshold::new::<T>(method, family, x));
            }
            (Verdict::Breaks, _) => {}
            _ => sound = Some(x),
        }
    }
    line
}

fn threshold<T: Real>(method: Method, family: &Family, sound: f64, broken: f64) -> Option<Threshold> {
    let breaks = |x: f64| {
        Posed::<T>::new(&family.problem(x))
            .and_then(|posed| measure(&posed, method.answer(&posed.quats, &posed.weights)))
            .is_none_or(|measured| measured.verdict == Verdict::Breaks)
    };
    let breaks_at = if family.continuous { bisect(sound, broken, breaks) } else { broken };
    Some(Threshold::new::<T>(method, family, breaks_at))
}

impl Threshold {
    fn new<T: Real>(method: Method, family: &Family, breaks_at: f64) -> Self {
        Self {
            section: SECTION,
            family: family.id.to_owned(),
            subject: method.to_string(),
            precision: if T::EPSILON.to_f64() < 1e-10 { "f64" } else { "f32" },
            breaks_at,
            axis: family.axis.to_owned(),
            said: family.said(breaks_at),
        }
    }
}

/// Degrees by which an answer changes where it should not.
#[derive(Clone, Copy, Debug, Default)]
struct Invariance {
    /// After a turn of the world.
    world: f64,
    /// After a turn of the rest pose.
    rest: f64,
    /// After signs of quaternions were changed.
    signs: f64,
    /// After the bones were reordered.
    order: f64,
    /// After one bone was named twice with half its weight.
    split: f64,
    /// Answers lost.
    unanswered: usize,
}

impl Invariance {
    fn of<T: Real>(method: Method, posed: &Posed<T>, answer: Option<Answer>) -> Option<Self> {
        let own = answer?.quat;
        let mut random = SplitMix64::new(77);
        let [left, right] = [random_rotation(&mut random), random_rotation(&mut random)];
        let mut unanswered = 0;
        let mut changed = |quats: Vec<Quaternion<T>>, weights: Vec<T>, expected: Quaternion<f64>| match method
            .answer(&quats, &weights)
        {
            Some(found) => angle_between(found.quat, expected).to_degrees(),
            None => {
                unanswered += 1;
                0.0
            }
        };
        let (quats, weights) = (&posed.quats, &posed.weights);
        let narrow = |q: Quaternion<f64>| q.map(T::from_f64);
        let turned =
            |f: &dyn Fn(Quaternion<T>) -> Quaternion<T>| quats.iter().map(|&q| f(q)).collect::<Vec<_>>();
        let world = changed(
            turned(&|q| rotation::multiply(narrow(left), q)),
            weights.clone(),
            rotation::multiply(left, own),
        );
        let rest = changed(
            turned(&|q| rotation::multiply(q, narrow(right))),
            weights.clone(),
            rotation::multiply(own, right),
        );
        let flipped =
            quats.iter().enumerate().map(|(i, q)| if i % 2 == 1 { q.map(|c| -c) } else { *q }).collect();
        let signs = changed(flipped, weights.clone(), own);
        let order =
            changed(quats.iter().rev().copied().collect(), weights.iter().rev().copied().collect(), own);
        let half = T::from_f64(0.5);
        let (mut more, mut shares) = (quats.clone(), weights.clone());
        more.push(quats[0]);
        shares[0] = weights[0] * half;
        shares.push(shares[0]);
        let split = changed(more, shares, own);
        Some(Self { world, rest, signs, order, split, unanswered })
    }

    fn take_worst(&mut self, other: Option<&Self>) {
        let Some(other) = other else { return };
        for (own, other) in [
            (&mut self.world, other.world),
            (&mut self.rest, other.rest),
            (&mut self.signs, other.signs),
            (&mut self.order, other.order),
            (&mut self.split, other.split),
        ] {
            *own = own.max(other);
        }
        self.unanswered += other.unanswered;
    }
}

fn verdicts(precision: &str, lines: &[Line]) -> Table {
    let line = |(method, lines): (&Method, &[Line])| {
        row(
            [method.to_string()],
            lines.iter().zip(FAMILIES.iter()).map(|(line, family)| summary(line, family)).collect(),
        )
    };
    // The families are the same in both precisions: explained once.
    let family = |family: &Family| match precision {
        "f64" => column(family.id).about(format!("{}; the axis is {}", family.about, family.said_axis())),
        _ => column(family.id),
    };
    Table {
        labels: vec![label("method")],
        columns: FAMILIES.iter().map(family).collect(),
        rows: METHODS.iter().zip(lines.chunks(FAMILIES.len())).map(line).collect(),
        ..Table::new(format!("averages-{precision}"), format!("Against the exact answer, {precision}"))
    }
}

fn summary(line: &Line, family: &Family) -> table::Cell {
    if let Some(threshold) = &line.threshold {
        let words = format!("breaks {}", family.at(threshold.said));
        return table::Cell::phrase(threshold.said, words);
    }
    let worst = line.rows.iter().map(|row| row.verdict).max().unwrap_or(Verdict::Holds);
    let first = line.rows.iter().find(|row| row.verdict == worst);
    match (worst, first) {
        (Verdict::Holds, _) | (_, None) => table::Cell::text("holds"),
        (Verdict::Degrades, Some(row)) => {
            let at: f64 = row.input.parse().unwrap_or(f64::NAN);
            table::Cell::phrase(at, format!("degrades {}", family.at(at)))
        }
        (Verdict::Breaks, Some(_)) => table::Cell::text("breaks"),
    }
}

fn invariances(lines: &[Line]) -> Table {
    let columns = ["world turned", "rest pose turned", "signs", "order", "one bone split"];
    let mut rows = Vec::new();
    let by_method = lines.chunks(FAMILIES.len());
    let subjects = ["f64", "f32"].into_iter().flat_map(|p| METHODS.iter().map(move |m| (p, m)));
    for ((precision, method), lines) in subjects.zip(by_method) {
        let mut worst = Invariance::default();
        lines.iter().for_each(|line| worst.take_worst(Some(&line.invariance)));
        let numbers = [worst.world, worst.rest, worst.signs, worst.order, worst.split];
        let cells = numbers.map(|v| Cell::number(v).into()).into();
        rows.push(row([method.to_string(), precision.to_owned()], cells));
    }
    let least = shown(LIMITS.degrees[0]);
    Table {
        labels: vec![label("method"), label("precision")],
        columns: columns.map(column).into(),
        rows,
        remarks: vec![format!("Over the inputs that determine the answer to {least}° or better.")],
        ..Table::new("invariances", "What should not matter: largest change of the answer, degrees")
    }
}

/// The input of a row of this section, and what it is; none of another section's.
pub(super) fn said_of(row: &Row) -> Option<(f64, &'static str)> {
    let family = FAMILIES.iter().find(|known| known.id == row.family)?;
    Some((row.input.parse().ok()?, family.said_axis()))
}

fn causes() -> Vec<String> {
    [
        "closed-form, eigen, polar: exact for every input that determines an answer; in a tie they give the documented \
         element of the top eigenspace.",
        "power-N: the error shrinks by λ2/λ1 per step, which goes to 1 towards 180°: no fixed number of steps is enough, \
         and a start vector at right angles to the answer (identity, ones) finds it never or late. Broken by method.",
        "squaring-N: 2^N power steps; the same limit, later.",
        "nlerp, dual-quaternion: a sum of quaternions on the side of the heaviest bone: equal to the average for two \
         equal weights, off for unequal ones at large angles, and it jumps where a bone changes its side. Approximate by \
         method.",
        "gram-schmidt: keeps one axis of B and leaves the error to the others, so it depends on which axis comes first, \
         commutes with turns on one side only, and has no answer where B loses rank. Broken by method.",
        "matrix-to-quaternion: one un-normalised power step from a coordinate axis: not equivariant, wrong by degrees \
         long before 180°, and it assumes that weights sum to one. Raw, it is no rotation either. Broken by method.",
    ]
    .map(str::to_owned)
    .to_vec()
}
