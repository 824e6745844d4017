//! Hard rotation averages: families of problems along an axis, from easy to impossible.

use super::table::said;
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::math::{Quaternion, rotation};

/// Bones and weights.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    pub(super) quats: Vec<Quaternion<f64>>,
    pub(super) weights: Vec<f64>,
}

/// An axis towards half a turn from below.
const BELOW: &str = "180° less the relative angle, degrees";
/// An axis away from half a turn.
const BEYOND: &str = "relative angle less 180°, degrees";

/// Problems along one axis.
pub(super) struct Family {
    /// Short name, for columns.
    pub(super) id: &'static str,
    /// What the axis counts.
    pub(super) axis: &'static str,
    /// What is asked of a solver, in a sentence.
    pub(super) about: &'static str,
    /// Values on the axis, from easy to hard.
    pub(super) points: &'static [f64],
    /// The axis is continuous: the value at which something breaks can be found by bisection.
    pub(super) continuous: bool,
    make: fn(f64) -> Problem,
}

impl Family {
    pub(super) fn problem(&self, x: f64) -> Problem {
        (self.make)(x)
    }

    /// The value that a person would say for one on the axis: the relative angle itself, where the axis counts from 180 degrees so that
    /// it can come near them without cancellation.
    pub(super) fn said(&self, x: f64) -> f64 {
        match self.axis {
            BELOW => 180.0 - x,
            BEYOND => 180.0 + x,
            _ => x,
        }
    }

    /// Where a subject breaks, in words: with its unit, and on which side of it the harder inputs are.
    pub(super) fn at(&self, said_value: f64) -> String {
        let unit = match self.said_axis() {
            "bones" if said_value == 1.0 => " bone",
            "bones" => " bones",
            axis if axis.ends_with(", rad") => " rad",
            axis if axis.contains("degrees") => "°",
            _ => "",
        };
        let [easiest, hardest] = [self.points.first(), self.points.last()].map(|x| x.map(|&x| self.said(x)));
        let from_the_first = easiest == Some(said_value);
        let side = if self.continuous && hardest < easiest && !from_the_first { "below" } else { "at" };
        format!("{side} {}{unit}", said(said_value))
    }

    /// What that value is.
    pub(super) fn said_axis(&self) -> &'static str {
        match self.axis {
            BELOW | BEYOND => "relative angle, degrees",
            axis => axis,
        }
    }
}

/// Any rotation, uniformly: four normal deviates would do, a rejected cube does without logarithms.
pub(super) fn random_rotation(random: &mut SplitMix64) -> Quaternion<f64> {
    loop {
        let q = [(); 4].map(|()| 2.0 * f64::from(random.unit_f32()) - 1.0);
        let squared: f64 = q.iter().map(|c| c * c).sum();
        if (0.01..1.0).contains(&squared)
            && let Some(q) = rotation::normalize(q)
        {
            return q;
        }
    }
}

/// A turn by `degrees` about an axis that no coordinate prefers.
fn turn(degrees: f64) -> Quaternion<f64> {
    let (sin, cos) = portable::sin_cos(0.5 * degrees.to_radians());
    let [x, y, z] = [0.48, -0.64, 0.6].map(|c| c * sin);
    [cos, x, y, z]
}

/// A turn by 180 degrees less `short`, without cancellation.
fn nearly_half_turn(short: f64) -> Quaternion<f64> {
    let (sin, cos) = portable::sin_cos(0.5 * short.to_radians());
    let [x, y, z] = [0.48, -0.64, 0.6].map(|c| c * cos);
    [sin, x, y, z]
}

/// Where the bones stand in the world.
fn placed(quats: Vec<Quaternion<f64>>, weights: Vec<f64>) -> Problem {
    let base = random_rotation(&mut SplitMix64::new(5));
    Problem { quats: quats.into_iter().map(|q| rotation::multiply(base, q)).collect(), weights }
}

fn pair(second: Quaternion<f64>, weights: [f64; 2]) -> Problem {
    placed(vec![rotation::identity(), second], weights.to_vec())
}

fn random_bones(n: f64, spread: Option<f64>, seed: u64) -> Problem {
    let mut random = SplitMix64::new(seed ^ n.to_bits());
    let count = n as usize;
    let bone = |random: &mut SplitMix64| match spread {
        None => random_rotation(random),
        Some(degrees) => {
            let [_, x, y, z] = random_rotation(random);
            let length = (x * x + y * y + z * z).sqrt().max(1e-9);
            let (sin, cos) = portable::sin_cos(0.5 * (degrees * f64::from(random.unit_f32())).to_radians());
            [cos, x / length * sin, y / length * sin, z / length * sin]
        }
    };
    let quats = (0..count).map(|_| bone(&mut random)).collect();
    let shares: Vec<f64> = (0..count).map(|_| 0.05 + f64::from(random.unit_f32())).collect();
    let sum: f64 = shares.iter().sum();
    placed(quats, shares.into_iter().map(|share| share / sum).collect())
}

/// Three bones on orthogonal axes of R⁴, weights in steps of `gap`: the gap of the eigenvalues.
fn orthogonal(gap: f64) -> Problem {
    let right = random_rotation(&mut SplitMix64::new(9));
    let axes = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let quats = axes.map(|axis| rotation::multiply(axis, right)).to_vec();
    placed(quats, vec![1.0 + gap, 1.0, 1.0 - gap])
}

/// Half turns about three axes with shares m, m and the rest at the identity: det B = (1 − 4m)³-like, below 0 from 1/4.
fn reflection(m: f64) -> Problem {
    let right = random_rotation(&mut SplitMix64::new(13));
    let axes = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let quats = axes.map(|axis| rotation::multiply(axis, right)).to_vec();
    placed(quats, vec![1.0 - 2.0 * m, m, m])
}

/// Twists of ±θ/2 about one axis and a little of the middle.
fn candy_wrapper(degrees: f64) -> Problem {
    let half = 0.5 * degrees;
    placed(vec![turn(-half), rotation::identity(), turn(half)], vec![0.45, 0.1, 0.45])
}

fn antipodal(n: f64) -> Problem {
    let mut problem = random_bones(n, Some(60.0), 31);
    let negated: Vec<_> = problem.quats.iter().map(|q| q.map(|c| -c)).collect();
    problem.quats.extend(negated);
    problem.weights.iter_mut().for_each(|weight| *weight *= 0.5);
    problem.weights.extend_from_within(..);
    problem
}

fn scaled(n: f64, length: f64, weight: f64) -> Problem {
    let mut problem = random_bones(n, Some(90.0), 47);
    problem.quats.iter_mut().for_each(|q| *q = q.map(|c| c * length));
    problem.weights.iter_mut().for_each(|w| *w *= weight);
    problem
}

/// Every family.
pub(super) const FAMILIES: [Family; 15] = [
    Family {
        id: "small angle",
        axis: "relative angle, rad",
        about: "two bones, weights 0.3 and 0.7, almost the same rotation",
        points: &[1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-12],
        continuous: true,
        make: |x| pair(turn(x.to_degrees()), [0.3, 0.7]),
    },
    Family {
        id: "to 180°",
        axis: BELOW,
        about: "two bones of equal weight; a tie at 180°",
        points: &[179.9, 150.0, 90.0, 60.0, 30.0, 10.0, 3.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0],
        continuous: true,
        make: |x| pair(nearly_half_turn(x), [0.5, 0.5]),
    },
    Family {
        id: "beyond 180°",
        axis: BEYOND,
        about: "two bones of equal weight, more than half a turn apart: quaternions on opposite sides",
        points: &[170.0, 90.0, 30.0, 10.0, 3.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9],
        continuous: true,
        make: |x| pair(nearly_half_turn(-x), [0.5, 0.5]),
    },
    Family {
        id: "to 180°, 55:45",
        axis: BELOW,
        about: "two bones of unequal weight; unique up to and at 180°",
        points: &[179.9, 150.0, 90.0, 60.0, 30.0, 10.0, 3.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0],
        continuous: true,
        make: |x| pair(nearly_half_turn(x), [0.55, 0.45]),
    },
    Family {
        id: "gap by weight",
        axis: "difference of the weights",
        about: "two bones exactly 180° apart: the heavier one is the answer",
        points: &[0.99, 0.5, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15],
        continuous: true,
        make: |x| pair([0.0, 0.48, -0.64, 0.6], [0.5 * (1.0 + x), 0.5 * (1.0 - x)]),
    },
    Family {
        id: "gap, 3 bones",
        axis: "eigen gap over the first weight",
        about: "three bones at 180° of each other",
        points: &[0.99, 0.5, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15],
        continuous: true,
        make: orthogonal,
    },
    Family {
        id: "influences ≤ 60°",
        axis: "bones",
        about: "bones within 60° of one rotation",
        points: &[1.0, 2.0, 3.0, 4.0, 8.0, 16.0, 64.0, 256.0, 1000.0],
        continuous: false,
        make: |n| random_bones(n, Some(60.0), 17),
    },
    Family {
        id: "influences, any",
        axis: "bones",
        about: "rotations drawn uniformly",
        points: &[1.0, 2.0, 3.0, 4.0, 8.0, 16.0, 64.0, 256.0, 1000.0],
        continuous: false,
        make: |n| random_bones(n, None, 23),
    },
    Family {
        id: "tiny weight",
        axis: "weight of a bone 180° off",
        about: "one bone, and another of almost no weight",
        points: &[1e-1, 1e-3, 1e-8, 1e-16, 1e-30, 1e-37],
        continuous: true,
        make: |x| pair([0.0, 0.48, -0.64, 0.6], [1.0, x]),
    },
    Family {
        id: "small weight sum",
        axis: "factor on all weights",
        about: "five bones whose weights do not sum to one",
        points: &[1.0, 0.5, 1e-3, 1e-10, 1e-20, 1e-30],
        continuous: true,
        make: |x| scaled(5.0, 1.0, x),
    },
    Family {
        id: "large weight sum",
        axis: "factor on all weights",
        about: "five bones whose weights do not sum to one",
        points: &[1.0, 2.0, 10.0, 1e3, 1e6, 1e20],
        continuous: true,
        make: |x| scaled(5.0, 1.0, x),
    },
    Family {
        id: "length of q",
        axis: "factor on all quaternions",
        about: "five bones with quaternions that are not of unit length",
        points: &[1.0, 0.5, 1e-3, 1e-10, 1e-18, 1e-30],
        continuous: true,
        make: |x| scaled(5.0, x, 1.0),
    },
    Family {
        id: "antipodal",
        axis: "bones",
        about: "every bone named twice, as q and as −q",
        points: &[1.0, 2.0, 3.0, 8.0, 64.0],
        continuous: false,
        make: antipodal,
    },
    Family {
        id: "candy wrapper",
        axis: "degrees between opposite twists",
        about: "weights 0.45, 0.1, 0.45 at −θ/2, 0, +θ/2: 0 is the answer below 192.8°, 180° above",
        points: &[30.0, 90.0, 150.0, 170.0, 175.0, 179.0, 180.0, 185.0, 192.0],
        continuous: true,
        make: candy_wrapper,
    },
    Family {
        id: "det B < 0",
        axis: "share of each of two half turns",
        about: "a blend that mirrors from 0.25 on",
        points: &[0.1, 0.2, 0.249, 0.251, 0.26, 0.28, 0.3, 0.32, 0.333],
        continuous: true,
        make: reflection,
    },
];
