//! The smallest gap of the eigenvalues over a motion: the bound that pairs of joints give, and the value itself by branch
//! and bound: only Gaussians whose group could be lower than the lowest found so far have their eigenvalues computed.

use super::super::groups::{self, Group};
use super::super::layout::Chunk;
use super::pose::PoseBounds;
use super::values::Extreme;
use skinsplat_core::math::Quaternion;
use skinsplat_core::math::average::eigen::SymmetricEigen;

/// Eigenvalue problems after which the search is given up: about a second.
const MOST_PROBLEMS: usize = 1_000_000;

/// At most the smallest gap of any Gaussian in any pose, and the first pose with it.
pub(super) fn bound(frames: &[PoseBounds<'_>]) -> Extreme {
    let gaps = frames.iter().enumerate().map(|(pose, frame)| Extreme { value: frame.gap(), pose });
    gaps.fold(Extreme { value: 1.0, pose: 0 }, lower)
}

fn lower(a: Extreme, b: Extreme) -> Extreme {
    if b.value < a.value { b } else { a }
}

/// The smallest gap and the first pose with it. The bound of one or two bones is their gap.
pub(super) fn exact(chunks: &[Chunk], frames: &[PoseBounds<'_>]) -> Option<Extreme> {
    let mut smallest = Extreme { value: 1.0, pose: 0 };
    let mut open: Vec<(f64, usize, &Group)> = Vec::new();
    for (pose, frame) in frames.iter().enumerate() {
        for (group, gap) in frame.gaps() {
            if group.joints.len() > 2 {
                open.push((gap, pose, group));
            } else {
                smallest = lower(smallest, Extreme { value: gap, pose });
            }
        }
    }
    // Stable: of equal bounds the first pose comes first.
    open.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
    let mut problems = 0;
    for (least, pose, group) in open {
        if least >= smallest.value {
            break;
        }
        problems += group.count as usize;
        if problems > MOST_PROBLEMS {
            return None;
        }
        let quats: Vec<_> = group.joints.iter().map(|&j| frames[pose].quats()[usize::from(j)]).collect();
        for weights in groups::weights(chunks, group) {
            smallest = lower(smallest, Extreme { value: gap(&quats, &weights), pose });
        }
    }
    Some(smallest)
}

/// λ1 − λ2 of Σ w q qᵀ; the weights sum to 1.
fn gap(quats: &[Quaternion<f64>], weights: &[f64]) -> f64 {
    let mut outer = [[0.0; 4]; 4];
    for (q, w) in quats.iter().zip(weights) {
        for i in 0..4 {
            for j in 0..4 {
                outer[i][j] += w * q[i] * q[j];
            }
        }
    }
    let values = SymmetricEigen::new(outer).values;
    (values[0] - values[1]).clamp(0.0, 1.0)
}
