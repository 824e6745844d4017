//! From R back to the joints, for rotations that are read from nothing else: the way of pose gradients, one lane at a time.

use super::super::lanes::Lanes;
use super::{BlockInput, Source, average, lifted};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::dual_quaternion;

/// For sources that read the joints' own rotations or motions: calls `add` with each influence of a lane and the derivatives
/// with respect to a further rotation of its joint and to its translation, from that with respect to a further rotation of R and,
/// where the source moves means, to the mean. False, and nothing called, for other sources.
///
/// [`Solver::ClosedForm`] and what computes the same from a blend go through that blend instead, which is cheaper.
pub(crate) fn torques_to_joints(
    source: &Source<'_>,
    input: &BlockInput<'_>,
    lane: usize,
    (torque, of_mean): ([f32; 3], [f32; 3]),
    mut add: impl FnMut(usize, [f64; 3], [f64; 3]),
) -> bool {
    let (indices, weights) = input.chunk.influences(input.block);
    let torque_f64 = torque.map(f64::from);
    match source {
        Source::Average(Solver::ClosedForm | Solver::Eigen | Solver::Polar) => false,
        Source::Average(solver) => {
            let bone = |(&joint, weight): (&u16, &Lanes)| {
                (input.joints.rotation_f64[usize::from(joint)], f64::from(weight[lane]))
            };
            average::adjoint(indices.iter().zip(weights).map(bone), *solver, torque_f64, |bone, own| {
                add(bone, own, [0.0; 3]);
            });
            true
        }
        Source::Lifted(lift) => {
            lifted::adjoint(lift.quaternions(), (indices, weights), lane, torque_f64, |influence, own| {
                add(influence, own, [0.0; 3]);
            });
            true
        }
        Source::Dual => {
            let motions: Vec<_> =
                indices.iter().map(|&joint| input.joints.motion[usize::from(joint)]).collect();
            let own: Vec<f32> = weights.iter().map(|weight| weight[lane]).collect();
            let growth = input.growth().map_or(1.0, |growth| growth[lane]);
            let point = [0, 1, 2].map(|axis: usize| input.block.means[axis][lane] * growth);
            dual_quaternion::blend_adjoint(
                &motions,
                &own,
                (point, of_mean, torque),
                |influence, turn, shift| {
                    add(influence, turn.map(f64::from), shift.map(f64::from));
                },
            );
            true
        }
        Source::Identity
        | Source::Lbs(_)
        | Source::Faces(_)
        | Source::PushForward(_)
        | Source::Vertices(_)
        | Source::PerBlock(_) => false,
    }
}
