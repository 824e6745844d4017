//! What is enough at a tolerance.

use super::super::{LbsProjection, RotationChoice};
use super::pose::PoseBounds;
use super::values::{Bound, Degrees};
use skinsplat_core::math::average::{Solver, Start};
use std::fmt;

/// The exact average and what is cheaper than it, in order of cost: 34 and 38 nanoseconds per Gaussian (`cargo bench --bench
/// posing -- candidates`, 100,000 Gaussians without SH, one core). The normalised sum took 40 there, every other solver 75
/// and more.
const CANDIDATES: [RotationChoice; 2] = [
    RotationChoice::QuaternionAverage(Solver::Power { steps: 0, start: Start::Heaviest }),
    RotationChoice::QuaternionAverage(Solver::ClosedForm),
];

/// Power steps up to which an answer is looked for.
const MOST_STEPS: u32 = 100;

/// What is enough for a motion at a tolerance.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Verdict {
    /// Degrees.
    pub tolerance: f64,
    /// The cheapest choice of this program that keeps the tolerance in every pose; none if not even the exact average is
    /// certain to in `f32`.
    pub cheapest: Option<Bound>,
    /// The smallest tolerance that every pose can keep, degrees.
    pub reachable: Degrees,
    /// Power steps from the heaviest bone that are enough in every pose; none if 100 are not proved to be.
    pub power_steps: Option<u32>,
    /// Gram-Schmidt of the LBS matrix is enough in every pose.
    pub gram_schmidt: bool,
    /// How far it can be off, degrees.
    pub gram_schmidt_degrees: Degrees,
}

impl Verdict {
    pub(super) fn new(frames: &[PoseBounds<'_>], tolerance: f64) -> Self {
        let over = |choice| frames.iter().map(|frame| frame.degrees(choice)).fold(0.0, f64::max);
        let bound = |rotation| {
            let proved = frames.iter().map(|frame| frame.exact_degrees(rotation)).fold(0.0, f64::max);
            Bound { rotation, degrees: Degrees(over(rotation)), proved: Degrees(proved) }
        };
        let candidates = CANDIDATES.map(bound);
        let steps =
            |steps| RotationChoice::QuaternionAverage(Solver::Power { steps, start: Start::Heaviest });
        let gram_schmidt = over(RotationChoice::Lbs(LbsProjection::GramSchmidtColumns));
        Self {
            tolerance,
            cheapest: candidates.iter().find(|bound| bound.degrees.0 <= tolerance).copied(),
            reachable: candidates
                .iter()
                .map(|b| b.degrees)
                .fold(Degrees(f64::INFINITY), |a, b| if b < a { b } else { a }),
            power_steps: (0..=MOST_STEPS).find(|&n| over(steps(n)) <= tolerance),
            gram_schmidt: gram_schmidt <= tolerance,
            gram_schmidt_degrees: Degrees(gram_schmidt),
        }
    }
}

impl fmt::Display for Verdict {
    /// A sentence or three.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tolerance, .. } = self;
        match &self.cheapest {
            Some(Bound { rotation, degrees, .. }) => {
                write!(
                    f,
                    "At {tolerance}° the cheapest sufficient choice is {rotation}: within {degrees} of the exact average."
                )?;
            }
            None => {
                let reachable = self.reachable;
                write!(
                    f,
                    "No choice is certain to keep {tolerance}°: the smallest tolerance for this motion is {reachable}."
                )?;
            }
        }
        match self.power_steps {
            Some(0) => f.write_str(" An engine can take the heaviest bone alone")?,
            Some(steps) => {
                write!(f, " An engine that iterates needs {steps} power steps from the heaviest bone")?
            }
            None => write!(f, " Not even {MOST_STEPS} power steps are proved to be enough")?,
        }
        let answer = if self.gram_schmidt { "enough" } else { "not enough" };
        write!(f, "; LBS with Gram-Schmidt is {answer} ({}).", self.gram_schmidt_degrees)
    }
}
