//! Bounds for all Gaussians of an avatar in one pose: a look at pairs of joints, not at Gaussians.

use super::super::groups::{Group, KEPT};
use super::super::{BoundAvatar, LbsProjection, RotationChoice};
use super::theory::{self, Spread, rounding};
use glam::DMat3;
use skinsplat_core::math::average::{Solver, Start};
use skinsplat_core::math::portable;
use skinsplat_core::math::{Quaternion, dot4, rotation};
use skinsplat_core::scene::PosedBody;

/// What is proved of one pose.
#[derive(Clone, Debug)]
pub struct PoseBounds<'a> {
    groups: &'a [Group],
    spreads: Vec<Spread>,
    /// The rotations of all joints.
    quats: Vec<Quaternion<f64>>,
    /// How far the linear part of a used joint is from its rotation: the largest entry of the difference.
    deviation: f64,
}

/// Beyond this a joint is no rotation, and projections of Σ w L are not of Σ w R: what posing calls rigid.
const RIGID: f64 = 1e-6;

/// The half-turn-free geometry of two joints.
#[derive(Clone, Copy)]
struct Angle {
    /// Quaternion angle, radians.
    half: f64,
    sine: f64,
    cosine: f64,
}

fn angle(p: Quaternion<f64>, q: Quaternion<f64>) -> Angle {
    let half = 0.5 * rotation::angle_between(p, q);
    let (sine, cosine) = portable::sin_cos(half);
    Angle { half, sine, cosine: cosine.max(0.0) }
}

impl<'a> PoseBounds<'a> {
    /// The bounds of a pose. Costs a few operations per pair of joints that share a Gaussian.
    pub fn new(bound: &'a BoundAvatar, body: &PosedBody<'_>) -> Self {
        let groups = bound.groups();
        let quats: Vec<Quaternion<f64>> =
            body.joints.iter().map(|j| [j.rotation.w, j.rotation.x, j.rotation.y, j.rotation.z]).collect();
        let used = groups.iter().flat_map(|group| &group.joints);
        let off = |&joint: &u16| {
            let joint = &body.joints[usize::from(joint)];
            (joint.linear - DMat3::from_quat(joint.rotation))
                .abs()
                .to_cols_array()
                .into_iter()
                .fold(0.0, f64::max)
        };
        let deviation = used.map(off).fold(0.0, f64::max);
        let spreads = groups.iter().map(|group| spread(group, &quats)).collect();
        Self { groups, spreads, quats, deviation }
    }

    /// At least the angle in degrees by which the drawn rotation of any Gaussian differs from the exact average (the one of
    /// [`Solver::Eigen`] in `f64` on the weights as stored, its rule for ties included), rounding allowed for. Infinite where
    /// nothing is proved: face frames, dual quaternions, unnormalised quaternions, bones too far apart.
    pub fn degrees(&self, choice: RotationChoice) -> f64 {
        self.worst(|group, spread| self.miss(choice, group, spread))
    }

    /// As [`Self::degrees`], in exact arithmetic on real numbers.
    pub fn exact_degrees(&self, choice: RotationChoice) -> f64 {
        self.worst(|group, spread| self.proved(choice, group, spread))
    }

    /// At least the angle in degrees by which the average changes if each Gaussian keeps its `kept` heaviest influences
    /// (1 to 4), their weights divided by their sum.
    pub fn fewer_influences(&self, kept: usize) -> f64 {
        let kept = kept.clamp(1, KEPT);
        self.worst(|group, spread| match kept {
            1 => 2.0 * spread.heaviest,
            _ => theory::fewer(spread, group.dropped[kept - 1]),
        })
    }

    /// The largest over all groups, degrees; a half turn says nothing.
    fn worst(&self, miss: impl Fn(&Group, &Spread) -> f64) -> f64 {
        let worst = self
            .groups
            .iter()
            .zip(&self.spreads)
            .map(|(group, spread)| miss(group, spread))
            .fold(0.0, f64::max);
        if worst < std::f64::consts::PI { worst.to_degrees() } else { f64::INFINITY }
    }

    /// At most the smallest (λ1 − λ2)/Σ w over the Gaussians.
    pub fn gap(&self) -> f64 {
        self.spreads.iter().map(|spread| spread.gap).fold(1.0, f64::min)
    }

    /// The groups, each with what is known of its gap, and the joints' rotations.
    pub(super) fn gaps(&self) -> impl Iterator<Item = (&'a Group, f64)> {
        self.groups.iter().zip(self.spreads.iter().map(|spread| spread.gap))
    }

    /// The rotations of all joints.
    pub(super) fn quats(&self) -> &[Quaternion<f64>] {
        &self.quats
    }

    /// What is proved, and what rounding adds.
    fn miss(&self, choice: RotationChoice, group: &Group, spread: &Spread) -> f64 {
        let proved = self.proved(choice, group, spread);
        let allowance = match choice {
            RotationChoice::QuaternionAverage(Solver::ClosedForm) if spread.bones > 2 => {
                // Joints that scale are averaged by their rotations.
                rounding::blended(spread, if self.deviation <= RIGID { self.deviation } else { 0.0 })
            }
            RotationChoice::QuaternionAverage(Solver::Nlerp) if spread.bones > 1 => rounding::summed(spread),
            RotationChoice::Lbs(projection) if spread.bones > 1 || projection.converts() => {
                rounding::projected(spread, self.deviation)
            }
            _ => rounding::STORED,
        };
        proved + allowance
    }

    fn proved(&self, choice: RotationChoice, group: &Group, spread: &Spread) -> f64 {
        match choice {
            RotationChoice::QuaternionAverage(solver) => self.solver(solver, group, spread),
            RotationChoice::Lbs(projection) if self.deviation <= RIGID => {
                match projection {
                    LbsProjection::Polar => 0.0,
                    LbsProjection::GramSchmidtColumns | LbsProjection::GramSchmidtRows => {
                        if spread.bones == 1 { 0.0 } else { theory::gram_schmidt(spread.gap) }
                    }
                    LbsProjection::MatrixToQuaternion => {
                        theory::column(spread.ratio(), 1.0, 0.26 * group.excess)
                    }
                    LbsProjection::MatrixToQuaternionRaw => f64::INFINITY,
                }
            }
            // Nothing is proved of any other.
            _ => f64::INFINITY,
        }
    }

    fn solver(&self, solver: Solver, group: &Group, spread: &Spread) -> f64 {
        match solver {
            Solver::ClosedForm | Solver::Eigen | Solver::Polar => 0.0,
            _ if spread.bones == 1 => 0.0,
            Solver::Power { steps, start } => theory::power(spread, self.start(start, group, spread), steps),
            Solver::Squaring { doublings } => {
                theory::column(spread.ratio(), portable::powi(2.0, doublings.min(1000) as i32), 0.0)
            }
            Solver::Nlerp => theory::sum(spread),
        }
    }

    /// At least the quaternion angle of a start vector to the average.
    fn start(&self, start: Start, group: &Group, spread: &Spread) -> f64 {
        let heaviest = self.quats[usize::from(group.joints[group.heaviest])];
        let towards = |q| spread.heaviest + angle(heaviest, q).half;
        match start {
            Start::Heaviest => spread.heaviest,
            Start::First => {
                theory::any_bone(spread, angle(heaviest, self.quats[usize::from(group.joints[0])]).half)
            }
            Start::Ones => towards([0.5; 4]),
            Start::Identity => towards(rotation::identity()),
            Start::Nlerp => 0.5 * theory::sum(spread),
            Start::LargestColumn => 0.5 * theory::column(spread.ratio(), 1.0, 0.0),
        }
    }
}

fn spread(group: &Group, quats: &[Quaternion<f64>]) -> Spread {
    if group.joints.len() == 1 {
        return Spread::ONE;
    }
    let quat = |joint: u16| quats[usize::from(joint)];
    let heaviest = quat(group.joints[group.heaviest]);
    let angles: Vec<Angle> = group.joints.iter().map(|&joint| angle(heaviest, quat(joint))).collect();
    let mut order: Vec<usize> = (0..angles.len()).filter(|&j| j != group.heaviest).collect();
    order.sort_by(|&i, &j| angles[j].half.total_cmp(&angles[i].half));
    let off = group.most(&order, |j| angles[j].sine * angles[j].sine);
    order.sort_by(|&i, &j| {
        (angles[j].sine * angles[j].cosine).total_cmp(&(angles[i].sine * angles[i].cosine))
    });
    let across = group.most(&order, |j| angles[j].sine * angles[j].cosine);
    let reach = angles.iter().map(|a| a.half).fold(0.0, f64::max);
    Spread::new(angles.len(), group.imbalance, reach, [disagreement(group, quats), off, across])
}

/// An upper bound of D = 2 Σ w_i w_j sin² h_ij: by the largest products, and by the widest pair.
fn disagreement(group: &Group, quats: &[Quaternion<f64>]) -> f64 {
    if group.products.is_empty() {
        return 0.5;
    }
    let (mut sum, mut widest) = (0.0, 0.0);
    for ((i, j), product) in group.pairs().zip(&group.products) {
        let cosine = dot4(quats[usize::from(i)], quats[usize::from(j)]);
        let squared = (1.0 - cosine * cosine).clamp(0.0, 1.0);
        sum += 2.0 * product * squared;
        widest = f64::max(widest, squared);
    }
    f64::min(sum, (1.0 - group.concentration) * widest)
}
