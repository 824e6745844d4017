//! Section `sequences`: smooth motions through degenerate poses. Does the rotation jump, and what does the remedy cost?

use super::exact::Exact;
use super::stage::{self, PROBES};
use super::table::{Cell, Findings, LIMITS, Row, Verdict, column, label, line, shown};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use skinsplat_core::math::portable::{cos, sin};
use skinsplat_core::math::rotation::{angle_between, polar};
use skinsplat_core::math::{Quaternion, dot4};
use skinsplat_core::scene::{Pose, PosedBody, RestBody};
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, PosingError, RotationChoice, Strategy};
use skinsplat_table::{self as table, Table};

const SECTION: &str = "sequences";

/// Halvings of a frame in which a jump is looked for.
const HALVINGS: usize = 24;

/// The average is compared with the remedy where quaternions that belong together have at least this inner product:
/// rotations within 120° of each other, on the way that they took.
const NEAR: f64 = 0.5;

/// A smooth motion over \[0, 1\].
struct Sequence {
    id: &'static str,
    about: &'static str,
    angles: fn(f64) -> [DVec3; stage::BONES],
}

const SEQUENCES: [Sequence; 6] = [
    Sequence {
        id: "twist",
        about: "the second joint twists by 350°",
        angles: |t| [DVec3::ZERO, DVec3::X * t * 350f64.to_radians(), DVec3::ZERO, DVec3::ZERO],
    },
    Sequence {
        id: "bend",
        about: "the second joint bends by 350°",
        angles: |t| [DVec3::ZERO, DVec3::Z * t * 350f64.to_radians(), DVec3::ZERO, DVec3::ZERO],
    },
    Sequence {
        id: "chain",
        about: "three joints twist by 115° each: 345° from end to end, no joint beyond 180° of its parent",
        angles: |t| {
            let twist = DVec3::X * t * 115f64.to_radians();
            [DVec3::ZERO, twist, twist, twist]
        },
    },
    Sequence {
        id: "tumble",
        about: "three joints turn by up to 170° about axes that turn as well",
        angles: |t| {
            let axis = |k: f64| {
                DVec3::new(cos(5.0 * t + k), sin(4.0 * t + 2.0 * k), cos(3.0 * t + 3.0 * k)).normalize()
            };
            let angle = (170.0 * sin(std::f64::consts::PI * t)).to_radians();
            [DVec3::ZERO, axis(0.0) * angle, axis(1.0) * angle, axis(2.0) * angle]
        },
    },
    Sequence {
        id: "two turns",
        about: "the second joint twists by 720°: at 360° the quaternions of two bones are opposite",
        angles: |t| [DVec3::ZERO, DVec3::X * t * 720f64.to_radians(), DVec3::ZERO, DVec3::ZERO],
    },
    Sequence {
        id: "world",
        about: "a pose bent by 100° turns twice as a whole",
        angles: |t| {
            let turn = DVec3::new(0.6, 0.0, 0.8) * t * 720f64.to_radians();
            [turn, DVec3::Y * 100f64.to_radians(), DVec3::X * 70f64.to_radians(), DVec3::ZERO]
        },
    },
];

/// What is tried: a strategy, and whether signs follow the frame before.
#[derive(Clone, Copy)]
struct Subject {
    strategy: Strategy,
    follows: bool,
}

impl Subject {
    fn name(&self) -> String {
        match (self.strategy.rotation, self.follows) {
            (RotationChoice::LiftedSum, false) => "lifted-sum (nearest to rest)".to_owned(),
            (RotationChoice::LiftedSum, true) => "lifted-sum (nearest to previous)".to_owned(),
            (rotation, _) => rotation.to_string(),
        }
    }
}

/// One moment: what was answered, and what the next moment follows.
struct Moment {
    t: f64,
    turns: Vec<Quaternion<f64>>,
    lift: JointLift,
}

struct Stage<'a> {
    body: &'a RestBody,
    bound: &'a BoundAvatar,
    sequence: &'a Sequence,
    subject: Subject,
}

impl Stage<'_> {
    fn pose_at(&self, t: f64) -> Pose {
        stage::bent(self.body, &(self.sequence.angles)(t))
    }

    fn at(&self, t: f64, before: Option<&Moment>) -> Result<Moment, PosingError> {
        let body = PosedBody::new(self.body, &self.pose_at(t))?;
        let before = before.filter(|_| self.subject.follows);
        let lift = JointLift::next(before.map(|moment| &moment.lift), &body);
        let mut poser = Poser::new();
        let options = PoseOptions { lift: Some(&lift), ..PoseOptions::default() };
        let posed = poser.pose(self.bound, &body, &self.subject.strategy, &options)?;
        let turns = match posed.rotations {
            Some(rotations) => rotations.iter().map(|q| q.map(f64::from)).collect(),
            None => posed.factors.iter().map(|m| turn_of(m.as_dmat3())).collect(),
        };
        Ok(Moment { t, turns, lift })
    }

    /// The largest change of a probe between two moments, degrees, and the probe.
    fn change(a: &Moment, b: &Moment) -> (f64, usize) {
        let changes =
            a.turns.iter().zip(&b.turns).map(|(&a, &b)| angle_between(a, b).to_degrees()).enumerate();
        changes.fold((0.0, 0), |worst, (i, v)| if v > worst.0 || v.is_nan() { (v, i) } else { worst })
    }

    /// What is left of a change when the step goes to 0.
    fn left(&self, mut a: Moment, mut b: Moment) -> Result<f64, PosingError> {
        for _ in 0..HALVINGS {
            let middle = self.at(0.5 * (a.t + b.t), Some(&a))?;
            b = self.at(b.t, Some(&middle))?;
            if Self::change(&a, &middle).0 >= Self::change(&middle, &b).0 {
                b = middle;
            } else {
                a = middle;
            }
        }
        Ok(Self::change(&a, &b).0)
    }
}

/// What one subject does in one sequence.
struct Course {
    jump: f64,
    left: f64,
    probe: &'static str,
    /// Degrees from the exact average, over probes and frames that determine it well: median and largest.
    deviation: [f64; 2],
    finite: bool,
}

fn course(stage: &Stage<'_>, frames: usize) -> Result<Course, PosingError> {
    let mut course = Course { jump: 0.0, left: 0.0, probe: PROBES[0].0, deviation: [0.0; 2], finite: true };
    let mut deviations = Vec::new();
    let mut previous = stage.at(0.0, None)?;
    let mut worst = None;
    for frame in 1..=frames {
        let next = stage.at(frame as f64 / frames as f64, Some(&previous))?;
        course.finite &= next.turns.iter().flatten().all(|c| c.is_finite());
        let (change, probe) = Stage::change(&previous, &next);
        if change > course.jump || change.is_nan() {
            (course.jump, course.probe) = (change, PROBES[probe].0);
            let again = Moment { t: next.t, turns: next.turns.clone(), lift: next.lift.clone() };
            worst = Some((std::mem::replace(&mut previous, next), again));
        } else {
            previous = next;
        }
        if frame % 8 == 0 {
            deviate(stage, &previous, &mut deviations)?;
        }
    }
    if let Some((a, b)) = worst {
        course.left = stage.left(a, b)?;
    }
    deviations.sort_unstable_by(f64::total_cmp);
    if let Some(&largest) = deviations.last() {
        course.deviation = [deviations[deviations.len() / 2], largest];
    }
    Ok(course)
}

fn deviate(stage: &Stage<'_>, moment: &Moment, deviations: &mut Vec<f64>) -> Result<(), PosingError> {
    let body = PosedBody::new(stage.body, &stage.pose_at(moment.t))?;
    let lifted = moment.lift.quaternions();
    for ((_, row), &turn) in PROBES.iter().zip(&moment.turns) {
        let near = |a: usize, b: usize| dot4(lifted[a], lifted[b]) > NEAR;
        if !row.iter().all(|&(a, _)| row.iter().all(|&(b, _)| near(a, b))) {
            continue;
        }
        let quats: Vec<_> =
            row.iter().map(|&(joint, _)| body.joints[joint].rotation).map(|q| [q.w, q.x, q.y, q.z]).collect();
        let weights: Vec<f64> = row.iter().map(|&(_, weight)| f64::from(weight)).collect();
        if let Some(exact) = Exact::new(&quats, &weights) {
            deviations.push(exact.error_degrees(turn));
        }
    }
    Ok(())
}

fn turn_of(m: DMat3) -> Quaternion<f64> {
    polar(m.transpose().to_cols_array_2d()).unwrap_or([f64::NAN; 4])
}

/// The section. `quick`: an eighth of the frames.
///
/// # Errors
/// None that the built-in body does not cause.
pub(super) fn run(quick: bool) -> Result<Findings, PosingError> {
    let frames = if quick { 90 } else { 720 };
    let body = stage::body()?;
    let bound = BoundAvatar::new(&stage::probes(&body)?, &body)?;
    let mut subjects: Vec<Subject> = stage::rotations()
        .into_iter()
        .map(|rotation| Subject { strategy: stage::plain(rotation), follows: false })
        .collect();
    subjects.push(Subject { strategy: stage::plain(RotationChoice::LiftedSum), follows: true });
    let tasks: Vec<(&Subject, &Sequence)> = subjects
        .iter()
        .flat_map(|subject| SEQUENCES.iter().map(move |sequence| (subject, sequence)))
        .collect();
    let courses = tasks
        .par_iter()
        .map(|&(subject, sequence)| {
            let stage = Stage { body: &body, bound: &bound, sequence, subject: *subject };
            course(&stage, frames)
        })
        .collect::<Result<Vec<Course>, PosingError>>()?;
    let rows = tasks.iter().zip(&courses).map(|((subject, sequence), course)| row(subject, sequence, course));
    Ok(Findings {
        section: SECTION,
        title: "Smooth sequences through degenerate poses",
        rows: rows.collect(),
        tables: vec![jumps(&subjects, &courses, frames), remedy(&subjects, &courses)],
        causes: causes(),
        ..Findings::default()
    })
}

fn row(subject: &Subject, sequence: &Sequence, course: &Course) -> Row {
    let continuous = Verdict::of(course.left, LIMITS.jump_degrees);
    Row {
        section: SECTION,
        family: sequence.id.to_owned(),
        input: course.probe.to_owned(),
        subject: subject.name(),
        precision: "f32",
        finite: Cell::Flag(course.finite),
        rotation_error: Cell::Word("see poses"),
        error: Cell::number(course.deviation[1]),
        equivariance: Cell::Word("see poses"),
        jump: Cell::number(course.jump),
        deterministic: Cell::Word("see poses"),
        verdict: if course.finite { continuous } else { Verdict::Breaks },
        note: format!("{}° left of the jump as the step goes to 0", shown(course.left)),
    }
}

fn jumps(subjects: &[Subject], courses: &[Course], frames: usize) -> Table {
    let cell = |course: &Course| {
        let (jump, left) = (shown(course.jump), shown(course.left));
        let words = match Verdict::of(course.left, LIMITS.jump_degrees) {
            Verdict::Holds => format!("{jump}, continuous"),
            _ => format!("{jump}, jumps by {left} ({})", course.probe),
        };
        table::Cell::phrase(course.jump, words)
    };
    let rows = subjects.iter().zip(courses.chunks(SEQUENCES.len()));
    let row = |(subject, courses): (&Subject, &[Course])| {
        line([subject.name()], courses.iter().map(cell).collect())
    };
    Table {
        labels: vec![label("rotation")],
        columns: SEQUENCES.iter().map(|s| column(s.id).about(s.about)).collect(),
        rows: rows.map(row).collect(),
        remarks: vec![
            "Six probes with different weights; the largest change of any. \"Jumps by\" is what remains when the frame is \
             halved 24 times, and the probe that jumps."
                .to_owned(),
        ],
        ..Table::new("jumps", format!("Largest change per frame, degrees, {frames} frames"))
    }
}

/// The stock choice, the remedies, and what they cost.
fn remedy(subjects: &[Subject], courses: &[Course]) -> Table {
    let columns = [
        "largest change per frame",
        "left as the step goes to 0",
        "off the average, median",
        "off the average, largest",
    ];
    let mut rows = Vec::new();
    for (k, sequence) in SEQUENCES.iter().enumerate() {
        for (subject, courses) in subjects.iter().zip(courses.chunks(SEQUENCES.len())) {
            let rotation = subject.strategy.rotation;
            let stock = rotation
                == RotationChoice::QuaternionAverage(skinsplat_core::math::average::Solver::ClosedForm);
            if !stock && rotation != RotationChoice::LiftedSum {
                continue;
            }
            let course = &courses[k];
            let numbers = [course.jump, course.left, course.deviation[0], course.deviation[1]];
            let cells = numbers.map(|value| Cell::number(value).into());
            rows.push(line([sequence.id.to_owned(), subject.name()], cells.into()));
        }
    }
    Table {
        labels: ["sequence", "rotation"].map(label).into(),
        columns: columns.map(column).into(),
        rows,
        remarks: vec![
            "Off the average: while the bones of a probe are within 120° of each other; the sum of quaternions weighs \
             unequal bones a little differently from Eq. 7."
                .to_owned(),
            "nearest to rest needs no memory and is continuous while every joint stays within 180° of its parent; \
             nearest to previous follows any motion, but its answer depends on the way there."
                .to_owned(),
        ],
        ..Table::new("remedy", "The remedy: signs that stay together, against the stock average, degrees")
    }
}

fn causes() -> Vec<String> {
    [
        "Exact averages jump where two equally heavy bones pass 180°: a function of rotations alone cannot avoid it \
         (turn a bone once around: the bones are back, their midpoint is opposite). The remedy remembers which way they \
         went: rotation=lifted-sum, skin --continuity rest or previous.",
        "nlerp, dual-quaternion: the same jump, and more where a bone changes its side of the heaviest one.",
        "lifted-sum jumps where the sum of two equally heavy quaternions vanishes, 360° apart on their way; from rest also \
         where a joint passes 180° of its parent.",
        "Face frames and vertex quaternions follow the mesh, which linear blending folds to nothing at 180°.",
    ]
    .map(str::to_owned)
    .to_vec()
}
