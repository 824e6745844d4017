//! A block of Gaussians, rotated by whatever a strategy reads, and the way back.

use super::super::lanes::{LANES, Lanes, identity, multiply, put, take};
use super::block::{BlockInput, Rotated};
use super::{LbsProjection, Source, average, dual, lbs, lifted, polar};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::rotation;

/// Rotates a block.
#[inline(always)]
pub(crate) fn rotate(arch: pulp::Arch, source: &Source<'_>, input: &BlockInput<'_>) -> Rotated {
    let (indices, weights) = input.chunk.influences(input.block);
    if indices.is_empty() {
        let still = identity();
        return Rotated { relative: still, drawn_by: still, posed: input.block.rotations, means: None };
    }
    let mut means = None;
    let relative = match source {
        Source::Lbs(
            projection @ (LbsProjection::MatrixToQuaternionRaw | LbsProjection::MatrixToQuaternion),
        ) => {
            return lbs::converted(arch, *projection, input);
        }
        Source::Identity => identity(),
        Source::Lbs(projection) => lbs::projected(*projection, input),
        Source::Average(solver) => {
            average::average(arch, input.joints, indices, weights, input.blend, *solver)
        }
        Source::Dual => {
            let motions = dual::blend(input.joints, indices, weights);
            means = Some(match input.growth() {
                None => motions.transform(&input.block.means),
                Some(growth) => motions.transform(&scaled(&input.block.means, &growth)),
            });
            motions.real
        }
        Source::PushForward(across) => polar::of_block(arch, input, *across),
        Source::Faces(faces) => faces.of_block(input),
        Source::Vertices(vertices) => vertices.of_block(input),
        Source::Lifted(lift) => lifted::summed(lift.quaternions(), input),
        Source::PerBlock(rotations) => rotations(input),
    };
    let posed = multiply(&relative, &input.block.rotations);
    Rotated { relative, drawn_by: relative, posed, means }
}

/// Draws a block rotated by the quaternion average, whatever R is.
#[inline(never)]
pub(crate) fn rotate_by_average(arch: pulp::Arch, input: &BlockInput<'_>, rotated: &mut Rotated) {
    let (indices, weights) = input.chunk.influences(input.block);
    rotated.drawn_by =
        average::average(arch, input.joints, indices, weights, input.blend, Solver::ClosedForm);
    rotated.posed = multiply(&rotated.drawn_by, &input.block.rotations);
}

/// The derivatives with respect to the canonical quaternions (to first order on the unit sphere) from those with respect
/// to [`Rotated::posed`]. `torque`, with respect to a further rotation of [`Rotated::relative`], is read only where R
/// depends on R_c.
#[inline(always)]
pub(crate) fn rotation_adjoint(
    arch: pulp::Arch,
    source: &Source<'_>,
    input: &BlockInput<'_>,
    rotated: &Rotated,
    posed: &[Lanes; 4],
    torque: Option<&[Lanes; 3]>,
) -> [Lanes; 4] {
    match source {
        Source::Lbs(projection) if projection.converts() && !input.block.influences.is_empty() => {
            lbs::converted_adjoint(arch, *projection, input, rotated, posed, torque)
        }
        _ => drawn_adjoint(rotated, posed),
    }
}

/// The same, where R_c is multiplied by [`Rotated::drawn_by`].
#[inline(always)]
pub(crate) fn drawn_adjoint(rotated: &Rotated, posed: &[Lanes; 4]) -> [Lanes; 4] {
    let mut canonical = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        let back = rotation::conjugate(take(&rotated.drawn_by, lane));
        put(&mut canonical, lane, rotation::multiply(back, take(posed, lane)));
    }
    canonical
}

/// Each lane of three axes times its factor.
fn scaled(axes: &[Lanes; 3], factors: &Lanes) -> [Lanes; 3] {
    axes.map(|axis| std::array::from_fn(|lane| axis[lane] * factors[lane]))
}

/// The derivatives with respect to the canonical means where [`Rotated::means`] takes the place of Eq. 6: Rᵀ g, times the
/// growth of joints that scale.
#[inline(always)]
pub(crate) fn means_adjoint(input: &BlockInput<'_>, rotated: &Rotated, gradient: &[Lanes; 3]) -> [Lanes; 3] {
    let mut means = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let back = rotation::quaternion_to_matrix_raw(rotation::conjugate(take(&rotated.relative, lane)));
        for axis in 0..3 {
            means[axis][lane] = back[axis][0] * gradient[0][lane]
                + back[axis][1] * gradient[1][lane]
                + back[axis][2] * gradient[2][lane];
        }
    }
    match input.growth() {
        None => means,
        Some(growth) => scaled(&means, &growth),
    }
}
